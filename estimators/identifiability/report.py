"""What a drive could tell and what not, in plain words."""

import numpy as np

from estimators.joint.observer import JointEstimate

# What would tell a parameter
ADVICE = {
    "mass": "accelerate and brake",
    "cm_x": "brake hard, drive a bend",
    "cm_y": "accelerate, brake and drive bends to both sides",
    "cm_z": "drive bends, brake hard",
    "Jxx": "steer quickly to and fro, or drive over bumps on one side",
    "Jyy": "drive over bumps, or brake abruptly",
    "Jzz": "drive a bend, better steer quickly to and fro",
    "Jxy": "steer to and fro on a rough road",
    "Jxz": "steer quickly to and fro",
    "Jyz": "steer to and fro while braking",
    "tyre_friction": "brake hard or corner fast, near the limit",
    "cornering_stiffness": "drive bends",
    "drag": "drive fast and let the car coast",
    "spring": "drive bends and over bumps",
    "damper": "drive over bumps, steer to and fro",
    "relaxation": "steer quickly to and fro",
    "drive_torque": "accelerate hard, with bends besides",
    "brake_torque": "brake hard, with bends besides",
}
WORDS = {
    "mass": "the mass",
    "cm_x": "where the centre of mass lies along the car",
    "cm_y": "where the centre of mass lies across the car",
    "cm_z": "the height of the centre of mass",
    "Jxx": "the roll inertia",
    "Jyy": "the pitch inertia",
    "Jzz": "the yaw inertia",
    "tyre_friction": "the friction of the tyres",
    "cornering_stiffness": "the cornering stiffness of the tyres",
    "drag": "the air drag",
    "spring": "the stiffness of the springs",
    "damper": "the dampers",
    "relaxation": "the relaxation lengths of the tyres",
    "drive_torque": "the share of the drive torque that reaches the wheels",
    "brake_torque": "the share of the brake torque that reaches the wheels",
    "speed": "the speed",
}
# From here on two errors go together so far that neither parameter is told apart from the other
TOGETHER = 0.95


def report(estimate: JointEstimate) -> list[str]:
    """One sentence for each parameter that the drive did not tell, or not apart from another.

    "Told" is what the estimate calls valid: a standard deviation well below the prior's.

    Returns:
        Sentences; none if the drive told everything.
    """
    covariance = estimate.covariance
    sd = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(sd, sd)
    np.fill_diagonal(correlation, 0.0)
    sentences = []
    for i, name in enumerate(estimate.estimated):
        words = WORDS.get(name, name)
        if name in ADVICE and not estimate.valid[-1, i]:
            share = 100.0 * sd[i] / estimate.prior[i]
            sentences.append(
                f"this drive cannot tell {words} ({share:.0f} % of what was unknown still is): "
                f"{ADVICE[name]}"
            )
        k = int(np.argmax(np.abs(correlation[i])))
        if k < i and abs(correlation[i, k]) > TOGETHER:
            other = estimate.estimated[k]
            sentences.append(
                f"this drive tells {words} only together with {WORDS.get(other, other)} "
                f"(correlation {correlation[i, k]:.2f})"
            )
    return sentences
