"""Fields of a car's file that nobody gave: how they widen what is claimed of a log."""

import numpy as np
import pytest

from estimators.speed_follower import TORQUES
from scenarios.__main__ import main
from scenarios.driving.manoeuvres import swept_steer, urban
from scenarios.driving.record import record
from scenarios.logs.estimators import til
from scenarios.logs.guessed_priors import guessed_priors
from scenarios.logs.guesses import with_guesses
from scenarios.logs.pieces import prepared
from twin import PARAMETER, TwinError, Vehicle, with_noise
from twin.car.guesses import RELATIVE, car_guesses, draw, guesses_of
from twin.car.template import write_template
from twin.tyre.size import parse_size, tyre_text


@pytest.fixture(scope="module")
def untouched(tmp_path_factory):
    return Vehicle.load(write_template(str(tmp_path_factory.mktemp("cars") / "mine")))


def log_of(car, manoeuvre, *, torques=True):
    """A noisy log of a car, in the form that estimators of logs take."""
    drive = with_noise(record(car, manoeuvre), 20.0, np.random.default_rng(3))
    if not torques:
        names = tuple(name for name in drive.input_names if name not in TORQUES)
        drive = drive.replace(
            inputs=drive.inputs[:, [drive.input_names.index(name) for name in names]],
            input_names=names,
            measurements=np.column_stack([drive.measurements, drive.truth["vx"]]),
            output_names=(*drive.output_names, "vx"),
        )
    return prepared(drive, 0.001)


def observed(vehicle, log):
    """By the twin of the vehicle alone, and with its guesses."""
    found = til(vehicle, log)
    return found, with_guesses(found, vehicle, lambda car: til(car, log))


def test_interval_of_the_mass_holds_a_car_whose_tyres_are_not_as_guessed(untouched):
    """2 % more of radius are 2 % less of force: some 50 kg, one standard deviation of the guess."""
    radii = {f"tyre.{axle}.radius": 0.369 * 1.02 for axle in ("front", "rear")}
    car = untouched.with_fields(radii)
    alone, allowed = observed(untouched, log_of(car, urban(duration=20.0)))
    off = untouched.figures.mass + float(alone.estimate["mass"][-1]) - car.figures.mass
    assert 35.0 < abs(off) < 75.0
    assert abs(off) > 2.0 * alone.sd["mass"]
    assert abs(off) < 2.0 * allowed.sd["mass"] < 400.0
    sds = allowed.estimate.sd[:, allowed.estimate.estimated.index("mass")]
    assert sds[-1] == pytest.approx(allowed.sd["mass"], rel=0.2)
    assert any("58 of 58 fields of mine.toml are guesses; the intervals" in x for x in allowed.done)


def test_band_of_the_sideslip_widens_and_estimates_stay(untouched):
    alone, allowed = observed(
        untouched, log_of(untouched, swept_steer(duration=8.0), torques=False)
    )
    before, after = alone.estimate.sideslip_sd, allowed.estimate.sideslip_sd
    assert np.all(after >= before)
    assert np.sqrt(np.mean(after**2)) > 1.1 * np.sqrt(np.mean(before**2))
    assert np.array_equal(alone.estimate.states, allowed.estimate.states)
    assert any("deg (rms) of the sideslip's" in sentence for sentence in allowed.done)


def test_car_without_guesses_is_run_once(untouched):
    known = untouched.with_fields({guess.name: guess.value for guess in guesses_of(untouched)[0]})
    assert guesses_of(known) == ((), 58)
    found = til(known, log_of(known, urban(duration=3.0)))

    def refuse(_):
        raise AssertionError("another car was run")

    assert with_guesses(found, known, refuse) is found
    assert with_guesses(found, Vehicle.load("suv"), refuse) is found


def test_cars_that_do_not_get_through_make_the_estimate_not_trustworthy(untouched):
    found = til(untouched, log_of(untouched, urban(duration=3.0)))

    def blow_up(_):
        raise TwinError("the twin has blown up")

    (fault,) = with_guesses(found, untouched, blow_up).faults
    assert "58 of 58 fields of mine.toml are guesses, and 8 of 8 cars" in fault


