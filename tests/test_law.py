"""The laws on synthetic signals, without any car."""

import numpy as np
import pytest

from estimators.til.law import PP, ParameterLaw, _regressor, advance_law, compile_laws
from twin import OUTPUTS, TwinError

DT = 1e-3
YAW_RATE, AX = OUTPUTS.index("yaw_rate"), OUTPUTS.index("ax")


def outputs(channel, values):
    """Measurements (n, 10) that are zero but for one channel."""
    table = np.zeros((len(values), len(OUTPUTS)))
    table[:, channel] = values
    return table


def corrections(law, y, twin_y):
    """What a law adds to its parameter in each sample, shape (n,)."""
    laws, memory = compile_laws([law], DT)
    pairs = zip(y, twin_y, strict=True)
    return np.array([advance_law(laws[0], memory[0], of, its, DT) for of, its in pairs])


def regressors(law, signal):
    """What a law makes of its instrument, shape (n,)."""
    laws, memory = compile_laws([law], DT)
    return np.array([_regressor(laws[0], memory[0], value, DT) for value in signal])


def phasor(frequency, values):
    """Complex amplitude over the last periods of a signal that is driven by a sine."""
    n = round(4.0 / frequency / DT)
    time = np.arange(len(values))[-n:] * DT
    return 2.0 / n * np.sum(values[-n:] * np.exp(-2j * np.pi * frequency * time)) * 1j


def differentiated(signal, filter_time):
    """A twin's rate through the law's filter.

    The vehicle's is a ramp of slope one, whose derivative is the one that the law subtracts, and
    of which it takes the sign.
    """
    law = ParameterLaw(
        parameter="Jzz", signal="yaw_acceleration", instrument="measured", form="sign", gain=1.0,
        filter_time=filter_time,
    )  # fmt: skip
    ramp = np.arange(len(signal)) * DT
    added = corrections(law, outputs(YAW_RATE, ramp), outputs(YAW_RATE, signal))
    return added / DT + 1.0


def sine(frequency, settled):
    """Long enough to settle, and four periods."""
    return np.sin(2.0 * np.pi * frequency * np.arange(round((settled + 4.0 / frequency) / DT)) * DT)


@pytest.mark.parametrize("filter_time", [0.02, 0.05])
@pytest.mark.parametrize("frequency", [0.5, 2.0, 5.0, 10.0])
def test_differentiating_filter_has_the_gain_of_its_transfer_function(frequency, filter_time):
    s = 2j * np.pi * frequency
    expected = s / (filter_time * s + 1.0) ** 2
    found = phasor(frequency, differentiated(sine(frequency, 30 * filter_time), filter_time))
    assert abs(found) == pytest.approx(abs(expected), rel=0.04)


@pytest.mark.parametrize("filter_time", [0.02, 0.05])
def test_differentiating_filter_delays_slow_signals_by_two_filter_times(filter_time):
    frequency = 0.25
    found = phasor(frequency, differentiated(sine(frequency, 30 * filter_time), filter_time))
    lead = np.angle(found) - np.pi / 2.0  # of a derivative, beyond a quarter
    assert -lead / (2.0 * np.pi * frequency) == pytest.approx(2.0 * filter_time, abs=DT)


def test_differentiating_filter_gives_a_ramp_its_slope_and_a_constant_nothing():
    time = np.arange(1500) * DT
    assert differentiated(3.0 * time - 1.0, 0.03)[-1] == pytest.approx(3.0, rel=1e-6)
    np.testing.assert_allclose(differentiated(np.full(1500, 5.0), 0.03)[1000:], 0.0, atol=1e-6)


def test_filter_is_the_same_for_vehicle_and_twin():
    rng = np.random.default_rng(0)
    rate = outputs(YAW_RATE, rng.normal(size=500))
    law = ParameterLaw(parameter="Jzz", signal="yaw_acceleration", form="sign", gain=1.0)
    np.testing.assert_array_equal(corrections(law, rate, rate), 0.0)


@pytest.mark.parametrize("frequency", [0.3, 1.0, 2.0, 4.0, 10.0])
@pytest.mark.parametrize("damping", [0.3, 0.65])
def test_mode_filter_has_the_response_of_its_transfer_function(frequency, damping):
    law = ParameterLaw(
        parameter="Jxx", signal="roll_acceleration", mode_frequency=2.0, mode_damping=damping,
        prior_sd=1.0, noise_density=1.0,
    )  # fmt: skip
    s, w = 2j * np.pi * frequency, 2.0 * np.pi * 2.0
    expected = s**2 / (s**2 + 2.0 * damping * w * s + w**2)
    found = phasor(frequency, regressors(law, sine(frequency, 4.0)))
    assert abs(found - expected) < 0.03 * max(abs(expected), 0.1)


