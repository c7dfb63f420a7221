"""Tyres fitted to measurements that the test makes of a known tyre, with noise and in SAE axes."""

import numpy as np
import pytest

import models
from scenarios.__main__ import main
from scenarios.calibration.tyre_data import read_tyre_data
from scenarios.calibration.tyre_fit import evaluate
from twin.tyre.files import read_tyre_file

NAMES = "ET V SA IA RL P FX FY FZ MX MZ SL"
UNITS = "sec kph deg deg cm kPa N N N N-m N-m none"


def measured(tyre, *, along, seed, pressure=83.0):
    """Sweeps of slip at four loads and three inclinations, as a bench writes them: SAE axes."""
    rng = np.random.default_rng(seed)
    rows = []
    for load in (1500.0, 3000.0, 5000.0, 7000.0):
        for gamma in (0.0, 2.0, 4.0):
            for fixed in (0.0, -4.0) if along else (0.0,):
                sweep = np.concatenate((np.linspace(-1, 1, 80), np.linspace(1, -1, 80)))
                alpha = np.radians(fixed if along else 12.0 * sweep) * np.ones(160)
                kappa = 0.25 * sweep if along else np.zeros(160)
                fz = load * (1.0 + 0.02 * rng.standard_normal(160))
                samples = np.column_stack(
                    (fz, kappa, alpha, np.full(160, np.radians(gamma)), np.full(160, 11.1))
                )
                out = np.empty((160, 3))
                evaluate(tyre, samples, out)
                out += rng.standard_normal((160, 3)) * (0.01 * load, 0.01 * load, 1.0)
                radius = float(tyre["unloaded_radius"]) - fz / float(tyre["vertical_stiffness"])
                rows.append(
                    np.column_stack(
                        (np.full(160, 40.0), -np.degrees(alpha), np.full(160, gamma),
                         100.0 * radius, np.full(160, pressure), out[:, 0], -out[:, 1], -fz,
                         np.zeros(160), -out[:, 2], kappa)
                    )
                )  # fmt: skip
    table = np.vstack(rows)
    return np.column_stack((0.01 * np.arange(len(table)), table))


def write_dat(path, table):
    head = ["A bench, a tyre", "\t".join(NAMES.split()), "\t".join(UNITS.split())]
    rows = ["\t".join(f"{value:.5g}" for value in row) for row in table]
    path.write_text("\n".join([*head, *rows]) + "\n")
    return path


def write_mat(path, table):
    from scipy import io

    channel = {
        "name": np.array(NAMES.split(), dtype=object),
        "units": np.array(UNITS.split(), dtype=object),
    }
    columns = dict(zip(NAMES.split(), table.T[:, :, None], strict=True))
    io.savemat(path, {**columns, "channel": channel, "tireid": "a tyre"})
    return path


@pytest.fixture(scope="module")
def sports():
    return read_tyre_file(models.path("tyres/sports_front.tir"))


def forces(tyre, load, kappa, alpha):
    out = np.empty((1, 3))
    evaluate(tyre, np.array([[load, kappa, alpha, 0.0, 11.1]]), out)
    return out[0]


def test_fit_of_noisy_bench_data_has_the_forces_of_the_tyre(tmp_path, sports, capsys):
    corner = write_dat(tmp_path / "corner.dat", measured(sports, along=False, seed=1))
    drive = write_mat(tmp_path / "drive.mat", measured(sports, along=True, seed=2))
    out = tmp_path / "mine.tir"
    assert main(["fit-tyre", str(corner), str(drive), "--out", str(out)]) == 0
    printed = capsys.readouterr().out
    assert "axes are SAE" in printed
    assert (tmp_path / "mine.png").stat().st_size > 10_000
    found = read_tyre_file(out)
    for load in (2000.0, 4000.0, 6000.0):
        for kappa, alpha in ((0.0, 0.02), (0.0, 0.08), (0.0, 0.18), (0.03, 0.0), (0.15, 0.0),
                             (0.06, 0.07)):  # fmt: skip
            mine, true = forces(found, load, kappa, alpha), forces(sports, load, kappa, alpha)
            np.testing.assert_allclose(mine[:2], true[:2], atol=0.05 * load)  # combined: one angle
            assert abs(mine[2] - true[2]) < 0.012 * load * 0.3
    assert float(found["unloaded_radius"]) == pytest.approx(
        float(sports["unloaded_radius"]), rel=0.01
    )
    assert float(found["vertical_stiffness"]) == pytest.approx(
        float(sports["vertical_stiffness"]), rel=0.03
    )


def test_without_longitudinal_slip_its_coefficients_stay_and_that_is_said(tmp_path, sports, capsys):
    corner = write_dat(tmp_path / "corner.dat", measured(sports, along=False, seed=3))
    out = tmp_path / "mine.tir"
    assert main(["fit-tyre", str(corner), "--out", str(out), "--size", "205/55R16 91V"]) == 0
    assert "longitudinal slip was not measured" in capsys.readouterr().out
    start = read_tyre_file(models.path("tyres/suv.tir"))
    assert float(read_tyre_file(out)["pdx1"]) == float(start["pdx1"])


def test_of_several_pressures_the_most_measured_is_fitted(tmp_path, sports, capsys):
    few = measured(sports, along=False, seed=4, pressure=55.0)[:700]
    many = measured(sports, along=False, seed=5, pressure=83.0)
    data = write_dat(tmp_path / "corner.dat", np.vstack((few, many)))
    assert main(["fit-tyre", str(data), "--out", str(tmp_path / "mine.tir")]) == 0
    assert "samples about 80 kPa are fitted" in capsys.readouterr().out


def test_positive_slip_angles_of_positive_forces_are_negated(tmp_path, sports):
    table = measured(sports, along=False, seed=6)
    table[:, 2] = -table[:, 2]  # adapted SAE
    data = read_tyre_data([write_dat(tmp_path / "corner.dat", table)])
    assert float(np.sum(data.alpha * data.fy)) < 0.0
    assert any("angles are negated" in note for note in data.notes)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda text: text.replace("kPa\tN\tN\tN", "kPa\tx\tx\tx"), "has the unit"),
        (lambda text: text.replace("SA", "QQ"), "has no SA or ALPHA"),
        (lambda text: "\n".join(text.split("\n")[:20]), "allowed: 50 samples"),
        (lambda text: "nothing\n", "is no table of text"),
    ],
)
def test_files_that_are_no_measurements_are_one_line(tmp_path, sports, capsys, change, message):
    data = write_dat(tmp_path / "corner.dat", measured(sports, along=False, seed=7))
    data.write_text(change(data.read_text()))
    assert main(["fit-tyre", str(data), "--out", str(tmp_path / "mine.tir")]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert len(error.strip().splitlines()) == 1
    assert not (tmp_path / "mine.tir").exists()