def test_fewer_guesses_widen_less(untouched):
    log = log_of(untouched, urban(duration=20.0))
    radii = {f"tyre.{axle}.radius": 0.369 for axle in ("front", "rear")}
    every, fewer = (observed(car, log)[1] for car in (untouched, untouched.with_fields(radii)))
    assert fewer.sd["mass"] < 0.8 * every.sd["mass"]


def test_drawn_cars_scatter_as_their_guesses_say(untouched):
    guesses, _ = guesses_of(untouched)
    rng = np.random.default_rng(1)
    draws = [draw(guesses, rng) for _ in range(2000)]
    for guess in guesses:
        values, sd = np.array([one[guess.name] for one in draws]), guess.sd
        if guess.name.rpartition(".")[2] in RELATIVE:
            values, sd = np.log(values / guess.value), guess.sd / guess.value
        assert values.std() == pytest.approx(sd, rel=0.08), guess.name
    springs = [[one[f"suspension.{axle}.stiffness"] for one in draws] for axle in ("front", "rear")]
    assert np.corrcoef(np.log(springs))[0, 1] == pytest.approx(0.5, abs=0.06)


def test_tyre_of_a_size_is_a_guess_but_for_its_radius_and_a_measured_one_is_none(tmp_path):
    path = write_template(str(tmp_path / "car"))
    text = path.read_text().replace('"tyres/suv.tir"', '"mine.tir"')
    made = tyre_text(parse_size("255/55R18 109"), "mine")
    for head, count in ((made, 10), (made[made.index("[MDI_HEADER]") :], 0)):
        (tmp_path / "mine.tir").write_text(head)
        path.write_text(text)
        names = {guess.name for guess in car_guesses(path)[0] if guess.name.startswith("tyre.")}
        assert len(names) == count
        assert "tyre.front.radius" not in names


def test_what_a_calibration_found_is_no_guess(untouched):
    found = untouched.scaled(cornering_stiffness=1.1).changed(Jzz=100.0)
    names = {guess.name for guess in guesses_of(found)[0]}
    assert "tyre.front.cornering_coefficient" not in names
    assert "chassis.Jzz" not in names
    assert "tyre.front.friction" in names


def test_joint_observer_is_less_certain_beforehand_of_what_is_guessed(untouched):
    priors = guessed_priors(untouched)
    assert priors["cm_z"] == pytest.approx(np.hypot(PARAMETER["cm_z"].prior_sd, 0.06))
    assert priors["spring"] == pytest.approx(np.hypot(PARAMETER["spring"].prior_sd, 0.25))
    known = untouched.with_fields({"chassis.cm_height": 0.644})
    assert "cm_z" not in guessed_priors(known)
    assert guessed_priors(Vehicle.load("suv")) == {}


@pytest.mark.parametrize(
    ("name", "values", "message"),
    [
        ("suv", {"chassis.Jzz": 4000.0}, r"suv.xml: has no fields; allowed: a TOML file"),
        ("mine", {"chassis.J": 1.0}, r"mine.toml: has no field 'chassis.J'"),
        ("mine", {"chassis.Jzz": np.nan}, r"chassis.Jzz is nan; allowed: a finite number"),
        ("mine", {"chassis.Jzz": 9000.0}, r"no body has the inertia"),
    ],
)
def test_field_that_cannot_be_is_refused(untouched, name, values, message):
    car = untouched if name == "mine" else Vehicle.load(name)
    with pytest.raises(TwinError, match=message):
        car.with_fields(values)


def test_command_says_how_many_fields_are_guesses(untouched, tmp_path, capsys):
    drive = with_noise(record(untouched, urban(duration=3.0)), 20.0, np.random.default_rng(0))
    drive.save(tmp_path / "drive.parquet")
    args = [str(tmp_path / "drive.parquet"), "--vehicle", str(untouched.source)]
    assert main(["estimate", *args, "--out", str(tmp_path / "out")]) == 0
    assert "58 of 58 fields of mine.toml are guesses" in capsys.readouterr().out
