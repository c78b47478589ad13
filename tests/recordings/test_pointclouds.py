"""Sweeps of any layout, each point with its own time."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from supermap_cli.recordings.containers import open_storage
from supermap_cli.recordings.decoding import Decoder, MessageError, any_numbers
from supermap_cli.recordings.definitions import LIVOX_PACKAGES
from supermap_cli.recordings.notes import Notes
from supermap_cli.recordings.pointclouds import point_stamps, read_points
from support import bags

STAMP = bags.START_NS
RELATIVE_S = np.linspace(0, 0.1, 11)


def read_one(path, write):
    with bags.BagWriter(path) as bag:
        write(bag)
    raw = next(open_storage(path, Notes()).messages(["/points"]))
    return read_points(raw, Decoder("test"))


@pytest.mark.parametrize(
    "times",
    [
        RELATIVE_S.astype(np.float32),
        RELATIVE_S - 0.1,
        (RELATIVE_S * 1e3).astype(np.float32),
        (RELATIVE_S * 1e6).astype(np.uint32),
        (RELATIVE_S * 1e9).astype(np.uint32),
        (RELATIVE_S * 1e9).astype(np.float32),
        RELATIVE_S + STAMP / 1e9,
        STAMP + (RELATIVE_S * 1e9).astype(np.uint64),
        (STAMP // 1000 + (RELATIVE_S * 1e6).astype(np.int64)).astype(np.uint64),
        RELATIVE_S * 1e9 + STAMP,
    ],
    ids=[
        "s",
        "s before",
        "ms",
        "us",
        "ns",
        "ns float",
        "absolute s",
        "absolute ns",
        "absolute us",
        "absolute ns float",
    ],
)
def test_point_times_of_any_unit_are_understood(times):
    stamps, foreign = point_stamps(times, STAMP)
    offsets = (stamps - STAMP) / 1e9
    expected = RELATIVE_S if times.min() >= 0 else RELATIVE_S - 0.1
    assert np.allclose(offsets, expected, atol=1e-5)
    assert not foreign


def test_times_of_another_clock_count_from_the_first_point():
    stamps, foreign = point_stamps((RELATIVE_S * 1e9).astype(np.uint64) + 10**15, STAMP)
    assert foreign
    assert np.allclose((stamps - STAMP) / 1e9, RELATIVE_S, atol=1e-6)


@given(st.lists(st.integers(0, 10**8), min_size=1))
def test_nanoseconds_stay_exact(offsets):
    times = np.array([*offsets, 10**8], np.uint32)
    assert (point_stamps(times, STAMP)[0] - STAMP).tolist() == times.tolist()


def test_a_sweep_without_points_is_a_sweep(tmp_path):
    kind = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4")])
    read = read_one(tmp_path / "a.mcap", lambda bag: bag.points("/points", STAMP, "lidar", np.zeros(0, kind)))
    assert read.points.shape == (0, 3)


@pytest.mark.parametrize("order", ["<", ">"])
def test_fields_lie_anywhere_and_no_returns_are_dropped(tmp_path, order):
    kind = np.dtype(
        {
            "names": ["intensity", "z", "x", "y", "t"],
            "formats": [f"{order}f4", f"{order}f8", f"{order}f4", f"{order}f4", f"{order}u4"],
            "offsets": [0, 8, 20, 26, 32],
            "itemsize": 40,
        }
    )
    records = np.zeros(4, kind)
    records["x"], records["y"], records["z"] = [1, np.nan, 0, 4], [1, 2, 0, 4], [1, 2, 0, 4]
    records["t"] = [0, 1, 2, 50_000_000]

    def write(bag):
        bag.points("/points", STAMP, "/lidar", records, big_endian=order == ">")

    read = read_one(tmp_path / "a.mcap", write)
    assert read.frame_id == "lidar"
    assert read.points.tolist() == [[1, 1, 1], [4, 4, 4]]
    assert (read.point_stamps_ns - STAMP).tolist() == [0, 50_000_000]


def test_points_without_time_have_the_sweeps_time(tmp_path):
    records = np.ones(3, np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("ring", "<u2")]))
    read = read_one(tmp_path / "a.mcap", lambda bag: bag.points("/points", STAMP, "lidar", records))
    assert read.point_stamps_ns.tolist() == [STAMP] * 3


def test_a_cloud_without_coordinates_is_refused(tmp_path):
    records = np.ones(3, np.dtype([("range", "<f4")]))
    with pytest.raises(MessageError, match="without x, y, z"):
        read_one(tmp_path / "a.mcap", lambda bag: bag.points("/points", STAMP, "lidar", records))


@pytest.mark.parametrize("package", LIVOX_PACKAGES)
@pytest.mark.parametrize("name", ["a.mcap", "a.bag", "a.db3"])
@pytest.mark.parametrize("frame", ["livox_frame", "l"])
def test_livox_messages_under_all_their_names(tmp_path, package, name, frame):
    points = np.array([[1, 2, 3], [0, 0, 0], [4.5, 5, 6]])
    offsets = np.array([0, 10, 99_000_000])

    def write(bag):
        bag.livox("/points", STAMP, frame, points, offsets, package=package)

    read = read_one(tmp_path / name, write)
    assert read.frame_id == frame
    assert read.points.tolist() == [[1, 2, 3], [4.5, 5, 6]]
    assert (read.point_stamps_ns - STAMP).tolist() == [0, 99_000_000]


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("times", [[3e38, -3e38], [np.nan, np.inf], [-(2**63), 2**63 - 1]])
def test_times_of_no_clock_overflow_in_silence(times):
    kind = np.int64 if isinstance(times[0], int) else np.float32
    with any_numbers():
        stamps_ns, _ = point_stamps(np.array(times, kind), 1_700_000_000_000_000_000)
    assert stamps_ns.dtype == np.int64
