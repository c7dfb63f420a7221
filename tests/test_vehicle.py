"""A vehicle's files: what is refused, and in which words."""

import numpy as np
import pytest
from cars import CM_Y, MASS, variant

import models
from twin import PointMass, TwinError, Vehicle, loaded


def test_car_is_found_by_name_and_by_path():
    assert Vehicle.load("suv") == Vehicle.load(models.path("suv"))


def test_chassis_has_the_numbers_of_til_table_1():
    chassis = Vehicle.load("suv").chassis()
    assert chassis.mass == MASS
    np.testing.assert_allclose(chassis.cm, [0.0, CM_Y, 0.0], atol=1e-15)
    expected = [[834.23, 0.14, 0.097], [0.14, 3640.182, 3.86], [0.097, 3.86, 3932.77]]
    np.testing.assert_allclose(chassis.inertia, expected, rtol=1e-12, atol=1e-9)


def test_chassis_with_loads_is_their_composite():
    loads = [
        PointMass(name="driver", mass=80.0, position=np.array([0.1, 0.4, 0.1])),
        PointMass(name="boot", mass=120.0, position=np.array([-1.9, -0.2, 0.2])),
    ]
    vehicle = Vehicle.load("suv")
    laden, expected = vehicle.with_loads(loads).chassis(), loaded(vehicle.chassis(), loads)
    assert laden.mass == pytest.approx(expected.mass, rel=1e-15)
    np.testing.assert_allclose(laden.cm, expected.cm, rtol=1e-12)
    np.testing.assert_allclose(laden.inertia, expected.inertia, rtol=1e-9, atol=1e-6)


def test_missing_file_is_named(tmp_path):
    with pytest.raises(TwinError, match=r"gone\.xml: no such vehicle file"):
        Vehicle.load(tmp_path / "gone.xml")


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        ((r"</mujoco>", ""), r"car\.xml: .*XML"),
        (("spin_fl", "whirl_fl"), "has no joint named 'spin_fl'"),
        ((r'<gyro name="rates"', '<gyro name="turning"'), "has no sensor named 'rates'"),
        ((r'<numeric name="drag_area".*', ""), "has no numeric named 'drag_area'"),
        ((r'<text name="tyre_rear".*', ""), "has no text named 'tyre_rear'"),
        ((r'integrator="Euler"', 'integrator="RK4"'), "integrator must be Euler or implicitfast"),
        ((r'integrator="Euler"', 'integrator="implicit"'), "integrator must be Euler or"),
        (
            (r'name="drag_area" data="0.90"', 'name="drag_area" data="-1"'),
            "drag_area is -1.0; allowed",
        ),
        (
            (r'"steering_ratio" data="16"', '"steering_ratio" data="0"'),
            "steering_ratio is 0.0; allowed",
        ),
        ((r'name="hub_fl"', 'name="chassis"'), "repeated name 'chassis'"),
        ((r'mass="2125.8"', 'mass="-1"'), r"car\.xml: .*mass"),
    ],
)
def test_broken_vehicle_is_refused_in_one_line(tmp_path, edit, message):
    with pytest.raises(TwinError, match=message) as caught:
        variant(tmp_path, edit)
    assert "\n" not in str(caught.value)
    assert "car.xml" in str(caught.value)


def gyro_as(sensor):
    """Puts another sensor in the gyro's place, as the last one."""
    return (r'<gyro name="rates" site="imu"/>((?s:.*))</sensor>', rf"\1{sensor}</sensor>")


@pytest.mark.parametrize(
    "sensor", ['<jointvel name="rates" joint="spin_fl"/>', '<velocimeter name="rates" site="imu"/>']
)
def test_sensor_of_the_wrong_kind_is_refused(tmp_path, sensor):
    with pytest.raises(TwinError, match="rates"):
        variant(tmp_path, gyro_as(sensor))


def test_vehicle_that_hides_a_blow_up_is_refused(tmp_path):
    with pytest.raises(TwinError, match="autoreset"):
        variant(tmp_path, (' autoreset="disable"', ""))


def test_imu_away_from_the_chassis_frame_is_refused(tmp_path):
    # The states are those of the chassis frame, and are said to be the IMU's.
    with pytest.raises(TwinError, match="imu"):
        variant(tmp_path, ('<site name="imu"', '<site name="imu" pos="1 0 0"'))


def test_missing_tyre_file_is_named(tmp_path):
    vehicle = variant(
        tmp_path, (r'"tyre_front" data="tyres/suv.tir"', '"tyre_front" data="no.tir"')
    )
    with pytest.raises(TwinError, match=r"no\.tir"):
        vehicle.tyres()


def test_tyre_beside_the_vehicle_comes_first(tmp_path):
    vehicle = variant(tmp_path, tyre={"LMUX": 0.5})
    assert vehicle.tyres()["lmux"].tolist() == [0.5] * 4
    assert Vehicle.load("suv").tyres()["lmux"].tolist() == [1.0] * 4
