import numpy as np
import pytest

from estimators.least_squares import fit
from twin import TwinError

T = np.arange(2000) * 0.05
TRUE = np.array([1.5, -0.7, 0.2])
BOUNDS = ([-5.0, -5.0, -5.0], [5.0, 5.0, 5.0])


def model(x):
    return np.exp(-0.1 * x[0] * np.sin(T)) + x[1] * np.cos(0.3 * T) + x[2]


def problem(noise):
    measured = model(TRUE) + noise

    def residuals(points):
        return [(model(x) - measured)[:, None] for x in points]

    return residuals


def drifting(rng):
    """Noise with a memory of a second, of standard deviation 0.1."""
    noise, keep = np.empty(T.size), np.exp(-0.05)
    noise[0] = rng.normal()
    for k in range(1, T.size):
        noise[k] = keep * noise[k - 1] + np.sqrt(1.0 - keep**2) * rng.normal()
    return 0.1 * noise


def test_known_parameters_are_recovered():
    found = fit(problem(0.0), [0.0] * 3, BOUNDS, [1.0] * 3, block=100)
    np.testing.assert_allclose(found.values, TRUE, atol=1e-3)
    assert found.rms_after < 1e-3 < found.rms_before
    assert found.converged
    assert not found.at_bound.any()


def test_intervals_cover_the_truth_in_spite_of_drift():
    """Of 90 intervals of 95 % some 86 cover, also where each sample counts as independent: parts of
    the drive disagree by more than that, and widen the intervals.
    """
    covered = {}
    for block in (1, 200):
        rng = np.random.default_rng(5)
        hits = 0
        for _ in range(30):
            found = fit(problem(drifting(rng)), TRUE, BOUNDS, [1.0] * 3, block=block)
            hits += np.count_nonzero((found.low <= TRUE) & (found.high >= TRUE))
        covered[block] = hits / 90.0
    assert covered[200] > 0.85
    assert covered[1] > 0.85


def test_no_interval_is_wider_than_what_was_believed():
    """What the parts of a drive disagree by does not make worse what was known without it."""
    rng = np.random.default_rng(5)
    wide = fit(problem(30.0 * drifting(rng)), TRUE, BOUNDS, [1.0] * 3, block=200)
    assert np.all(wide.high - wide.low > 2.0 * 1.96 * 0.02)
    found = fit(
        problem(30.0 * drifting(rng)),
        TRUE,
        BOUNDS,
        [1.0] * 3,
        block=200,
        prior_sd=[0.02, 0.02, 0.02],
    )
    assert np.all(found.high - found.low <= 2.0 * 1.96 * 0.02 + 1e-12)


def test_value_at_its_bound_is_marked():
    found = fit(problem(0.0), [0.0] * 3, ([-5.0] * 3, [1.0, 5.0, 5.0]), [1.0] * 3, block=100)
    assert found.at_bound.tolist() == [True, False, False]
    assert found.values[0] == pytest.approx(1.0, abs=1e-3)


def test_parameter_that_changes_nothing_has_no_interval():
    def residuals(points):
        return [(x[0] - np.cos(T))[:, None] for x in points]

    found = fit(residuals, [0.5, 0.5], ([-2.0] * 2, [2.0] * 2), [1.0] * 2, block=100)
    assert np.isfinite(found.low[0])
    assert np.isnan(found.low[1])
    assert np.isnan(found.high[1])


def test_prior_holds_what_the_data_do_not_tell():
    def residuals(points):
        return [(x[0] + x[1] - np.cos(T) - 1.0)[:, None] for x in points]

    found = fit(
        residuals, [0.0, 0.0], ([-2.0] * 2, [2.0] * 2), [1.0] * 2, block=100, prior_sd=[0.1, 0.3]
    )
    # the sum is known; each takes its share by the square of what is believed of it
    mean = 1.0 + np.cos(T).mean()
    np.testing.assert_allclose(found.values, np.array([0.1, 0.9]) * mean, atol=0.02)
    assert np.isfinite(found.low).all()


def test_start_stays_where_derivatives_leave_the_bounds():
    """Derivatives at an upper bound are taken inwards."""
    seen = []

    def residuals(points):
        seen.extend(points)
        return [(x[0] - np.cos(T))[:, None] for x in points]

    fit(residuals, [1.0], ([-1.0], [1.0]), [1.0], block=100)
    assert max(x[0] for x in seen) <= 1.0


def test_short_drive_is_refused():
    with pytest.raises(TwinError, match="2 blocks of 1000 samples for 3 free"):
        fit(problem(0.0), [0.0] * 3, BOUNDS, [1.0] * 3, block=1000)
