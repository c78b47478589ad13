"""Containers: each gives the same messages; what is cut off is read up to the cut."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import CompressionType

from supermap_cli.errors import RecordingError
from supermap_cli.recordings.containers import open_storage
from supermap_cli.recordings.notes import Notes
from supermap_cli.recordings.storage import Channel, RawMessage, merge_lazily
from support import bags

FORMATS = ["run.mcap", "run.db3", "run.bag", "run"]


def write_imu(path: Path, stamps, **options) -> Path:
    with bags.BagWriter(path, **options) as bag:
        for index, at in enumerate(stamps):
            bag.imu(f"/imu{index % 2}", at, "imu", (0, 0, 0), (0, 0, 9.81))
    return path


def message(log_ns: int) -> RawMessage:
    return RawMessage(Channel("/t", "x/msg/X", "cdr", b"", "", 0), log_ns, b"")


def test_merging_nothing_gives_nothing():
    assert list(merge_lazily([])) == []
    assert list(merge_lazily([(0, list), (5, list)])) == []


def test_parts_are_opened_only_when_their_time_has_come():
    opened = []

    def part(*times):
        def read():
            opened.append(times)
            return [message(time) for time in times]

        return times[0], read

    merged = merge_lazily([part(10, 11), part(1, 4), part(3, 12)])
    assert next(merged).log_ns == 1
    assert opened == [(1, 4)]
    assert [message.log_ns for message in merged] == [3, 4, 10, 11, 12]


@pytest.mark.parametrize("name", FORMATS)
def test_every_format_gives_the_same_messages(tmp_path, name):
    storage = open_storage(write_imu(tmp_path / name, [bags.stamp(i) for i in range(6)]), Notes())
    assert [(channel.topic, channel.msgtype, channel.count) for channel in storage.channels] == [
        ("/imu0", "sensor_msgs/msg/Imu", 3),
        ("/imu1", "sensor_msgs/msg/Imu", 3),
    ]
    assert (storage.start_ns, storage.end_ns) == (bags.stamp(0), bags.stamp(5))
    found = list(storage.messages(["/imu1"], bags.stamp(2), bags.stamp(5)))
    assert [message.log_ns for message in found] == [bags.stamp(3)]
    assert list(storage.messages(["/none"])) == []
    assert sorted(storage.log_times(["/imu0"])) == [("/imu0", bags.stamp(i)) for i in (0, 2, 4)]


@pytest.mark.parametrize("name", FORMATS)
def test_two_readers_do_not_disturb_one_another(tmp_path, name):
    storage = open_storage(write_imu(tmp_path / name, [bags.stamp(i) for i in range(8)]), Notes())
    first, second = storage.messages(["/imu0"]), storage.messages(["/imu0"])
    times = [(next(first).log_ns, next(second).log_ns) for _ in range(4)]
    assert all(a == b for a, b in times)


def test_chunks_that_overlap_in_time_are_merged(tmp_path):
    stamps = [bags.stamp(i) for i in (0, 5, 1, 6, 2, 7, 3, 4)]
    storage = open_storage(write_imu(tmp_path / "run.mcap", stamps, chunk_size=600), Notes())
    times = [message.log_ns for message in storage.messages(["/imu0", "/imu1"])]
    assert times == sorted(stamps)


@pytest.mark.parametrize("compression", [CompressionType.NONE, CompressionType.LZ4, CompressionType.ZSTD])
def test_a_cut_mcap_is_read_up_to_the_cut(tmp_path, compression):
    whole = write_imu(
        tmp_path / "whole.mcap", [bags.stamp(i) for i in range(200)], chunk_size=8000, compression=compression
    )
    notes = Notes()
    storage = open_storage(bags.cut_file(whole, tmp_path / "cut.mcap", 0.6), notes)
    times = [message.log_ns for message in storage.messages(["/imu0", "/imu1"])]
    assert 40 < len(times) < 200
    assert times == [bags.stamp(i) for i in range(len(times))]
    assert sum(channel.count for channel in storage.channels) == len(times)
    assert ["cut off" in line for line in notes.lines] == [True]


@pytest.mark.parametrize("options", [{"use_chunking": False}, {"repeat_channels": False, "repeat_schemas": False}])
def test_an_mcap_without_an_index_is_scanned(tmp_path, options):
    notes = Notes()
    storage = open_storage(write_imu(tmp_path / "run.mcap", [bags.stamp(i) for i in range(9)], **options), notes)
    assert len(list(storage.messages(["/imu0", "/imu1"]))) == 9
    assert len(list(storage.log_times(["/imu0", "/imu1"]))) == 9
    assert notes.lines == ()


def test_a_split_folder_is_one_recording(tmp_path):
    folder = tmp_path / "split"
    folder.mkdir()
    write_imu(folder / "split_0.mcap", [bags.stamp(i) for i in range(4)])
    write_imu(folder / "split_1.mcap", [bags.stamp(i) for i in range(4, 9)])
    notes = Notes()
    storage = open_storage(folder, notes)
    assert [message.log_ns for message in storage.messages(["/imu0"])] == [bags.stamp(i) for i in (0, 2, 4, 6, 8)]
    assert sum(channel.count for channel in storage.channels) == 9
    assert "metadata.yaml" in notes.lines[0]


def test_a_folder_with_metadata_leaves_other_files_alone(tmp_path):
    folder = write_imu(tmp_path / "run", [bags.stamp(i) for i in range(4)])
    write_imu(tmp_path / "other.db3", [bags.stamp(i) for i in range(50)])
    shutil.move(tmp_path / "other.db3", folder / "other.db3")
    assert sum(channel.count for channel in open_storage(folder, Notes()).channels) == 4


@pytest.mark.parametrize(
    ("make", "what"),
    [
        (lambda path: None, "no such recording"),
        (lambda path: path.write_bytes(b""), "an empty file"),
        (lambda path: path.write_text("hello world, no bag"), "not a recording"),
        (lambda path: path.mkdir(), "a folder without a recording"),
        (lambda path: path.write_bytes(b"#ROSBAG V2.0\nnothing"), "cut off before its first message"),
        (lambda path: path.write_bytes(b"SQLite format 3\0" + bytes(200)), "cannot be read"),
        (lambda path: path.write_bytes(b"\x89MCAP0\r\n"), "cut off before its first message"),
    ],
)
def test_what_is_no_recording_is_refused_in_one_line(tmp_path, make, what):
    path = tmp_path / ("run.db3" if "SQLite" in repr(make.__code__.co_consts) else "run")
    make(path)
    with pytest.raises(RecordingError, match=what) as caught:
        open_storage(path, Notes())
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)
    assert caught.value.cure


@pytest.mark.parametrize("name", ["run.db3", "run.bag", "run.mcap"])
@pytest.mark.parametrize("share", [0.05, 0.5, 0.9, 0.999])
def test_a_cut_of_any_format_is_read_or_refused_but_never_a_bug(tmp_path, name, share):
    whole = write_imu(tmp_path / name, [bags.stamp(i) for i in range(300)])
    cut = bags.cut_file(whole, whole.with_stem("cut"), share)
    refusal = None
    try:
        storage = open_storage(cut, Notes())
        assert len(list(storage.messages(["/imu0", "/imu1"]))) <= 300
    except RecordingError as error:
        refusal = error
    assert refusal is None or (str(cut) in str(refusal) and refusal.cure)


def test_damage_inside_leaves_the_rest_readable(tmp_path):
    path = write_imu(tmp_path / "run.mcap", [bags.stamp(i) for i in range(200)], chunk_size=8000)
    data = np.fromfile(path, np.uint8)
    data[2000:2100] = 0
    data.tofile(path)
    notes = Notes()
    found = list(open_storage(path, notes).messages(["/imu0", "/imu1"]))
    assert 0 < len(found) < 200
    assert any("damaged" in line for line in notes.lines)
