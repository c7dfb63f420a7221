import numpy as np
import pytest
from cars import inputs, run, suv, times

from twin import INPUTS, PARAMETERS, SCALES, STATES, Twin, TwinError, Vehicle
from twin.parameters import LARGEST_SCALE, LEAST_SCALE

FACTORS = {
    "tyre_friction": 0.9,
    "cornering_stiffness": 1.2,
    "drag": 1.3,
    "spring": 1.15,
    "damper": 0.8,
    "relaxation": 1.3,
    "drive_torque": 0.9,
    "brake_torque": 1.1,
}


def lively():
    """A second of steering and driving."""
    t = times(1.0)
    return inputs(
        1.0, steering=0.8 * np.sin(6.0 * t), drive=300.0 * np.sin(9.0 * t)[:, None], brake=100.0
    )


def deltas(**named):
    return np.array([named.get(name, 0.0) for name in PARAMETERS])


@pytest.mark.parametrize("name", SCALES)
def test_scale_set_at_run_time_equals_a_vehicle_made_with_it(name):
    factor = FACTORS[name]
    made = Twin(Vehicle.load("suv").scaled(**{name: factor}))
    put = suv()
    put.set_parameters(deltas(**{name: factor - 1.0}))
    plain = suv()
    outputs = []
    for twin in (made, put, plain):
        twin.reset(20.0)
        outputs.append(run(twin, lively()).outputs)
    np.testing.assert_allclose(outputs[0], outputs[1], rtol=1e-9, atol=1e-9)
    assert np.abs(outputs[0] - outputs[2]).max() > 1e-3


def test_springs_of_other_stiffness_keep_the_ride_height():
    heights = []
    for vehicle in (Vehicle.load("suv"), Vehicle.load("suv").scaled(spring=1.5)):
        twin = Twin(vehicle)
        twin.reset(0.0)
        heights.append(twin.read_states()[[STATES.index("z"), *range(6, 10)]])
    np.testing.assert_allclose(heights[1], heights[0], atol=2e-3)


def test_friction_bounds_the_steady_lateral_acceleration():
    u = np.zeros(len(INPUTS))
    u[0] = 2.5
    largest = []
    for friction in (0.3, 0.5):
        twin = Twin(Vehicle.load("suv").scaled(tyre_friction=friction))
        twin.reset(20.0)
        largest.append(np.median([twin.step(u)[1] for _ in range(2000)][1000:]))
    assert largest[1] / largest[0] == pytest.approx(0.5 / 0.3, rel=0.15)


def test_scales_compose():
    twice = Vehicle.load("suv").scaled(drag=2.0).scaled(drag=0.75, spring=1.1)
    assert dict(twice.scales) == {"drag": 1.5, "spring": 1.1}


def test_scale_out_of_range_comes_back_within():
    put = suv().set_parameters(deltas(spring=-5.0, drag=50.0))
    assert put[PARAMETERS.index("spring")] == LEAST_SCALE - 1.0
    assert put[PARAMETERS.index("drag")] == LARGEST_SCALE - 1.0


def test_scale_that_no_car_has_is_refused():
    with pytest.raises(TwinError, match="scale 'colour' is unknown; allowed: tyre_friction"):
        Vehicle.load("suv").scaled(colour=2.0)
    with pytest.raises(TwinError, match=r"scale drag is -1\.0; allowed: 0\.3 to 3"):
        Vehicle.load("suv").scaled(drag=-1.0)


def test_downforce_loads_the_axles_as_its_areas_say(tmp_path):
    text = Vehicle.load("suv").source.read_text()
    for axle, area in (("front", "0.4"), ("rear", "1.0")):
        text = text.replace(f'"lift_area_{axle}" data="0"', f'"lift_area_{axle}" data="{area}"')
    path = tmp_path / "winged.xml"
    path.write_text(text)
    loads = []
    for vehicle in (Vehicle.load("suv"), Vehicle.load(path)):
        twin = Twin(vehicle)
        twin.reset(50.0)
        twin.step(np.zeros(len(INPUTS)))
        loads.append(twin.tyre_forces()[:, 2])
    gain = (loads[1] - loads[0]).reshape(2, 2).sum(axis=1)
    np.testing.assert_allclose(gain, 0.5 * 1.2 * 50.0**2 * np.array([0.4, 1.0]), rtol=0.01)


def test_scale_of_an_axle_leaves_the_other_alone():
    before = Vehicle.load("suv").tyres()
    after = (
        Vehicle.load("suv").scaled(rear_cornering_stiffness=1.2, cornering_stiffness=0.9).tyres()
    )
    np.testing.assert_allclose(after["lky"] / before["lky"], [0.9, 0.9, 1.08, 1.08])


def test_steering_ratio_and_anti_roll_bar_scale():
    model = Vehicle.load("suv").scaled(steering_ratio=1.1, front_anti_roll=2.0).compile()
    assert model.numeric("steering_ratio").data[0] == pytest.approx(16.0 * 1.1)
    assert list(model.tendon_stiffness[:2]) == pytest.approx([40000.0, 10000.0])
