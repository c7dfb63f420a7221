"""Faults of a log, the balance of its forces, and the fault bench."""

import numpy as np
import pytest

from scenarios.driving import joint_drives
from scenarios.driving.drivers import driver_of, limits_of
from scenarios.driving.manoeuvres import laps
from scenarios.driving.record import record
from scenarios.experiment.reproduction import Making
from scenarios.logs.estimate import estimate_of
from scenarios.logs.findings import findings
from scenarios.logs.force_balance import balances, contradictions, mass_of
from scenarios.logs.signals import facts_of, signals_of
from scenarios.papers import faults
from scenarios.plants.faults import CHANNELS, FAULTS, with_fault
from twin import Vehicle, with_noise

SUV = Vehicle.load("suv")


@pytest.fixture(scope="module")
def log():
    """A minute of the loaded SUV at 100 Hz, noisy."""
    clean = record(Vehicle.load("suv_loaded"), joint_drives.mixed(duration=60.0))
    return with_noise(clean, 20.0, np.random.default_rng(0)).replace(truth={})[::10]


def said(log, channel, fault):
    broken = with_fault(log, CHANNELS[channel], FAULTS[fault], np.random.default_rng(1))
    return " ".join(map(str, findings(broken, SUV)))


def forces(drive):
    car = facts_of(SUV)
    return balances(signals_of(drive, car), car), car


def test_driving_braking_and_wheels_give_one_mass(log):
    parts, car = forces(log)
    assert not list(contradictions(parts, car.mass + car.spin_mass))
    assert parts[0].drive.mean == pytest.approx(parts[0].brake.mean, rel=0.04)
    assert mass_of(parts[0], car) == pytest.approx(car.mass + 355.0, rel=0.05)


def test_sound_log_has_no_finding(log):
    assert findings(log, SUV) == []


@pytest.mark.parametrize(
    ("channel", "fault", "word"),
    [
        ("all brake torques", "times 0.8", "braking to one"),
        ("all drive torques", "times 1.1", "driving belongs"),
        ("one drive torque", "zero from a third on", "belong"),
        ("ax", "times 1.1", "the change of the wheels' speed"),
    ],
)
def test_what_contradicts_itself_is_found(log, channel, fault, word):
    assert word.lower() in said(log, channel, fault).lower()


def test_mass_that_no_force_explains_is_not_trusted(log):
    """Noise of the drive torques pulls the observer's mass away from the balance of forces."""
    rng = np.random.default_rng(1)
    broken = with_fault(log, CHANNELS["all drive torques"], FAULTS["noisy"], rng)
    found, _ = estimate_of(broken, SUV)
    error = found.estimate["mass"][-1] - 355.0
    assert not found.estimate.trustworthy[-1] or abs(error) < 1.96 * found.sd["mass"]


@pytest.mark.parametrize("name", FAULTS)
def test_every_fault_changes_its_channels_only(log, name):
    rng = np.random.default_rng(2)
    for names in (CHANNELS["yaw_rate"], CHANNELS["all brake torques"]):
        broken = with_fault(log, names, FAULTS[name], rng)
        changed = {
            channel
            for channel in (*log.input_names, *log.output_names)
            if not np.array_equal(broken.channel(channel), log.channel(channel), equal_nan=True)
        }
        assert changed <= set(names)
        assert changed or name == "without its negative half"


def test_bench_counts_and_names_what_is_off(monkeypatch, tmp_path):
    few = {"far off from a third on": FAULTS["far off from a third on"]}
    monkeypatch.setattr(faults, "FAULTS", few)
    monkeypatch.setattr(faults, "CHANNELS", {"yaw_rate": ("yaw_rate",)})
    monkeypatch.setattr(faults, "RATES", (100, 200))
    monkeypatch.setattr(faults, "SOUND_RATES", (100,))
    result = faults.faults(Making(seeds=(0,), jobs=1, out=tmp_path, duration=8.0))
    shares = [row for row in result.rows if row.metric in {"refused", "found", "right"}]
    assert len(shares) == 3 * 2 * len(faults.CARS)
    assert (tmp_path / "faults.png").exists()


def test_wrong_answer_that_is_trusted_is_off():
    off = faults.Outcome(1.0, "mass", -200.0, 20.0, 0.1)
    right, found, refused = off._replace(off=""), off._replace(trusted=0.0, off=""), faults._REFUSED
    assert [faults.SHADES[o.shade] for o in (off, right, found, refused)] == [
        "trustworthy and off", "trustworthy and right", "not trustworthy", "refused"
    ]  # fmt: skip
    run = faults.Run(
        car=faults.CARS[0], rate=100, channel="ax", fault="noisy", seed=0, duration=60.0
    )
    rows = faults._rows_of_faults("x", [run], [off])
    assert (rows[-1].case, rows[-1].median) == ("x: ax, noisy", -200.0)


@pytest.fixture(scope="module")
def hard_laps():
    """Half a minute of the sports car at its limits, at 1 kHz, noisy."""
    car = Vehicle.load("sports_car")
    manoeuvre = laps(duration=30.0, limits=limits_of(car))
    clean = record(car, manoeuvre, driver_of(car))
    return with_noise(clean, 20.0, np.random.default_rng(1)).replace(truth={})


@pytest.mark.parametrize(
    ("channel", "fault"),
    [
        ("wheel_speed_rl", "far off from a third on"),
        ("wheel_speed_fl", "times 0.8"),
        ("all wheel speeds", "frozen but for its last digit"),
        ("yaw_rate", "times 1.5"),
    ],
)
def test_broken_channel_is_found_near_the_limits(hard_laps, channel, fault):
    car = Vehicle.load("sports_car")
    log = hard_laps[::10]
    assert findings(log, car) == []
    broken = with_fault(log, CHANNELS[channel], FAULTS[fault], np.random.default_rng(1))
    assert findings(broken, car)


@pytest.mark.parametrize("rate", [50, 100, 1000])
def test_sound_log_is_trusted_at_every_rate(hard_laps, rate):
    found, _ = estimate_of(hard_laps[:: 1000 // rate], Vehicle.load("sports_car"))
    assert np.mean(found.estimate.trustworthy) > 0.95
