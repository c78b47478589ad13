"""Which container a recording is in, by its first bytes; opening it."""

from __future__ import annotations

import re
from pathlib import Path

from supermap_cli.errors import RecordingError
from supermap_cli.input_files import check_readable
from supermap_cli.recordings.notes import Notes
from supermap_cli.recordings.storage import SplitStorage, Storage

FORMATS = "a ROS 1 .bag, a ROS 2 .db3 or .mcap file, or a rosbag2 folder"
"""What can be read, for error messages."""


def storage_files(path: Path) -> list[Path]:
    """The files a recording is made of, in order."""
    if path.is_file():
        return [path]
    return sorted(file for file in path.iterdir() if file.is_file())


def open_storage(path: Path, notes: Notes) -> Storage:
    """Open a recording of any known format, recognised by its first bytes. Raises `RecordingError`."""
    check_readable(path, RecordingError, what="a recording", folder=True)
    if not path.exists():
        raise RecordingError("no such recording", where=str(path), cure="check the path")
    try:
        return _open_folder(path, notes) if path.is_dir() else _open_file(path, notes)
    except PermissionError as error:
        raise RecordingError("no permission to read", where=str(path), cure="check the file's mode") from error


def _open_file(path: Path, notes: Notes) -> Storage:
    from supermap_cli.recordings.mcap_storage import MAGIC, McapStorage  # noqa: PLC0415 - decompressors load lazily
    from supermap_cli.recordings.ros_storage import Ros1Storage, Ros2Storage  # noqa: PLC0415 - rosbags loads lazily

    with path.open("rb") as file:
        head = file.read(16)
    if not head:
        raise RecordingError("an empty file", where=str(path), cure="record again, or name another file")
    if head.startswith(MAGIC):
        return McapStorage(path, notes)
    if head.startswith(b"#ROSBAG V"):
        return Ros1Storage(path)
    if head.startswith(b"SQLite format 3\0"):
        return Ros2Storage(path)
    raise RecordingError("not a recording in a known format", where=str(path), cure=f"give {FORMATS}")


def _open_folder(path: Path, notes: Notes) -> Storage:
    from supermap_cli.recordings.ros_storage import Ros2Storage  # noqa: PLC0415 - rosbags loads lazily

    files = sorted([*path.glob("*.mcap"), *path.glob("*.db3")])
    metadata = path / "metadata.yaml"
    if metadata.is_file():
        described = metadata.read_text(encoding="utf-8", errors="replace")
        if re.search(r"compression_mode:\s*[\"']?(file|message)", described, re.IGNORECASE):
            return Ros2Storage(path)
        files = [file for file in files if file.name in described]
    elif files:
        notes.note("metadata", f"{path}: no metadata.yaml, its {len(files)} files are read as one recording")
    if not files:
        raise RecordingError("a folder without a recording", where=str(path), cure=f"give {FORMATS}")
    return SplitStorage([_open_file(file, notes) for file in files])
