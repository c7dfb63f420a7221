"""Which parameters a drive identifies and which not, in sentences."""

import numpy as np

from estimators.joint.observer import JointEstimate
from estimators.joint.sensor_errors import SENSOR_ERROR
from twin import PARAMETER

# Correlation of two errors from which on neither parameter is identified apart from the other
TOGETHER = 0.95


def report(estimate: JointEstimate) -> list[str]:
    """One sentence for each parameter that is not identified, or only together with another.

    Args:
        estimate: identified is what it calls valid: a standard deviation well below the prior's.

    Returns:
        Sentences; none if the drive identifies everything.
    """
    covariance = estimate.covariance
    sd = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(sd, sd)
    np.fill_diagonal(correlation, 0.0)
    sentences = []
    for i, name in enumerate(estimate.estimated):
        if name in PARAMETER and not estimate.valid[-1, i]:
            share = 100.0 * sd[i] / estimate.prior[i]
            sentences.append(
                f"this drive does not identify {_words(name)} ({share:.0f} % of the uncertainty "
                f"is left): {PARAMETER[name].advice}"
            )
        k = int(np.argmax(np.abs(correlation[i])))
        if k < i and abs(correlation[i, k]) > TOGETHER:
            sentences.append(
                f"this drive identifies {_words(name)} only together with "
                f"{_words(estimate.estimated[k])} (correlation {correlation[i, k]:.2f})"
            )
    return sentences


def _words(name: str) -> str:
    return PARAMETER[name].words if name in PARAMETER else SENSOR_ERROR[name].words
