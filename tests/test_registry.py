import numpy as np
import pytest
from cars import drive_of_other_car

from estimators import registry
from estimators.base import Estimate, Estimator, OnlineEstimator, sideslip_estimate
from estimators.benchmarks import double_track
from estimators.benchmarks.bicycle_ekf import Bicycle
from estimators.benchmarks.single_track import START, Geometry
from estimators.benchmarks.static_map import StaticMap
from estimators.entry import Entry, Given
from estimators.til.law import ParameterLaw
from scenarios.experiment import double_track_fit
from scenarios.experiment.laws import ALL_LAWS as STAGED_LAWS
from scenarios.experiment.truck import CASES
from scenarios.experiment.truck_plant import SAMPLE_TIME
from twin import OUTPUTS, TruckParameters, TwinError, Vehicle

SUV = Vehicle.load("suv")
LAW = ParameterLaw(parameter="mass", signal="ax", scale=2000.0, prior_sd=1.0, noise_density=1.0)


@pytest.fixture(scope="module")
def car_drive():
    drive, sd, speed = drive_of_other_car({"mass": 100.0}, seconds=1.2, snr=20.0)
    return drive, dict(zip(OUTPUTS, sd, strict=True)), speed


@pytest.fixture(scope="module")
def truck_drive():
    return CASES[0].noisy_drive(0, 0.5)


def given_for(name, noise):
    """What each needs, and no more."""
    few = ("mass", "Jzz")
    return {
        "til": Given(vehicle=SUV, laws=[LAW]),
        "til-paper": Given(vehicle=SUV, laws=[LAW]),
        "zero": Given(vehicle=SUV),
        "joint": Given(vehicle=SUV, noise_sd=noise, parameters=few),
        "staged": Given(vehicle=SUV, noise_sd=noise, laws=STAGED_LAWS),
        "unscented": Given(vehicle=SUV, noise_sd=noise, parameters=few),
        "least-squares": Given(vehicle=SUV, noise_sd=noise, parameters=("mass",)),
        "til-scheduled": Given(vehicle=SUV),
        "bicycle-ekf": Given(model=Bicycle(1000.0, 1.3, 1.1, 1300.0, steering_ratio=16.0)),
        "double-track": Given(
            model=double_track.load(double_track_fit.path("sports_car")),
            settings=double_track.Gains(0.0, 0.0, 0.0, 0.0),
        ),
        "static-map": Given(model=StaticMap(0.1, 0.2, 0.0)),
        "single-track": Given(model=(START, Geometry(1000.0, 1.3, 1.1, 1300.0, 16.0))),
    }.get(name, Given(model=TruckParameters(), dt=SAMPLE_TIME, noise_sd={
        "vz": 1e-3, "roll_rate": 1e-4, "pitch_rate": 1e-4
    }))  # fmt: skip


@pytest.mark.parametrize("name", registry.ESTIMATORS)
def test_every_estimator_runs_on_what_its_entry_asks_for(name, car_drive, truck_drive):
    entry = registry.find(name)
    drive, noise, speed = car_drive
    if name.startswith("kalman-bucy"):
        drive = truck_drive
    elif "vx" in entry.channels:
        vx = drive.truth["vx"][:, None]
        drive = drive.replace(
            measurements=np.hstack([drive.measurements, vx]), output_names=(*OUTPUTS, "vx")
        )
    given = given_for(name, noise)
    assert entry.lacks(given, drive.output_names) == ()
    made = registry.make(name, given)
    assert isinstance(made, Estimator)
    assert isinstance(made, OnlineEstimator) == entry.online
    made.reset(speed)
    found = made.run(drive)
    assert isinstance(found, Estimate)
    assert np.array_equal(found.time, drive.time)
    estimated = [quantity for quantity in entry.gives if found.has(quantity)]
    assert estimated or np.isfinite(found.sideslip).all()
    assert all(np.isfinite(found[quantity]).all() for quantity in estimated)
    assert (found.sd is not None) == entry.sd
    if found.sd is not None:
        assert found.sd.shape == (len(drive), len(found.estimated))


def test_what_is_missing_is_named(car_drive):
    _, noise, _ = car_drive
    with pytest.raises(TwinError, match="estimator joint: lacks noise_sd; allowed"):
        registry.make("joint", Given(vehicle=SUV))
    with pytest.raises(TwinError, match="estimator is 'kalman'; allowed: til, til-paper, zero"):
        registry.make("kalman", Given())
    with pytest.raises(TwinError, match="needs 'gain'; allowed: twin, noise_sd"):
        Entry(name="a", words="b", make=lambda _: None, needs=frozenset(["gain"]))
    assert registry.find("joint").lacks(Given(vehicle=SUV, noise_sd=noise), OUTPUTS[1:]) == ("ax",)
    usable = registry.usable(Given(vehicle=SUV, noise_sd=noise), OUTPUTS)
    assert {"til", "zero", "joint", "unscented"} <= set(usable)
    assert not {"staged", "double-track", "kalman-bucy"} & set(usable)


class Straight:
    """Believes that no car ever slips."""

    def reset(self, speed, parameters=None, road=None):
        """Nothing to reset."""

    def run(self, drive):
        return sideslip_estimate(drive.time, np.zeros(len(drive)))


def test_new_estimator_is_its_class_and_one_registration(car_drive, monkeypatch):
    monkeypatch.setattr(registry, "ESTIMATORS", dict(registry.ESTIMATORS))
    entry = Entry(name="straight", words="no slip", make=lambda _: Straight(), gives=("sideslip",))
    registry.register(entry)
    assert "straight" in registry.usable(Given(), ())
    assert not registry.make("straight", Given()).run(car_drive[0]).sideslip.any()
    with pytest.raises(TwinError, match="'straight': is registered already"):
        registry.register(entry)


def test_estimate_finds_its_histories_by_name():
    n = 3
    estimate = Estimate(
        time=np.arange(n) * 0.1,
        states=np.full((n, 2), [3.0, 4.0]),
        parameters=np.full((n, 1), 5.0),
        outputs=np.zeros((n, 0)),
        extended=np.zeros((n, 0)),
        nominal=np.array([100.0]),
        state_names=("vx", "vy"),
        parameter_names=("mass",),
        output_names=(),
        extended_names=(),
        estimated=("mass", "bias_ax"),
        sensor_error_names=("bias_ax",),
        sensor_errors=np.full((n, 1), 0.2),
        sd=np.full((n, 2), [1.0, 0.1]),
        valid=np.full((n, 2), [True, False]),
        reason=np.full((n, 2), [0, 1], dtype=np.uint8),
        reasons=("", "not excited"),
    )
    assert estimate["bias_ax"][0] == 0.2
    assert estimate.absolute("mass")[0] == 105.0
    assert estimate.sideslip[0] == pytest.approx(np.arctan2(4.0, 3.0))
    assert estimate.sd_of("bias_ax")[0] == 0.1
    assert np.isnan(estimate.sd_of("vx")).all()
    assert estimate.valid_of("mass").all()
    assert not estimate.valid_of("bias_ax").any()
    assert (estimate.reason_of("bias_ax"), estimate.reason_of("mass")) == ("not excited", "")
    with pytest.raises(TwinError, match="estimate: has no 'az'; has mass, bias_ax, vx, vy"):
        _ = estimate["az"]
