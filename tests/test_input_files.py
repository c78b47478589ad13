"""Files that a user names as input: what is no text is one line, and nothing waits for a pipe."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from supermap_cli.config import load_user_config
from supermap_cli.errors import ConfigError, DetectorError
from supermap_cli.input_files import read_class_names
from supermap_onnx.weights import find_model
from support.cli import supermap


def names(path: Path) -> tuple[str, ...]:
    return read_class_names(path, DetectorError, option="onnx.labels")


def test_class_names_stand_one_a_line(tmp_path: Path) -> None:
    path = tmp_path / "labels.txt"
    path.write_bytes(b"\xef\xbb\xbfcup\r\n\r\n potted plant \r\n")
    assert names(path) == ("cup", "potted plant")


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", "empty labels file"),
        (b"c\0u\0p\0", "holds a NUL"),
        (b"\xff", "no UTF-8 text"),
        (b"x" * 2**21, "larger than"),
    ],
)
def test_what_is_no_list_of_names_is_said(tmp_path: Path, content: bytes, said: str) -> None:
    (tmp_path / "labels.txt").write_bytes(content)
    with pytest.raises(DetectorError, match=said):
        names(tmp_path / "labels.txt")


@pytest.mark.parametrize("read", [names, find_model], ids=["labels", "model"])
def test_pipes_devices_and_folders_are_refused(tmp_path: Path, read) -> None:
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", tmp_path, Path("/dev/zero")):
        with pytest.raises(DetectorError, match=r"no regular file|a folder.*--option onnx\."):
            read(path)


@pytest.mark.parametrize("what", ["pipe", "folder", "deep", "endless number"])
def test_a_configuration_that_cannot_be_read_is_not_passed_over(tmp_path: Path, what: str) -> None:
    path = tmp_path / "supermap.toml"
    if what == "pipe":
        os.mkfifo(path)
    elif what == "folder":
        path.mkdir()
    else:
        path.write_bytes({"deep": b"a=" + b"[" * 5000, "endless number": b"db = " + b"9" * 5000}[what])
    with pytest.raises(ConfigError, match=r"supermap\.toml.*move"):
        load_user_config(tmp_path)


@pytest.mark.parametrize("number", ["nan", "inf", "-inf", "1e308"])
@pytest.mark.parametrize("option", ["--start", "--end", "--detection-tolerance"])
def test_a_number_to_work_with_is_finite(number: str, option: str) -> None:
    refused = supermap("inspect", "run.mcap", f"{option}={number}").exception
    assert isinstance(refused, ConfigError)
    assert f"{option} {float(number):g} is no number to work with" in str(refused)


def test_old_figures_are_not_read_from_a_device() -> None:
    assert "no regular file" in str(supermap("bench", "run.mcap", "--compare", "/dev/zero").exception)
