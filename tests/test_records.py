"""One record per name: indices and slices of channels and parameters derive from them."""

import pytest

import twin
from twin import CHANNEL, INPUTS, LOAD, OUTPUTS, PARAMETER, PARAMETERS, SCALES, STATES, P, U, X, Y

BLOCKS = {
    "DRIVE_TORQUES": (INPUTS, ("drive_torque_fl", "drive_torque_rr"), 4),
    "BRAKE_TORQUES": (INPUTS, ("brake_torque_fl", "brake_torque_rr"), 4),
    "TORQUES": (INPUTS, ("drive_torque_fl", "brake_torque_rr"), 8),
    "ROAD_HEIGHTS": (INPUTS, ("road_height_fl", "road_height_rr"), 4),
    "ACCELERATIONS": (OUTPUTS, ("ax", "az"), 3),
    "RATES": (OUTPUTS, ("roll_rate", "yaw_rate"), 3),
    "IMU": (OUTPUTS, ("ax", "yaw_rate"), 6),
    "WHEEL_SPEEDS": (OUTPUTS, ("wheel_speed_fl", "wheel_speed_rr"), 4),
    "POSITION": (STATES, ("x", "z"), 3),
    "ROTATION": (STATES, ("roll", "yaw"), 3),
    "TRAVELS": (STATES, ("suspension_travel_fl", "suspension_travel_rr"), 4),
    "WHEEL_ANGLES": (STATES, ("wheel_angle_fl", "wheel_angle_rr"), 4),
    "VELOCITY": (STATES, ("vx", "vz"), 3),
    "ANGULAR_VELOCITY": (STATES, ("roll_rate", "yaw_rate"), 3),
    "TRAVEL_RATES": (STATES, ("suspension_rate_fl", "suspension_rate_rr"), 4),
    "SPINS": (STATES, ("wheel_speed_fl", "wheel_speed_rr"), 4),
    "CENTRE_OF_MASS": (PARAMETERS, ("cm_x", "cm_z"), 3),
    "INERTIA": (PARAMETERS, ("Jxx", "Jyz"), 6),
    "SCALE_FACTORS": (PARAMETERS, (SCALES[0], SCALES[-1]), len(SCALES)),
    "AXLE_FORCES": (PARAMETERS, ("axle_force_front", "axle_force_rear"), 2),
}


@pytest.mark.parametrize(
    ("index", "names"), [(U, INPUTS), (Y, OUTPUTS), (X, STATES), (P, PARAMETERS)]
)
def test_index_of_a_name_is_its_position(index, names):
    assert {name: getattr(index, name) for name in names} == {n: i for i, n in enumerate(names)}


@pytest.mark.parametrize("block", BLOCKS)
def test_slice_covers_its_block(block):
    names, (first, last), size = BLOCKS[block]
    found = names[getattr(twin, block)]
    assert (found[0], found[-1], len(found)) == (first, last, size)


def test_every_name_has_one_record_that_knows_its_unit():
    assert all(name == CHANNEL[name].name for name in CHANNEL)
    assert {*INPUTS, *OUTPUTS, *twin.FURTHER_OUTPUTS, *STATES, *twin.TYRE_OUTPUTS} == set(CHANNEL)
    assert CHANNEL["vz"].unit == "m/s"
    assert CHANNEL["suspension_rate_fl"].unit == "m/s"
    assert CHANNEL["brake_torque_rl"].unit == "N m"
    assert CHANNEL["slip_ratio"].unit == "1"


def test_every_parameter_can_be_differentiated_and_has_a_signal():
    assert [*PARAMETER] == [*PARAMETERS]
    for record in PARAMETER.values():
        assert record.step > 0.0
        assert record.low < 0.0 < record.high
        assert record.signal in OUTPUTS
        assert record.words
        assert record.advice
    assert all(PARAMETER[name].prior_sd > 0.0 for name in (*LOAD, *SCALES))
