"""What a car tells of itself, against statics and a twin that stands."""

import numpy as np
import pytest
from cars import variant

from twin import PointMass, Twin, TwinError, Vehicle

CARS = ("suv", "sports_car", "bmw_320i", "ferrari_250lm")


@pytest.mark.parametrize("car", CARS)
def test_figures_are_those_of_a_standing_twin(car):
    vehicle = Vehicle.load(car)
    twin, figures = Twin(vehicle), vehicle.figures
    twin.step(np.zeros(13))
    loads = twin.tyre_forces()[:, 2].reshape(2, 2).sum(axis=1)
    np.testing.assert_allclose(figures.axle_load, loads, rtol=0.01)  # it settles by a few mm
    assert figures.mass == twin.model.body_mass.sum()
    assert figures.wheelbase == twin.car.wheelbase
    assert figures.steering_ratio == twin.car.steering_ratio
    assert figures.drag_area == twin.car.drag_area


def test_load_on_board_counts():
    empty = Vehicle.load("suv")
    trunk = PointMass(name="trunk", mass=100.0, position=np.array([-1.65, 0.0, 0.2]))
    loaded = empty.with_loads([trunk])
    assert loaded.figures.mass == pytest.approx(empty.figures.mass + 100.0)
    gain = np.subtract(loaded.figures.axle_load, empty.figures.axle_load)
    np.testing.assert_allclose(gain, [0.0, 981.0], atol=1e-6)  # above the rear axle


def test_grip_scales_with_the_tyres():
    plain = Vehicle.load("suv").grip
    changed = Vehicle.load("suv").scaled(tyre_friction=0.8, front_cornering_stiffness=1.2).grip
    ratio = np.divide(changed.friction, plain.friction)
    np.testing.assert_allclose(ratio, 0.8, rtol=0.02)
    stiffness = np.divide(changed.cornering_stiffness, plain.cornering_stiffness)
    np.testing.assert_allclose(stiffness, [1.2, 1.0])


def test_number_that_a_car_may_leave_out_is_checked_where_it_is_given(tmp_path):
    with pytest.raises(TwinError, match=r"numeric drive_front is 1\.4; allowed: .* at most 1"):
        variant(tmp_path, ('"drive_front" data="0.4"', '"drive_front" data="1.4"'))
