import base64
import shutil
import subprocess
from html.parser import HTMLParser
from pathlib import Path

import pytest

from scenarios import __main__ as cli
from scenarios.cli.catalogue import REPRODUCTIONS, Entry
from scenarios.experiment.reproduction import Making
from scenarios.experiment.result import Result, Row
from scenarios.report.html import PictureOf, Section, write_report

PNG = base64.b64decode(
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGAWjR9awAAAABJRU5ErkJggg=="
)
NAMES = "fake-table-1", "fake-figure-1"
SUMMARY = "a <b>bold</b> & quick table"
BROWSER = shutil.which("chromium") or shutil.which("chromium-browser")


def reproduce_table(making):
    row = Row(
        case="noisy <CM>", quantity="mass", metric="rms_pct", unit="%", estimator="til",
        seeds=len(making.seeds), median=0.912, p90=1.7, limit=0.8,
    )  # fmt: skip
    return Result(name=NAMES[0], settings={"road": ["<flat>", 1]}, seconds=1.25, rows=[row, row])


def reproduce_figure(making):
    (making.out / f"{NAMES[1]}.png").write_bytes(PNG)
    row = Row(
        case="SNR 5 dB", quantity="Jxx", metric="rms_pct", unit="%", estimator="til",
        seeds=len(making.seeds), median=9.0, p90=12.0,
    )  # fmt: skip
    return Result(name=NAMES[1], settings={"seeds": len(making.seeds)}, seconds=2.0, rows=[row])


class Page(HTMLParser):
    """Cells of each table, sources of pictures, and all text of a page."""

    def __init__(self, path):
        super().__init__()
        self.tables, self.resources, self.text, self.depth = [], [], [], []
        self.feed(path.read_text(encoding="utf-8"))
        self.close()

    def handle_starttag(self, tag, attrs):
        self.depth += [tag] if tag not in ("meta", "img") else []
        attrs = dict(attrs)
        self.resources += [attrs[name] for name in ("src", "href", "srcset") if name in attrs]
        if tag == "table":
            self.tables.append([])
        elif tag == "tr":
            self.tables[-1].append([])

    def handle_endtag(self, tag):
        assert self.depth.pop() == tag

    def handle_data(self, data):
        self.text.append(data)
        if self.depth and self.depth[-1] in ("th", "td"):
            self.tables[-1][-1].append(data)


@pytest.fixture
def report(monkeypatch, tmp_path, capsys):
    """The page of a run of two, one of which left its picture there in an earlier run."""
    for name, target in zip(NAMES, ("reproduce_table", "reproduce_figure"), strict=True):
        monkeypatch.setitem(REPRODUCTIONS, name, Entry(f"{__name__}:{target}", SUMMARY))
        (tmp_path / f"{name}.png").write_bytes(b"of an earlier run")
    assert cli.main(["reproduce", *NAMES, "--seeds", "3", "--out", str(tmp_path)]) == 0
    assert capsys.readouterr().err == ""
    return tmp_path / "report.html"


def test_tables_have_the_columns_and_cells_that_are_printed(report):
    page = Page(report)
    assert page.depth == []
    assert page.tables == [
        [
            ["case", "quantity", "metric", "unit", "estimator", "seeds", "median", "p90", "limit"],
            *[["noisy <CM>", "mass", "rms_pct", "%", "til", "3", "0.912", "1.70", "0.800"]] * 2,
        ],
        [
            ["case", "quantity", "metric", "unit", "estimator", "seeds", "median", "p90"],
            ["SNR 5 dB", "Jxx", "rms_pct", "%", "til", "3", "9.00", "12.0"],
        ],
    ]


def test_numbers_stand_to_the_right_and_words_do_not(report):
    text = report.read_text()
    assert "<td class=number>0.912</td>" in text
    assert "<th class=number>median</th>" in text
    assert "<td>mass</td>" in text


def test_result_tells_what_it_is_and_how_it_was_made(report):
    text = "".join(Page(report).text)
    assert text.count(SUMMARY) == 4  # contents and sections
    assert "1.2 s; settings: road" in text
    assert '["<flat>", 1]' in text
    assert "mujoco" in text


def test_picture_is_within_the_page_and_only_that_of_this_run(report):
    (source,) = (r for r in Page(report).resources if not r.startswith("#"))
    kind, data = source.split(",")
    assert kind == "data:image/png;base64"
    assert base64.b64decode(data, validate=True) == PNG


def test_page_needs_nothing_from_elsewhere(report):
    page = Page(report)
    assert all(r.startswith(("#", "data:")) for r in page.resources)
    text = report.read_text()
    assert not any(word in text for word in ("http:", "https:", "url(", "@import", "<script"))


def test_link_leads_to_each_section(report):
    text = report.read_text()
    for name in NAMES:
        assert f'href="#{name}"' in text
        assert f'id="{name}"' in text


def test_picture_that_is_written_again_unchanged_is_of_this_run(tmp_path):
    path = tmp_path / "a.png"
    path.write_bytes(PNG)
    picture = PictureOf(tmp_path, "a")
    assert picture.read() is None
    (tmp_path / "new").write_bytes(PNG)
    (tmp_path / "new").replace(path)
    assert picture.read() == PNG


def test_page_is_written_whole_or_not_at_all(tmp_path, monkeypatch):
    path = tmp_path / "report.html"
    path.write_text("old")
    result = reproduce_table(Making(seeds=(0,), jobs=1, out=tmp_path))
    monkeypatch.setattr(Path, "replace", lambda *_: (_ for _ in ()).throw(OSError("disk")))
    with pytest.raises(OSError, match="disk"):
        write_report([Section(result=result, summary="", picture=None)], path)
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_page_that_cannot_be_written_is_told_before_the_run(tmp_path, capsys):
    (tmp_path / "report.html").mkdir()
    assert cli.main(["reproduce", "til-table-3", "--out", str(tmp_path)]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert len(err.splitlines()) == 1
    assert "report.html' is a directory" in err


def browse(tmp_path, *options):
    command = [BROWSER, "--headless", "--no-sandbox", "--disable-gpu"]
    profile = f"--user-data-dir={tmp_path / 'profile'}"
    run = subprocess.run([*command, profile, *options], capture_output=True, text=True, timeout=60)
    assert run.returncode == 0, run.stderr
    return run.stdout


@pytest.mark.skipif(BROWSER is None, reason="no chromium or chromium-browser on the path")
def test_browser_shows_the_page_with_its_pictures(report, tmp_path):
    script = "onload = () => document.title = [...document.images].map(i => i.naturalWidth)"
    probe = tmp_path / "probe.html"
    probe.write_text(report.read_text().replace("</body>", f"<script>{script}</script></body>"))
    dom = browse(tmp_path, "--dump-dom", probe.as_uri())
    assert "<title>1</title>" in dom  # one picture, one pixel wide
    assert dom.count("<table>") == 2
    shot = tmp_path / "shot.png"
    browse(tmp_path, f"--screenshot={shot}", report.as_uri())
    assert shot.read_bytes().startswith(b"\x89PNG")