def test_without_mode_and_lag_the_instrument_is_the_regressor():
    signal = np.random.default_rng(0).normal(size=100)
    law = ParameterLaw(parameter="mass", signal="ax", prior_sd=1.0, noise_density=1.0)
    np.testing.assert_array_equal(regressors(law, signal), signal)


@pytest.mark.parametrize("samples", [1, 7, 150])
def test_lag_is_exactly_that_many_samples(samples):
    signal = np.random.default_rng(0).normal(size=500)
    law = ParameterLaw(
        parameter="Jyy", signal="ax", lag=samples * DT, prior_sd=1.0, noise_density=1.0
    )
    lagged = regressors(law, signal)
    np.testing.assert_array_equal(lagged[:samples], 0.0)
    np.testing.assert_array_equal(lagged[samples:], signal[:-samples])


def test_lag_is_of_the_instrument_and_not_of_the_innovation():
    signs = np.where(np.random.default_rng(0).random(100) < 0.5, -1.0, 1.0)
    law = ParameterLaw(
        parameter="mass", signal="ax", instrument="measured", form="sign", gain=2.0, lag=5 * DT
    )
    innovation = np.arange(100.0)
    added = corrections(law, outputs(AX, signs), outputs(AX, signs + innovation))
    np.testing.assert_allclose(added[5:], 2.0 * DT * signs[:-5] * innovation[5:], rtol=1e-12)
    np.testing.assert_array_equal(added[:5], 0.0)


def test_laws_of_one_observer_have_lags_of_their_own():
    laws, memory = compile_laws(
        [
            ParameterLaw(
                parameter="mass", signal="ax", lag=lag * DT, prior_sd=1.0, noise_density=1.0
            )
            for lag in (2, 5)
        ],
        DT,
    )
    signal = np.arange(1.0, 21.0)
    for k, lag in enumerate((2, 5)):
        lagged = [_regressor(laws[k], memory[k], value, DT) for value in signal]
        np.testing.assert_array_equal(lagged[lag:], signal[:-lag])


SAMPLES = 1000
TWIN_ACCELERATION = 0.5 + 2.0 * np.sin(2.0 * np.pi * 2.0 * np.arange(SAMPLES) * DT)
SCALE, PRIOR_SD, NOISE_SD, OFFSET_SD = 2000.0, 300.0, 0.5, 0.1
FIT = ParameterLaw(
    parameter="mass", signal="ax", scale=SCALE, prior_sd=PRIOR_SD,
    noise_density=NOISE_SD * np.sqrt(DT), offset_sd=OFFSET_SD,
)  # fmt: skip


def fit(seed):
    """Error of the parameter at the end, and the variance that the law claims.

    Where m is missing, the vehicle's acceleration is smaller than the twin's by the share
    m / SCALE, off by a constant, and noisy.
    """
    rng = np.random.default_rng(seed)
    missing, offset = rng.normal(0.0, (PRIOR_SD, OFFSET_SD))
    disturbance = offset + rng.normal(0.0, NOISE_SD, SAMPLES)
    twin_y, y = outputs(AX, TWIN_ACCELERATION), outputs(AX, TWIN_ACCELERATION)
    laws, memory = compile_laws([FIT], DT)
    for k in range(SAMPLES):
        y[k, AX] -= TWIN_ACCELERATION[k] / SCALE * missing + disturbance[k]
        missing -= advance_law(laws[0], memory[0], y[k], twin_y[k], DT)
    return missing, memory[0, PP]


def test_least_squares_find_the_missing_share_in_the_noise():
    errors = np.array([fit(seed)[0] for seed in range(40)])
    claimed = np.sqrt(fit(0)[1])
    assert claimed < 0.15 * PRIOR_SD
    assert abs(errors.mean()) < 3.0 * claimed / np.sqrt(len(errors))
    assert np.abs(errors).max() < 4.0 * claimed


def test_least_squares_claim_the_variance_that_they_have():
    runs = np.array([fit(seed) for seed in range(100, 160)])
    ratio = np.mean(runs[:, 0] ** 2) / np.mean(runs[:, 1])
    assert 0.5 < ratio < 2.0


def test_least_squares_claim_the_variance_of_the_fit_to_all_samples_at_once():
    design = np.column_stack([TWIN_ACCELERATION / SCALE, np.ones(SAMPLES)])
    prior = np.diag([1.0 / PRIOR_SD**2, 1.0 / OFFSET_SD**2])
    covariance = np.linalg.inv(design.T @ design / NOISE_SD**2 + prior)
    assert fit(0)[1] == pytest.approx(covariance[0, 0], rel=1e-6)


