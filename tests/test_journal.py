"""The journal of a tuning: what is whole is read, what is damaged is named in one line."""

import json
import math

import numpy as np
import pytest

from scenarios.tuning import journal
from twin import TwinError

HEADER = {"tuning": "bowl", "metric": "depth", "bounds": {"a": [1.0, 1e4, 5.0]}}
BATCHES = [[1.0, 2.0, math.inf, 4.0], [0.5, 0.25, 3.0, 1e3], [9.0, 8.0, 7.0, 6.0]]


def written(path, batches=BATCHES):
    for costs in batches:
        journal.append(path, HEADER, costs)
    return path.read_bytes()


def read(path):
    return journal.read(path, HEADER, 4, "bowl")


def refused(path):
    with pytest.raises(TwinError, match=r"journal: ") as caught:
        read(path)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 300
    return str(caught.value)


def test_what_was_written_is_read(tmp_path):
    path = tmp_path / "journal"
    assert read(path) == []
    written(path)
    assert read(path) == BATCHES


def test_line_that_was_cut_off_is_removed_and_the_rest_goes_on(tmp_path):
    path = tmp_path / "journal"
    whole = written(path)
    kept = b"".join(whole.splitlines(keepends=True)[:-1])
    path.write_bytes(whole[:-5])
    assert read(path) == BATCHES[:-1]
    assert path.read_bytes() == kept
    journal.append(path, HEADER, BATCHES[-1])
    assert read(path) == BATCHES


def test_header_that_was_cut_off_is_an_empty_journal(tmp_path):
    path = tmp_path / "journal"
    path.write_bytes(written(path)[:20])
    assert read(path) == []
    assert not path.exists()


@pytest.mark.parametrize("content", [b"notes", b"\xff\xfe\x00", b"notes\n", b"[" * 50_000 + b"\n"])
def test_foreign_file_is_refused_and_left_alone(tmp_path, content):
    path = tmp_path / "journal"
    path.write_bytes(content)
    refused(path)
    assert path.read_bytes() == content


COST_NAMES = ["0", "negative", "tiny", "text", "bool", "nested", "NaN", "Infinity", "digits"]
WRONG = ["0", "-1.0", "-0.0", '"1"', "true", "[1.0]", "NaN", "Infinity", "1" * 400]


@pytest.mark.parametrize("cost", WRONG, ids=COST_NAMES)
def test_cost_that_is_no_positive_number_is_named_with_its_line(tmp_path, cost):
    path = tmp_path / "journal"
    written(path, BATCHES[:1])
    with path.open("a") as file:
        file.write(f'{{"costs": [1.0, {cost}, 1.0, 1.0]}}\n')
    assert "line 3 has a cost" in refused(path)


@pytest.mark.parametrize("line", ["{}", "[]", "null", "7", '{"costs": {}}', '{"costs": [1.0]}'])
def test_line_that_is_no_batch_is_named(tmp_path, line):
    path = tmp_path / "journal"
    written(path, BATCHES[:1])
    with path.open("a") as file:
        file.write(line + "\n")
    assert "line 3 has not 4 costs" in refused(path)


def test_deeply_nested_line_and_one_without_end_are_refused(tmp_path):
    path = tmp_path / "journal"
    header = written(path, BATCHES[:1])
    path.write_bytes(header + b'{"costs": ' + b"[" * 40_000 + b"\n")
    assert "line 3 is no JSON" in refused(path)
    path.write_bytes(header + b" " * (journal.LONGEST_LINE + 1) + b"\n")
    assert "line 3 has more than" in refused(path)
    with path.open("wb") as file:
        file.truncate(journal.LARGEST + 1)
    assert "more than 16 MB" in refused(path)


def test_folder_is_no_journal(tmp_path):
    (tmp_path / "journal").mkdir()
    assert "is no file" in refused(tmp_path / "journal")


def test_journal_that_cannot_be_written_is_one_line(tmp_path):
    with pytest.raises(TwinError, match="journal: cannot be written"):
        journal.append(tmp_path / "none" / "journal", HEADER, BATCHES[0])


@pytest.mark.parametrize("count", [300, pytest.param(1000, marks=pytest.mark.slow)])
def test_mutated_journal_is_read_as_it_was_or_refused_in_one_line(tmp_path, count):
    """Bytes changed, removed, repeated or inserted at random: nothing but a TwinError comes."""
    path = tmp_path / "journal"
    whole = written(path)
    rng = np.random.default_rng(16)
    refusals = 0
    for _ in range(count):
        content = _mutated(whole, rng)
        path.write_bytes(content)
        try:
            batches = read(path)
        except TwinError as error:
            said = str(error)
            batches = []
        else:
            said = ""
        if said:
            refusals += 1
            assert "\n" not in said
            assert path.read_bytes() == content
            continue
        assert all(len(costs) == 4 and min(costs) > 0.0 for costs in batches)
        _ = [[math.log(cost) for cost in costs] for costs in batches]
        for line in path.read_bytes().splitlines() if path.exists() else ():
            json.loads(line)  # what is left is whole, and can be added to
    assert refusals > count // 3


def _mutated(whole, rng):
    content = bytearray(whole)
    for _ in range(rng.integers(1, 4)):
        at, size = rng.integers(len(content)), int(rng.integers(1, 12))
        kind = rng.integers(5)
        if kind == 0:
            content[at] = rng.integers(256)
        elif kind == 1:
            del content[at : at + size]
        elif kind == 2:
            content[at:at] = content[at : at + size]
        elif kind == 3:
            content[at:at] = rng.choice([b"[", b"-", b"0", b"\n", b"\xff", b"null", b"1e999"])
        else:
            content = content[: max(at, 1)]
    return bytes(content)
