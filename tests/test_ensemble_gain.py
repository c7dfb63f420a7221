"""A reduced K from how an ensemble of cars errs."""

import numpy as np
import pytest

from estimators.til import ensemble_gain, forecast_errors
from estimators.til.ensemble_gain import ErrorModel
from estimators.til.forecast_errors import BLOCK, CORRECTED, ForecastErrors
from scenarios.driving.drivers import limits_of
from scenarios.driving.manoeuvres import laps
from scenarios.driving.record import record
from scenarios.reduction import laws
from scenarios.reduction.cost import ENTRIES, HAND
from scenarios.reduction.picture import draw
from scenarios.reduction.ways import Found
from twin import OUTPUTS, Twin, TwinError, Vehicle

N, NY = len(CORRECTED), len(OUTPUTS)


def _scalar(cross: float = 0.0) -> ErrorModel:
    one = np.ones((1, 1))
    return ErrorModel(0.9 * one, one, 0.04 * one, 0.25 * one, cross * one)


def _drives(rng: np.random.Generator, noise: float) -> tuple[list[ForecastErrors], np.ndarray]:
    """Blocks of a linear error, and its [A; C]."""
    true = 0.2 * rng.standard_normal((N + NY, N))
    found = []
    for _ in range(3):
        before = rng.standard_normal((400, N))
        shown = before @ true.T + noise * rng.standard_normal((400, N + NY))
        found.append(ForecastErrors(before, shown[:, :N], shown[:, N:]))
    return found, true


def test_optimal_gain_is_kalmans_steady_one() -> None:
    p = 1.0
    for _ in range(200):  # the filter's own recursion
        p = 0.81 * p + 0.04 - (0.9 * p) ** 2 / (p + 0.25)
    found = ensemble_gain.optimal_gain(_scalar())
    assert found.gain[0, 0] == pytest.approx(0.9 * p / (p + 0.25), rel=1e-9)
    assert found.error[0, 0] == pytest.approx(p, rel=1e-9)


def test_optimal_gain_leaves_the_least_variance_in_simulation() -> None:
    model = _scalar(cross=0.05)
    rng = np.random.default_rng(0)
    noise = rng.multivariate_normal([0.0, 0.0], [[0.04, 0.05], [0.05, 0.25]], 20000)
    best = float(ensemble_gain.optimal_gain(model).gain[0, 0])

    def variance(gain: float) -> float:
        x, total = 0.0, 0.0
        for w, v in noise:
            x = 0.9 * x + w - gain * (x + v)
            total += x * x
        return total / len(noise)

    assert variance(best) < min(variance(best - 0.1), variance(best + 0.1))


def test_error_model_is_the_one_that_made_the_data() -> None:
    drives, true = _drives(np.random.default_rng(0), 0.01)
    model = ensemble_gain.error_model(drives)
    np.testing.assert_allclose(np.vstack([model.transition, model.output]), true, atol=2e-3)
    assert np.sqrt(np.diag(model.noise)).mean() == pytest.approx(0.01, rel=0.2)


def test_too_few_blocks_are_refused() -> None:
    drives, _ = _drives(np.random.default_rng(0), 0.01)
    short = ForecastErrors(*(column[:20] for column in drives[0]))
    with pytest.raises(TwinError, match="20 blocks"):
        ensemble_gain.error_model([short])


def test_gain_of_mirrored_data_turns_the_car_no_way() -> None:
    drives, _ = _drives(np.random.default_rng(1), 0.5)
    k = ensemble_gain.entries(
        ensemble_gain.sparse_gain(ensemble_gain.mirrored(drives), penalty=0.0)
    )
    assert k["vy", "wheel_speed_fl"] == pytest.approx(-k["vy", "wheel_speed_fr"])
    assert k["wheel_speed_rl", "ax"] == pytest.approx(k["wheel_speed_rr", "ax"])
    assert abs(k.get(("vy", "ax"), 0.0)) < 1e-9


def test_mirror_pairs_hold_every_entry_once() -> None:
    pairs = np.abs(ensemble_gain.mirror_pairs()).sum(axis=0)
    assert set(np.unique(pairs)) == {0.0, 1.0}
    assert pairs[CORRECTED.index("vy"), OUTPUTS.index("ax")] == 0.0
    assert pairs[CORRECTED.index("vy"), OUTPUTS.index("ay")] == 1.0


