"""What the joint observer estimates of a car that is not the one in the twin's files.

Besides the load and the scales of the twin, properties in which cars of one type differ. Source:
drawn cars that differ in one property each, the observer with the load and the scales alone: of
these an error of the load came that its standard deviation did not hold. With all of them at once
six drawn cars on 30 s of `mixed` had an error of the mass of 5 % of the load in place of 25 %
(medians), of cm_x 42 in place of 120 %.
"""

from twin import LOAD, SCALES

DIFFERENCES = (
    *("tyre_stiffness", "damper_asymmetry", "front_spring", "front_damper"),
    *("front_anti_roll", "rear_anti_roll", "roll_centre", "steering_ratio", "steering_delay"),
    *("front_cornering_stiffness", "rolling_radius", "unsprung_mass", "compliance_steer"),
    *("torque_delay", "lift", "front_brake_torque"),
)
REAL_CAR = (*LOAD, *SCALES, *DIFFERENCES)
"""Of `twin.PARAMETERS`, for `JointSettings.parameters`; half as fast as the default."""
