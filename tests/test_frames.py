"""Drives from and to frames; parts and joints of drives."""

import numpy as np
import pytest

from twin import Drive, TwinError

N = 40
TIME = 5.0 + 0.01 * np.arange(N)
RNG = np.random.default_rng(0)
DRIVE = Drive(
    time=TIME,
    inputs=RNG.standard_normal((N, 1)),
    input_names=("steering_wheel_angle",),
    measurements=RNG.standard_normal((N, 2)),
    output_names=("ax", "vx"),
    truth={"mass": np.full(N, 7.0)},
    settings={"seed": 3},
)
MAP = {
    "rate": 100,
    "channels": {"ax": {"name": "Long", "unit": "g"}},
    "constants": dict.fromkeys(
        ("steering_wheel_angle", "drive_torque", "brake_torque", "road_height"), 0.0
    ),
}
LONG = np.sin(TIME)


def same(one, other):
    assert (one.input_names, one.output_names) == (other.input_names, other.output_names)
    np.testing.assert_array_equal(one.time, other.time)
    np.testing.assert_array_equal(one.inputs, other.inputs)
    np.testing.assert_array_equal(one.measurements, other.measurements)
    assert list(one.truth) == list(other.truth)


@pytest.mark.parametrize("kind", ["pandas", "polars", "xarray", "arrow", "numpy"])
def test_drive_goes_to_a_frame_and_back_to_the_bit(kind):
    if kind in ("pandas", "polars", "xarray"):
        pytest.importorskip(kind)
    frame = DRIVE.to_frame(kind)
    back = Drive.from_frame(frame)
    same(back, DRIVE)
    assert back.settings == (DRIVE.settings if kind not in ("polars", "numpy") else {})


def frames():
    yield {"t": TIME, "Long": LONG}
    yield np.rec.fromarrays([TIME, LONG], names="t,Long")
    pd = pytest.importorskip("pandas")
    yield pd.DataFrame({"t": TIME, "Long": LONG})
    yield pd.DataFrame({"Long": LONG}, index=pd.Index(TIME, name="t"))
    yield pd.DataFrame({"Long": LONG}, index=pd.to_datetime(TIME, unit="s"))
    yield pd.DataFrame({"Long": LONG}, index=pd.to_timedelta(TIME, unit="s"))
    yield pd.DataFrame({"Long": LONG, "t": TIME}, index=range(3, 3 + N))
    pl = pytest.importorskip("polars")
    yield pl.DataFrame({"t": TIME, "Long": LONG})
    yield pl.DataFrame({"t": pl.Series(TIME * 1e6).cast(pl.Duration("us")), "Long": LONG})
    xr = pytest.importorskip("xarray")
    yield xr.Dataset({"Long": ("time", LONG)}, coords={"time": TIME})


def test_every_frame_is_read_by_a_map():
    for frame in frames():
        drive = Drive.from_frame(frame, MAP)
        np.testing.assert_allclose(drive.time - drive.time[0], TIME - TIME[0], atol=1e-6)
        np.testing.assert_allclose(drive.channel("ax"), 9.80665 * LONG, atol=1e-4)


def test_frame_that_is_none_or_has_no_time_is_refused():
    with pytest.raises(TwinError, match="frame: is int; allowed: a frame of pandas"):
        Drive.from_frame(3, MAP)
    with pytest.raises(TwinError, match="frame: no column is called time"):
        Drive.from_frame({"n": np.arange(N), "Long": LONG}, MAP)
    with pytest.raises(TwinError, match=r"map: channels.az.name is missing"):
        Drive.from_frame({"t": TIME}, MAP | {"channels": {"az": {}}})
    with pytest.raises(TwinError, match="frame: kind is 'excel'; allowed: pandas"):
        DRIVE.to_frame("excel")


def test_drive_is_sliced_and_joined():
    head, tail = DRIVE[:15], DRIVE[15:]
    assert (len(head), len(tail)) == (15, 25)
    same(Drive.joined([head, tail]), DRIVE)
    assert DRIVE[::4].dt == pytest.approx(0.04)
    part = DRIVE.between(TIME[10], TIME[20])
    np.testing.assert_array_equal(part.time, TIME[10:21])
    assert part.settings == DRIVE.settings
    bare = tail.replace(truth={})
    assert np.isnan(Drive.joined([head, bare]).truth["mass"]).sum() == 25


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: DRIVE[3], "allowed: a slice that rises"),
        (lambda: DRIVE[::-1], "allowed: a slice that rises"),
        (lambda: DRIVE[3:4], "N at least 2"),
        (lambda: DRIVE.between(0.0, 1.0), "has no two samples from 0 to 1 s"),
        (lambda: Drive.joined([]), "nothing to join"),
        (lambda: Drive.joined([DRIVE, DRIVE]), "must be strictly increasing"),
        (
            lambda: Drive.joined([DRIVE, DRIVE.replace(output_names=("ax", "vy"))]),
            "cannot be joined",
        ),
    ],
)
def test_parts_and_joints_that_cannot_be_are_refused(make, message):
    with pytest.raises(TwinError, match=message):
        make()


def test_drive_knows_its_sideslip():
    assert np.isnan(DRIVE.sideslip).all()
    measured = DRIVE.replace(
        measurements=np.tile([20.0, 2.0], (N, 1)), output_names=("vx", "vy"), truth={}
    )
    np.testing.assert_allclose(measured.sideslip, np.arctan(0.1))
    true = measured.replace(truth={"sideslip": np.full(N, 0.3)})
    np.testing.assert_allclose(true.sideslip, 0.3)
