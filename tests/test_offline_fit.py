import numpy as np
import pytest
from cars import drive_of_other_car

from estimators.ensemble.offline_fit import OfflineFit
from estimators.identifiability.cramer_rao import cramer_rao, sensitivities
from twin import OUTPUTS, Twin, TwinError, Vehicle

LOAD = {"mass": 200.0, "cm_x": -0.05, "Jzz": 300.0}
SECONDS = 3.0


def observe(observer, drive, speed):
    observer.reset(speed, road=drive.inputs[0, 9:13])
    return observer.run(drive)


@pytest.fixture(scope="module")
def rich():
    return drive_of_other_car(LOAD, seconds=SECONDS, snr=10.0)


def fit(drive, sd, speed, **changes):
    return observe(OfflineFit(Vehicle.load("suv"), sd, tuple(LOAD), **changes), drive, speed)


@pytest.fixture(scope="module")
def found(rich):
    return fit(*rich)


def values(estimate):
    return np.array([estimate[name][-1] for name in LOAD])


def test_fit_without_noise_finds_the_load_exactly():
    found = fit(*drive_of_other_car(LOAD, seconds=SECONDS, snr=float("inf")))
    # but for the prior's pull, of the square of sd over prior sd
    np.testing.assert_allclose(values(found), list(LOAD.values()), rtol=5e-3)


def test_errors_are_those_that_the_fit_claims(found):
    assert (np.abs(values(found) - list(LOAD.values())) < 4.0 * found.sd[-1]).all()


def test_claimed_deviations_lie_between_the_bounds_with_known_and_with_free_offsets(rich, found):
    drive, sd, speed = rich
    sensitivity = sensitivities(Twin(Vehicle.load("suv")), drive, tuple(LOAD), LOAD, speed=speed)
    known = cramer_rao(tuple(LOAD), sensitivity, sd)
    free = cramer_rao(tuple(LOAD), sensitivity, sd, free_offsets=True)
    assert (found.sd[-1] > 0.98 * known.joint).all()
    assert (found.sd[-1] < 1.05 * free.joint).all()


def test_channel_without_measurements_is_left_out(rich):
    drive, sd, speed = rich
    gap = drive.measurements.copy()
    gap[:, OUTPUTS.index("ay")] = np.nan
    unused = np.where(np.arange(len(OUTPUTS)) == OUTPUTS.index("ay"), np.nan, sd)
    vehicle = Vehicle.load("suv")
    missing = drive.replace(measurements=gap)
    without = observe(OfflineFit(vehicle, sd, ("mass",)), missing, speed)
    never = observe(OfflineFit(vehicle, unused, ("mass",)), drive, speed)
    assert without["mass"][-1] == pytest.approx(never["mass"][-1], rel=1e-12)


def test_narrow_prior_holds_a_parameter(rich):
    held = fit(*rich, prior_sd={"Jzz": 1e-3})
    assert abs(held["Jzz"][-1]) < 1.0


def test_unknown_parameter_is_refused(rich):
    _, sd, _ = rich
    with pytest.raises(TwinError, match="fit: parameter 'weight' is unknown; allowed: mass,"):
        OfflineFit(Vehicle.load("suv"), sd, ("weight",))
