import numpy as np
import pytest
from scipy.signal import coherence, welch

from twin.errors import TwinError
from twin.road import ROUGHNESS, Road, iso8608_road, noisy_heights, random_walk_heights

SPACING = 0.1
SEEDS = range(20)


def tracks(seed, **options):
    road = iso8608_road(np.random.default_rng(seed), length=2000, **options)
    return road.heights(np.arange(0, 2000, SPACING))


def mean_spectrum(road_class):
    spectra = [
        welch(tracks(s, road_class=road_class), 1 / SPACING, nperseg=2048, axis=0) for s in SEEDS
    ]
    return spectra[0][0], np.mean([density for _, density in spectra], axis=0)


def test_classes_are_the_geometric_means_of_the_standard():
    assert ROUGHNESS["A"] == 16e-6
    assert ROUGHNESS["C"] == pytest.approx(256e-6)
    assert ROUGHNESS["H"] == pytest.approx(262144e-6)


@pytest.mark.parametrize("road_class", ["A", "C", "F"])
def test_spectrum_has_the_level_and_slope_of_the_standard(road_class):
    frequency, density = mean_spectrum(road_class)
    band = (frequency > 0.04) & (frequency < 2.0)
    for track in range(2):
        slope, level = np.polyfit(
            np.log10(frequency[band] / 0.1), np.log10(density[band, track]), 1
        )
        assert slope == pytest.approx(-2, abs=0.05)
        assert 10**level == pytest.approx(ROUGHNESS[road_class], rel=0.1)


def test_nothing_lies_outside_the_band_of_the_standard():
    frequency, density = mean_spectrum("C")
    assert density[frequency > 3.0].max() < 1e-3 * density[frequency < 2.5].min()


def test_rms_is_the_integral_of_the_spectrum():
    rms = np.sqrt(np.mean([tracks(s).var(axis=0) for s in SEEDS]))
    assert rms == pytest.approx(np.sqrt(256e-6 * 0.1**2 * (1 / 0.011 - 1 / 2.83)), rel=0.1)


@pytest.mark.parametrize("decay", [1.0, 4.0])
def test_coherence_of_the_tracks_decays_exponentially(decay):
    squared = []
    for seed in SEEDS:
        left, right = tracks(seed, coherence_decay=decay).T
        frequency, value = coherence(left, right, 1 / SPACING, nperseg=512)
        squared.append(value)
    low = (frequency > 0.05) & (frequency < 0.5)
    np.testing.assert_allclose(
        np.mean(squared, axis=0)[low], np.exp(-2 * decay * frequency[low]), atol=0.08
    )


def test_without_decay_the_tracks_are_equal_and_without_end_independent():
    same = tracks(0, coherence_decay=0.0)
    np.testing.assert_array_equal(same[:, 0], same[:, 1])
    correlation = [np.corrcoef(tracks(s, coherence_decay=np.inf).T)[0, 1] for s in SEEDS]
    assert abs(np.mean(correlation)) < 0.1


def test_rear_wheels_follow_a_wheelbase_behind_at_any_speed():
    road = iso8608_road(np.random.default_rng(3), length=300)
    distance = np.cumsum(np.linspace(0, 0.03, 4000))  # speeding up from standstill
    heights = road.wheel_heights(distance, 4.0)
    for side in range(2):
        front_there = np.interp(distance[2500:] - 4.0, distance, heights[:, side])
        np.testing.assert_allclose(heights[2500:, 2 + side], front_there, atol=1e-4)


def test_road_passes_through_its_points_and_repeats():
    points = np.random.default_rng(0).normal(size=(20, 2))
    road = Road(points, 0.5)
    np.testing.assert_allclose(road.heights(np.arange(20) * 0.5), points, atol=1e-12)
    np.testing.assert_allclose(road.heights([-1.3]), road.heights([8.7]), atol=1e-12)


def test_same_seed_same_road():
    np.testing.assert_array_equal(tracks(5), tracks(5))
    assert not np.array_equal(tracks(5), tracks(6))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"road_class": "I"}, "A, B, C"),
        ({"length": 50.0}, "91 m"),
        ({"length": np.nan}, "91 m"),
        ({"coherence_decay": -1.0}, "not be negative"),
    ],
)
def test_impossible_roads_are_refused(options, message):
    with pytest.raises(TwinError, match=message):
        iso8608_road(np.random.default_rng(0), **{"length": 200.0, **options})


def test_random_walk_spreads_with_the_square_root_of_time_at_any_sample_time():
    for dt in (1e-3, 1e-2):
        time = np.arange(0, 4.0 + dt / 2, dt)
        ends = [
            random_walk_heights(np.random.default_rng(s), time, delay=0.2)[-1, 0]
            for s in range(400)
        ]
        assert np.std(ends) == pytest.approx(0.01 * np.sqrt(4.0), rel=0.1)


def test_random_walk_reaches_the_rear_after_the_delay_on_both_sides():
    time = np.arange(3000) * 1e-3
    heights = random_walk_heights(np.random.default_rng(1), time, delay=0.25)
    np.testing.assert_array_equal(heights[:, 0], heights[:, 1])
    np.testing.assert_allclose(heights[250:, 2], heights[:-250, 0], atol=1e-12)
    assert not heights[:250, 2].any()


def test_known_road_is_off_by_a_uniform_factor():
    heights = np.full((5000, 4), 0.02)
    factor = noisy_heights(np.random.default_rng(0), heights, 0.1, lag=145) / heights
    assert factor.min() >= 0.9
    assert factor.max() <= 1.1
    assert factor.std() == pytest.approx(0.1 / np.sqrt(3), rel=0.02)


def test_rear_wheels_follow_on_the_front_wheels_noisy_road():
    heights = np.full((5000, 4), 0.02)
    fl, fr, rl, rr = noisy_heights(np.random.default_rng(0), heights, 0.1, lag=145).T
    assert (fl == fr).all()
    assert (rl == rr).all()
    assert (rl[145:] == fl[:-145]).all()