def test_drift_makes_the_variance_grow_where_nothing_is_learnt():
    law = ParameterLaw(parameter="mass", signal="ax", prior_sd=10.0, noise_density=1.0, drift=4.0)
    laws, memory = compile_laws([law], DT)
    nothing = np.zeros(len(OUTPUTS))
    for _ in range(1000):
        advance_law(laws[0], memory[0], nothing, nothing, DT)
    assert memory[0, PP] == pytest.approx(10.0**2 + 4.0**2 * 1.0)


def full(**channels):
    """One sample of outputs, zero but for some."""
    y = np.zeros(len(OUTPUTS))
    for name, value in channels.items():
        y[OUTPUTS.index(name)] = value
    return y


GATED = ParameterLaw(
    parameter="mass", signal="ax", form="sign", gain=1.0, largest_yaw_rate=0.05, least_signal=1.5
)


@pytest.mark.parametrize(
    ("y", "twin_y", "moves"),
    [
        ({"ax": 3.0, "yaw_rate": 0.04}, {"ax": 2.0}, True),
        ({"ax": 3.0, "yaw_rate": -0.06}, {"ax": 2.0}, False),
        ({"ax": 3.0, "yaw_rate": np.nan}, {"ax": 2.0}, False),
        ({"ax": 3.0}, {"ax": 2.0, "yaw_rate": 0.3}, True),
        ({"ax": 3.0}, {"ax": 1.4}, False),
        ({"ax": -1.0}, {"ax": -1.6}, True),
    ],
)
def test_gates_look_at_the_measured_yaw_rate_and_at_the_instrument(y, twin_y, moves):
    added = corrections(GATED, [full(**y)], [full(**twin_y)])
    assert bool(added[0]) is moves


def test_compensation_takes_the_wheels_lead_out_of_the_twins_signal():
    """Each rad/s by which a measured wheel is ahead is worth the same."""
    law = ParameterLaw(parameter="mass", signal="ax", form="integral", gain=1.0, compensation=0.25)
    y = full(ax=2.0, wheel_speed_fl=3.0, wheel_speed_rr=np.nan)
    twin_y = full(ax=2.0, wheel_speed_fl=1.0, wheel_speed_rr=5.0)
    added = corrections(law, [y], [twin_y])
    assert added[0] == pytest.approx(DT * 0.25 * 2.0)


def test_integral_law_leaks_to_a_share_of_what_is_missing():
    """F' = k (missing - F) - leak F settles at k / (k + leak), at the rate k + leak."""
    law = ParameterLaw(
        parameter="axle_force_front", signal="ay", form="integral", gain=6.0, leak=2.0
    )
    laws, memory = compile_laws([law], DT)
    force, history = 0.0, []
    for _ in range(2000):
        force += advance_law(laws[0], memory[0], full(ay=1.0), full(ay=force), DT)
        history.append(force)
    assert force == pytest.approx(6.0 / 8.0, rel=1e-4)
    assert history[round(1.0 / 8.0 / DT)] == pytest.approx(0.75 * (1.0 - np.exp(-1.0)), rel=0.02)


def test_integral_law_may_have_a_negative_gain_and_others_may_not():
    ParameterLaw(parameter="axle_force_rear", signal="yaw_rate", form="integral", gain=-3.0)
    with pytest.raises(TwinError, match=r"gain is -3\.0"):
        ParameterLaw(parameter="mass", signal="ax", form="sign", gain=-3.0)


@pytest.mark.parametrize("name", ["largest_yaw_rate", "compensation"])
def test_law_that_needs_a_cars_outputs_is_refused_without_them(name):
    law = ParameterLaw(
        parameter="mass", signal="ax", prior_sd=1.0, noise_density=1.0, **{name: 0.1}
    )
    with pytest.raises(TwinError, match=rf"{name} is 0\.1; this black box, without"):
        compile_laws([law], DT, outputs=("ax",))


def test_a_resting_law_corrects_nothing_and_keeps_its_filters():
    law = ParameterLaw(
        parameter="Jzz", signal="yaw_acceleration", form="sign", gain=1.0, mode_frequency=1.0
    )
    y = outputs(YAW_RATE, np.sin(np.arange(400) * 0.03))
    always = corrections(law, y, 0.9 * y)
    laws, memory = compile_laws([law], DT)
    half = np.array(
        [advance_law(laws[0], memory[0], y[k], 0.9 * y[k], DT, k >= 200) for k in range(len(y))]
    )
    assert (half[:200] == 0.0).all()
    assert always[:200].any()
    np.testing.assert_array_equal(half[200:], always[200:])