def test_lasso_without_penalty_is_least_squares() -> None:
    rng = np.random.default_rng(0)
    x, y = rng.standard_normal((200, 4)), rng.standard_normal((200, 3))
    expected = np.linalg.lstsq(x, y, rcond=None)[0].T
    np.testing.assert_allclose(ensemble_gain.lasso(x, y, 0.0), expected, atol=1e-7)


def test_lasso_finds_which_regressor_it_was() -> None:
    rng = np.random.default_rng(0)
    x = rng.standard_normal((300, 6))
    y = 3.0 * x[:, [2]] + 0.3 * rng.standard_normal((300, 1))
    assert np.flatnonzero(ensemble_gain.lasso(x, y, 0.3)[0]).tolist() == [2]


def test_threshold_and_rank_take_from_the_same_gain() -> None:
    drives, _ = _drives(np.random.default_rng(2), 0.5)
    found = ensemble_gain.optimal_gain(ensemble_gain.error_model(drives))
    kept = ensemble_gain.kept_entries(found, 0.3)
    assert 0 < np.count_nonzero(kept) < kept.size
    np.testing.assert_array_equal(kept[kept != 0.0], found.gain[kept != 0.0])
    np.testing.assert_allclose(ensemble_gain.of_rank(found, NY), found.gain, atol=1e-10)
    assert np.linalg.matrix_rank(ensemble_gain.of_rank(found, 3)) == 3


def test_penalty_out_of_range_is_refused() -> None:
    drives, _ = _drives(np.random.default_rng(2), 0.5)
    with pytest.raises(TwinError, match="penalty is 1"):
        ensemble_gain.sparse_gain(drives, 1.0)


def test_twin_that_is_the_car_errs_only_by_what_it_was_given(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    vehicle = Vehicle.load("sports_car")
    drive = record(vehicle, laps(duration=2.1, limits=limits_of(vehicle)))
    rng = np.random.default_rng(0)
    given = forecast_errors.forecast_errors(Twin(vehicle), drive, rng, {})
    assert given.before.shape == (200, N)
    vy = CORRECTED.index("vy")
    starts = given.before[:: round(0.5 / BLOCK), vy]
    assert 0.02 < np.sqrt(np.mean(starts**2)) < 0.5
    monkeypatch.setattr(forecast_errors, "START_SD", {})
    none = forecast_errors.forecast_errors(Twin(vehicle), drive, rng, {})
    assert np.abs(none.after).max() < 1e-6
    assert np.abs(none.innovations).max() < 1e-6


def test_feed_through_of_entries_stays_below_one() -> None:
    gain = np.zeros((N, NY))
    gain[CORRECTED.index("vx"), OUTPUTS.index("ax")] = 1.5 * BLOCK
    gain[CORRECTED.index("yaw_rate"), OUTPUTS.index("yaw_rate")] = 30.0 * BLOCK
    assert ensemble_gain.entries(gain) == {
        ("vx", "ax"): ensemble_gain.LARGEST_FEED_THROUGH,
        ("yaw_rate", "yaw_rate"): pytest.approx(30.0),
    }


def test_gains_of_a_run_are_entries_and_numbers_of_the_mass_law() -> None:
    gain = np.zeros((N, NY))
    gain[CORRECTED.index("yaw_rate"), OUTPUTS.index("yaw_rate")] = 0.3
    named = laws.named(gain, {"noise_density": 0.1, "drift": 0.2})
    found = Found(estimator=ENTRIES, gains=named, evaluations=0, seconds=0.0)
    assert dict(named)["drift"] == 0.2
    assert found.k() == {("yaw_rate", "yaw_rate"): pytest.approx(0.3 / BLOCK)}


def test_all_entries_start_with_no_correction_at_all() -> None:
    pairs = ensemble_gain.mirror_pairs()
    law = laws.AllEntries(np.ones((N, NY)), pairs, (("drift", 0.2),))
    today = {gain.name: gain.today for gain in law.gains()}
    assert laws.k_of(dict(law(today))) == {}
    most = laws.k_of(dict(law(today | {"entry 0": 100.0})))
    assert max(map(abs, most.values())) == pytest.approx(1.0 / BLOCK)


def test_picture_of_k_is_drawn(tmp_path) -> None:
    pytest.importorskip("matplotlib")
    gains = {"yaw_rate": 50.0, "pitch_rate": 50.0, "ax_vx": 0.1, "ay_vy": 0.1, "wheel_speed": 9.0}
    hand = Found(estimator=HAND, gains=tuple(gains.items()), evaluations=0, seconds=0.0)
    draw(tmp_path / "k.png", {"hand": hand.k()}, "K")
    assert (tmp_path / "k.png").stat().st_size > 10000
