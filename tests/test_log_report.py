"""The HTML report of a user's log: one file that opens offline and says what is to be believed."""

import re
import shutil
import subprocess

import numpy as np
import pytest

from scenarios import __main__ as cli
from scenarios.driving.manoeuvres import urban
from scenarios.driving.record import record
from twin import Drive, Vehicle, with_noise


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    """Ten seconds of the loaded SUV in town at 100 Hz, noisy, without truth."""
    path = tmp_path_factory.mktemp("report") / "town.parquet"
    clean = record(Vehicle.load("suv_loaded"), urban(duration=10.0))
    noisy = with_noise(clean, 20.0, np.random.default_rng(0)).replace(truth={})
    noisy[::10].save(path)
    return path


@pytest.fixture(scope="module")
def page(log):
    assert cli.main(["estimate", str(log), "--vehicle", "suv", "--out", str(log.parent)]) == 0
    return log.with_name("town.til.html")


def test_report_is_one_file_that_needs_no_network(page):
    text = page.read_text(encoding="utf-8")
    links = re.findall(r'(?:src|href)="([^"]{0,30})', text)
    assert all(link.startswith(("data:", "#")) for link in links)
    assert "http" not in text.replace("http://www.w3.org", "")
    assert text.count("<svg") + text.count("data:image/") >= 4  # map, inputs, outputs, estimates


def test_report_says_what_the_command_says(page):
    text = re.sub(r"\s+", " ", re.sub(r"<[^>]+>", " ", page.read_text(encoding="utf-8")))
    for part in ("total mass", "Map of the drive", "Inputs", "trustworthy", "Checks of the log",
                 "versions", "ay = wheels yaw_rate"):  # fmt: skip
        assert part in text, part


def test_fault_of_a_log_stands_in_its_report(log, tmp_path):
    drive = Drive.load(log)
    measured = drive.measurements.copy()
    measured[:, drive.output_names.index("ax")] *= -1.0
    bad = tmp_path / "bad.parquet"
    drive.replace(measurements=measured).save(bad)
    assert cli.main(["estimate", str(bad), "--vehicle", "suv", "--out", str(tmp_path)]) == 0
    assert "sign" in (tmp_path / "bad.til.html").read_text(encoding="utf-8").lower()


@pytest.mark.skipif(shutil.which("chromium") is None, reason="no Chromium here")
def test_browser_shows_it(page, tmp_path):
    shot = tmp_path / "page.png"
    command = ["chromium", "--headless", "--no-sandbox", "--disable-gpu", f"--screenshot={shot}"]
    subprocess.run([*command, page.as_uri()], check=True, capture_output=True, timeout=60)
    assert shot.stat().st_size > 20_000
