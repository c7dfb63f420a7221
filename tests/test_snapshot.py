"""Snapshots that are not as they were written are refused in one line, and change nothing."""

import io
import zipfile

import numpy as np
import pytest

from estimators.til.default_observer import default_observer
from estimators.til.snapshot import load_snapshot, save_snapshot
from twin import OUTPUTS, TwinError, Vehicle

MORE = {"clock": np.arange(3.0)}


@pytest.fixture(scope="module")
def observer():
    made = default_observer(Vehicle.load("suv"), set(OUTPUTS)).observer
    made.reset(10.0)
    return made


@pytest.fixture(scope="module")
def sound(observer, tmp_path_factory):
    """The bytes of a snapshot."""
    path = tmp_path_factory.mktemp("snapshot") / "state.npz"
    save_snapshot(path, observer, MORE)
    return path.read_bytes()


def refused(path, observer, data):
    """Whether a file is refused by a short line, with nothing changed; else it is as written."""
    path.write_bytes(data)
    before = [np.array(values) for values in observer.memory]
    state = observer.twin.snapshot()
    try:
        found = load_snapshot(path, observer, MORE)
    except TwinError as error:
        said = str(error)
    else:
        np.testing.assert_array_equal(found["clock"], MORE["clock"])
        return False
    assert said.startswith(f"{path}: ")
    assert len(said) < 400
    assert "\n" not in said
    for old, new in zip(before, observer.memory, strict=True):
        np.testing.assert_array_equal(old, new)
    np.testing.assert_array_equal(state.state, observer.twin.snapshot().state)
    return True


def mutated(data, rng):
    """Some bytes changed, or a part cut out, doubled or filled with zeros."""
    values = bytearray(data)
    first, last = sorted(rng.integers(0, len(values), 2).tolist())
    match rng.integers(0, 5):
        case 0:
            for place in rng.integers(0, len(values), rng.integers(1, 9)):
                values[place] = int(rng.integers(0, 256))
        case 1:
            del values[first:last]
        case 2:
            values[first:first] = values[first:last]
        case 3:
            values[first:last] = bytes(last - first)
        case _:
            del values[first:]
    return bytes(values)


@pytest.mark.parametrize("count", [300, pytest.param(1000, marks=pytest.mark.slow)])
def test_mutations_are_refused_or_change_nothing(observer, sound, tmp_path, count):
    rng = np.random.default_rng(count)
    found = [refused(tmp_path / "s.npz", observer, mutated(sound, rng)) for _ in range(count)]
    assert np.mean(found) > 0.8


def rewritten(data, change):
    """The archive with its arrays changed."""
    arrays = dict(np.load(io.BytesIO(data)))
    change(arrays)
    stream = io.BytesIO()
    np.savez(stream, **arrays)
    return stream.getvalue()


@pytest.mark.parametrize(
    "change",
    [
        lambda a: a.update({"twin.parameters": np.zeros(3)}),
        lambda a: a.update({"memory.laws": a["memory.laws"].astype(np.float32)}),
        lambda a: a.update({"twin.state": np.full_like(a["twin.state"], np.nan)}),
        lambda a: a.pop("memory.watch"),
        lambda a: a.pop("more.clock"),
        lambda a: a.update({"memory.laws": 1e300 * np.ones_like(a["memory.laws"])}),
        lambda a: a.update({"sha256": np.array("0" * 64)}),
    ],
)
def test_array_that_was_changed_is_refused(observer, sound, tmp_path, change):
    assert refused(tmp_path / "s.npz", observer, rewritten(sound, change))


def test_other_arrays_than_asked_for_are_refused(observer, sound, tmp_path):
    path = tmp_path / "s.npz"
    path.write_bytes(sound)
    for more, word in (({"clock": np.zeros(4)}, "shape"), ({"date": np.zeros(1)}, "no array")):
        with pytest.raises(TwinError, match=word):
            load_snapshot(path, observer, more)


def test_head_that_claims_gigabytes_is_refused_before_they_are_taken(observer, sound, tmp_path):
    stream = io.BytesIO()
    head = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        head, {"shape": (1 << 29,), "fortran_order": False, "descr": "<f8"}
    )
    with zipfile.ZipFile(stream, "w") as file:
        file.writestr("twin.state.npy", head.getvalue())
    assert refused(tmp_path / "s.npz", observer, stream.getvalue())


def test_archive_that_unpacks_to_much_more_is_refused(observer, tmp_path):
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr("twin.state.npy", bytes(100 << 20))
    assert len(stream.getvalue()) < 200_000
    assert refused(tmp_path / "s.npz", observer, stream.getvalue())


def test_folder_is_no_snapshot(observer, tmp_path):
    with pytest.raises(TwinError, match="no such snapshot"):
        load_snapshot(tmp_path, observer, MORE)
