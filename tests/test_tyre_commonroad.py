"""The tyre against that of CommonRoad's multi-body car, an independent Magic Formula.

Its formulas are MF 5.2 with most coefficients left out: no load sensitivity (our load is the
nominal one, with p_Ky2 = 1 so that K_y = p_Ky1 F_z), no p_Ky3, no dependence of E on sign or
camber. What differs beyond that is said in each test.
"""

from dataclasses import asdict, replace

import numpy as np
import pytest
from vehiclemodels.parameters_vehicle2 import parameters_vehicle2
from vehiclemodels.utils import tire_model

from twin.tyre.magic_formula import magic_formula
from twin.tyre.record import TYRE_DTYPE

KAPPAS = (-1.0, -0.2, -0.04, 0.0, 0.01, 0.1, 0.7)
ALPHAS = (-0.8, -0.1, -0.02, 0.0, 0.03, 0.15, 1.2)
LOAD = 4500.0


@pytest.fixture(scope="module")
def theirs():
    """Their coefficients, less the vertical shift S_Vx.

    Theirs stands inside the sine, as an angle of F_z p_Vx1 rad; in MF 5.2 it is a force outside.
    """
    return replace(parameters_vehicle2().tire, p_vx1=0.0)


@pytest.fixture(scope="module")
def ours(theirs):
    """The same coefficients; what they leave out is 0, scaling factors are 1."""
    tyre = np.zeros(1, TYRE_DTYPE)
    for name in TYRE_DTYPE.names:
        if name.startswith("l"):
            tyre[name] = 1.0
    for name, value in asdict(theirs).items():
        tyre[name.replace("_", "")] = value
    tyre["fnomin"] = tyre["fzmin"] = LOAD
    tyre["fzmax"] = 2.0 * LOAD
    tyre["pky2"] = tyre["unloaded_radius"] = tyre["cammax"] = 1.0
    return tyre[0]


def forces(tyre, kappa, alpha, gamma):
    return magic_formula(tyre, LOAD, kappa, alpha, gamma, 20.0, 1.0)[:2]


@pytest.mark.parametrize("gamma", [-0.1, 0.0, 0.05])
@pytest.mark.parametrize("kappa", KAPPAS)
def test_longitudinal_force_agrees(ours, theirs, kappa, gamma):
    """Their slip has the opposite sign."""
    expected = tire_model.formula_longitudinal(-kappa, gamma, LOAD, theirs)
    assert forces(ours, kappa, 0.0, gamma)[0] == pytest.approx(expected, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("gamma", [1e-9, 0.05, 0.15])
@pytest.mark.parametrize("alpha", ALPHAS)
def test_lateral_force_agrees(ours, theirs, alpha, gamma):
    """They multiply ply steer and conicity by the sign of camber: the same above zero only."""
    expected, _ = tire_model.formula_lateral(alpha, gamma, LOAD, theirs)
    assert forces(ours, 0.0, alpha, gamma)[1] == pytest.approx(expected, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("gamma", [0.05, 0.15])
@pytest.mark.parametrize("alpha", ALPHAS)
@pytest.mark.parametrize("kappa", KAPPAS)
def test_combined_forces_agree(ours, theirs, kappa, alpha, gamma):
    """The slip of their combined formulas has our sign.

    At large slip angles their weight turns negative, a braked wheel drives; ours is 0 there.
    """
    fx0 = tire_model.formula_longitudinal(-kappa, gamma, LOAD, theirs)
    fy0, mu_y = tire_model.formula_lateral(alpha, gamma, LOAD, theirs)
    fx = tire_model.formula_longitudinal_comb(kappa, alpha, fx0, theirs)
    fx = fx if fx * fx0 > 0.0 else 0.0
    fy = tire_model.formula_lateral_comb(kappa, alpha, gamma, mu_y, LOAD, fy0, theirs)
    np.testing.assert_allclose(forces(ours, kappa, alpha, gamma), (fx, fy), rtol=1e-9, atol=1e-9)
