import json

import numpy as np
import pytest

from estimators.base import Estimate
from scenarios.logs.answer import Answer, answer
from scenarios.logs.answer_text import lines_of
from scenarios.logs.estimators import Found
from scenarios.logs.mass_interval import with_hills, with_torque_accuracy
from scenarios.logs.trust_spans import trust_spans
from twin import EXTENDED, INPUTS, OUTPUTS, PARAMETERS, STATES, Drive, Vehicle

SUV = Vehicle.load("suv")
N = 500


def found_of(changes=None, sd=None, trusted=None, **more):
    """An estimate of a car at 20 m/s that ends with some changes of its parameters."""
    time = np.linspace(0.0, 5.0, N)
    changes = changes or {"mass": 355.0, "cm_x": -0.012, "tyre_friction": -0.05}
    parameters = np.zeros((N, len(PARAMETERS)))
    for name, change in changes.items():
        parameters[:, PARAMETERS.index(name)] = change
    states = np.zeros((N, len(STATES)))
    states[:, STATES.index("vx")] = 20.0
    states[:, STATES.index("vy")] = -1.0
    drive = Drive(
        time=time,
        inputs=np.ones((N, len(INPUTS))) * np.linspace(0.0, 1.0, N)[:, None],
        input_names=INPUTS,
        measurements=more.pop("measurements", np.ones((N, len(OUTPUTS)))),
        output_names=OUTPUTS,
    )
    nominal = np.zeros(len(PARAMETERS))
    nominal[: len(SUV_LOAD)] = SUV_LOAD
    estimate = Estimate(
        time=time, states=states, parameters=parameters, outputs=np.zeros((N, len(OUTPUTS))),
        extended=np.zeros((N, len(EXTENDED))), nominal=nominal, estimated=tuple(changes),
        sd=np.tile([(sd or {}).get(name, np.nan) for name in changes], (N, 1)),
        trustworthy=trusted, **more,
    )  # fmt: skip
    return Found(drive, estimate, tuple(changes), dict(sd or {}), ())


SUV_LOAD = [SUV.chassis().mass, *SUV.chassis().cm]


def test_values_are_absolute_beside_changes_in_units_of_people():
    found = answer(found_of(sd={"mass": 6.0, "cm_x": 0.002}), SUV)
    mass, cm, friction = found.quantities
    assert (mass.unit, cm.unit, friction.unit) == ("kg", "mm", "%")
    assert mass.value == pytest.approx(SUV.figures.mass + 355.0)
    assert (mass.low, mass.high) == pytest.approx((355.0 - 11.76, 355.0 + 11.76))
    assert cm.change == pytest.approx(-12.0)
    assert cm.value == pytest.approx(1e3 * SUV_LOAD[1] - 12.0)
    assert (friction.value, friction.change) == pytest.approx((95.0, -5.0))
    assert (friction.sd, friction.low) == (None, None)
    text = "\n".join(lines_of(found))
    assert "total mass 2693 kg, load +355 kg (95 %: 343 to 367)" in text


def test_answer_comes_back_from_json():
    found = answer(found_of(sd={"mass": 6.0}, trusted=np.arange(N) > 50), SUV)
    assert Answer.from_json(json.loads(json.dumps(found.to_json()))) == found


def test_sideslip_has_the_band_of_its_standard_deviation():
    plain = answer(found_of(), SUV).sideslip
    assert plain.end == pytest.approx(np.degrees(np.arctan2(-1.0, 20.0)))
    assert plain.band is None
    banded = answer(found_of(sideslip_sd=np.full(N, np.radians(0.2))), SUV)
    assert banded.sideslip.band == pytest.approx(0.392)
    assert any("95 % band, rms: +-0.39 deg" in line for line in lines_of(banded))


def test_parameter_that_is_not_valid_has_its_reason_and_what_to_drive():
    found = answer(
        found_of(
            {"Jxx": 10.0}, valid=np.zeros((N, 1), dtype=bool),
            reason=np.ones((N, 1), dtype=np.uint8), reasons=("", "too little driving"),
        ), SUV,
    )  # fmt: skip
    assert found.quantities[0].reason == "too little driving"
    assert found.unknown == (
        "This drive does not identify the roll inertia: steer quickly to and fro, or drive over "
        "bumps on one side.",
    )
    assert any("not to be relied on: too little driving" in line for line in lines_of(found))


def test_mass_without_driving_is_not_identified():
    assert "accelerate and brake" in answer(found_of(sd={"mass": 400.0}), SUV).unknown[0]
    assert answer(found_of(sd={"mass": 80.0}), SUV).unknown == ()


def test_accuracy_of_torques_and_hills_widen_the_mass_over_time():
    found = with_torque_accuracy(found_of(sd={"mass": 6.0}), SUV)
    more = 0.03 * (SUV.figures.mass + 355.0)
    assert found.sd["mass"] == pytest.approx(np.hypot(6.0, more))
    assert found.estimate.sd_of("mass") == pytest.approx(np.full(N, np.hypot(6.0, more)))
    assert "accurate to 3 %" in found.done[0]
    assert "80.8 kg" in found.done[0]
    assert with_hills(found, 0.05) is found
    assert with_hills(found, 0.3).sd["mass"] > found.sd["mass"]


def test_observer_of_the_torques_scale_has_its_accuracy_already():
    found = found_of({"mass": 355.0, "drive_torque": 0.0}, sd={"mass": 6.0})
    assert with_torque_accuracy(found, SUV) is found


def test_spans_name_time_channel_and_reason():
    trusted = np.ones(N, dtype=bool)
    trusted[:80] = trusted[200:260] = trusted[400:420] = False
    measurements = np.ones((N, len(OUTPUTS)))
    measurements[200:230, OUTPUTS.index("yaw_rate")] = np.nan
    found = found_of(trusted=trusted, measurements=measurements)
    first, second, third = trust_spans(found.estimate, found.drive)
    assert (first.start, first.reason) == (0.0, "the estimate settles after the start")
    assert second.start == pytest.approx(2.0, abs=0.02)
    assert second.end == pytest.approx(2.6, abs=0.02)
    assert second.channels == ("yaw_rate",)
    assert second.reason == "yaw_rate: missing in the log"
    assert third.channels == ()
    assert "rejected as implausible or frozen" in third.reason


def test_reasons_of_the_estimator_come_first():
    trusted = np.arange(N) < 300
    code = np.where(trusted, 0, 1).astype(np.uint8)
    code[400:] = 2
    found = found_of(trusted=trusted, trust_reason=code, reasons=("", "ax frozen", "ay spikes"))
    assert [s.reason for s in trust_spans(found.estimate, found.drive)] == [
        "ax frozen", "ay spikes",
    ]  # fmt: skip


def test_many_spans_end_in_a_count():
    trusted = np.arange(N) % 20 < 10
    found = found_of(trusted=trusted)
    spans = trust_spans(found.estimate, found.drive)
    assert len(spans) == 20
    assert spans[-1].reason.startswith("6 more times")
