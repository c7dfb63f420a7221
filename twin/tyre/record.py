"""The record of a tyre: the numbers of all tyre models under one name each."""

import numpy as np

from twin.tyre.interface import MODELS
from twin.tyre.tir_6 import FIELDS
from twin.tyre.tir_keys import REQUIRED, SCALING

TYRE_DTYPE = np.dtype(
    [(key.lower(), np.float64) for keys in (*REQUIRED.values(), SCALING) for key in keys]
    + [
        (name, np.float64)
        for name in ("side", "cammax", "fzmin", "fzmax", "combined", *FIELDS, "model")
    ]
    + [(field.name, np.float64) for _, fields in MODELS.values() for field in fields],
    align=True,
)
"""A tyre: the numbers of its file under their lower-case names, SI units, and

* side: the side it was measured on, +1 left, -1 right;
* cammax: largest inclination [rad] the coefficients hold for;
* fzmin, fzmax: least and largest load [N] they hold for;
* combined: 1, or 0 if driving and cornering do not influence each other;
* what only MF 6 has, see `twin.tyre.tir_6`;
* model: its number in `twin.tyre.interface`, 0 for the Magic Formula;
* what other models have, see their modules.
"""


def new_tyre() -> np.ndarray:
    """A record (1,) with every factor 1 and everything else 0."""
    tyre = np.zeros(1, TYRE_DTYPE)
    for key in SCALING:
        tyre[key.lower()] = 1.0
    tyre["side"] = tyre["combined"] = 1.0
    return tyre
