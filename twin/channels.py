"""Names and order of the inputs, measurements and states of every vehicle with four wheels.

ISO 8855 axes, SI units, wheels in the order front left, front right, rear left, rear right.
"""

WHEELS = ("fl", "fr", "rl", "rr")


def _wheels(name: str) -> tuple[str, ...]:
    return tuple(f"{name}_{wheel}" for wheel in WHEELS)


INPUTS = (
    "steering_wheel_angle",  # [rad], positive to the left
    *_wheels("drive_torque"),  # [N m], signed, between wheel and chassis
    *_wheels("brake_torque"),  # [N m], the most that a brake can hold; never negative
    *_wheels("road_height"),  # [m], under each wheel
)

# TiL Eq. (20): specific force [m/s2] and angular rate [rad/s] at the IMU, wheel speeds [rad/s]
OUTPUTS = (
    *("ax", "ay", "az", "roll_rate", "pitch_rate", "yaw_rate"),
    *_wheels("wheel_speed"),
)

# What a log may carry behind OUTPUTS: speeds of the IMU [m/s], sideslip,
# roll and pitch [rad], suspension travels [m], positive when the wheel moves up
FURTHER_OUTPUTS = (
    *("vx", "vy", "sideslip", "roll", "pitch"),
    *_wheels("suspension_travel"),
)

STATES = (
    *("x", "y", "z"),  # of the IMU, in the world [m]
    *("roll", "pitch", "yaw"),  # [rad]
    *_wheels("suspension_travel"),  # [m], positive when the wheel moves up
    *_wheels("wheel_angle"),  # [rad]
    *("vx", "vy", "vz"),  # of the IMU, in the body frame [m/s]
    *("roll_rate", "pitch_rate", "yaw_rate"),  # in the body frame [rad/s]
    *_wheels("suspension_rate"),  # [m/s]
    *_wheels("wheel_speed"),  # [rad/s]
)

# TiL Eq. (2): what a load changes, as the delta from the nominal chassis: mass [kg], CM [m] and
# inertia tensor about the body's own CM [kg m2]
LOAD = ("mass", "cm_x", "cm_y", "cm_z", "Jxx", "Jyy", "Jzz", "Jxy", "Jxz", "Jyz")
# What else of the car a model gets wrong, each as the relative delta from the nominal value: peak
# friction and cornering stiffness of the tyres, air drag, suspension springs with anti-roll bars
# (at the nominal ride height), dampers, relaxation lengths of the tyres, and what reaches the
# wheels of the known torques
SCALES = (
    *("tyre_friction", "cornering_stiffness", "drag", "spring", "damper", "relaxation"),
    *("drive_torque", "brake_torque"),
)
# Lateral forces [N] on the axles, at the road, that its tyres do not account for; to the left
FORCES = ("axle_force_front", "axle_force_rear")
PARAMETERS = (*LOAD, *SCALES, *FORCES)

# What a wheel's tyre does, in the frame of its contact patch: forces [N] and moments [N m] on the
# wheel, slip ratio [-], slip angle and camber [rad], relaxed as the tyre feels them.
TYRE_OUTPUTS = ("fx", "fy", "fz", "mx", "my", "mz", "slip_ratio", "slip_angle", "camber")

# The same of all four tyres: extended variables of TiL Eqs. (2)-(3)
EXTENDED = tuple(f"{name}_{wheel}" for wheel in WHEELS for name in TYRE_OUTPUTS)
