"""`supermap models`: what a user sees of weights."""

from __future__ import annotations

import fcntl
import hashlib
import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from supermap_cli.errors import ModelError
from support.cli import document, supermap
from support.model_server import ModelServer, serving

NETWORK, TOKENS = b"a network " * 1000, b"{}"

CATALOGUE = """
[[model]]
name = "small"
task = "detector"
backend = "onnx"
licence = "MIT"
[[model.file]]
path = "small.onnx"
url = "{address}/pub/net.onnx"
size = {size}
sha256 = "{sha256}"
[[model.file]]
path = "tokenizer.json"
url = "{address}/pub/tokenizer.json"

[[model]]
name = "copyleft"
task = "detector"
licence = "AGPL-3.0"
licence_url = "https://example.org/licence"
accept = true
[[model.file]]
path = "net.onnx"
url = "{address}/pub/net.onnx"
"""


@pytest.fixture
def server() -> Iterator[ModelServer]:
    with serving(ModelServer({"pub/net.onnx": NETWORK, "pub/tokenizer.json": TOKENS})) as running:
        yield running


@pytest.fixture
def folder(tmp_path: Path, server: ModelServer, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The models folder, with a catalogue of models on the server."""
    folder = tmp_path / "models"
    folder.mkdir()
    sha256 = hashlib.sha256(NETWORK).hexdigest()
    (folder / "catalogue.toml").write_text(CATALOGUE.format(address=server.address, size=len(NETWORK), sha256=sha256))
    monkeypatch.setenv("SUPERMAP_MODELS", str(folder))
    monkeypatch.delenv("SUPERMAP_MODELS_MIRROR", raising=False)
    return folder


def test_a_model_is_pulled_found_verified_and_removed(folder: Path) -> None:
    pulled = supermap("models", "pull", "small")
    assert pulled.exit_code == 0, pulled.output
    assert "small: MIT" in pulled.stderr
    assert "tokenizer.json of small could not be checked" in pulled.stderr
    assert supermap("models", "path", "small").stdout.strip() == str(folder / "small" / "small.onnx")
    assert supermap("models", "path", "small", "--file", "tokenizer.json").stdout.strip().endswith("tokenizer.json")
    (listed,) = [each for each in document("models_list", "models", "list")["models"] if each["name"] == "small"]
    assert listed["here"] is True
    (checked,) = document("models_verify", "models", "verify")["models"]
    assert [each["state"] for each in checked["files"]] == ["right", "not checked"]
    assert supermap("models", "remove", "small").exit_code == 0
    assert sorted(path.name for path in folder.iterdir()) == ["catalogue.toml"]
    assert isinstance(supermap("models", "path", "small").exception, ModelError)


def test_what_is_here_is_not_fetched_again_and_what_is_wrong_is(folder: Path, server: ModelServer) -> None:
    supermap("models", "pull", "small")
    server.requests.clear()
    again = supermap("models", "pull", "small")
    assert "was here already" in again.stdout
    assert server.requests == []
    (folder / "small" / "small.onnx").write_bytes(NETWORK[:-1] + b"!")
    (folder / "small" / "tokenizer.json").write_bytes(b"[]")
    checked = document("models_verify", "models", "verify", "small", exit_code=1)["models"][0]["files"]
    assert [each["state"] for each in checked] == ["changed", "changed"]
    assert supermap("models", "pull", "small").exit_code == 0
    assert supermap("models", "verify", "small").exit_code == 0
    assert len(server.requests) == 2


def test_a_licence_that_has_to_be_accepted_is_shown_first(folder: Path, server: ModelServer) -> None:
    refused = supermap("models", "pull", "small", "copyleft").exception
    assert "AGPL-3.0, https://example.org/licence" in str(refused)
    assert "--accept-license" in str(refused)
    assert server.requests == []
    assert supermap("models", "pull", "copyleft", "--accept-license").exit_code == 0
    assert "AGPL-3.0" in (folder / "copyleft" / "supermap-model.json").read_text()


@pytest.mark.parametrize("layout", ["small/small.onnx", "small.onnx", "small/net.onnx", "net.onnx"])
def test_a_folder_stands_in_for_the_web(folder: Path, server: ModelServer, tmp_path: Path, layout: str) -> None:
    usb = tmp_path / "usb"
    (usb / layout).parent.mkdir(parents=True)
    (usb / layout).write_bytes(NETWORK)
    (usb / "tokenizer.json").write_bytes(TOKENS)
    assert supermap("models", "pull", "small", "--from", usb).exit_code == 0
    assert (folder / "small" / "small.onnx").read_bytes() == NETWORK
    assert server.requests == []


def test_a_folder_with_another_file_is_refused(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "small.onnx").write_bytes(b"x" * len(NETWORK))
    assert "SHA-256" in str(supermap("models", "pull", "small", "--from", tmp_path).exception)
    assert "has no small/small.onnx" in str(supermap("models", "pull", "small", "--from", folder).exception)
    assert [path.name for path in (folder / "small").iterdir() if not path.name.startswith(".supermap-pull")] == []


def test_a_mirror_stands_in_for_the_publisher(
    folder: Path, server: ModelServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    server.files = {"mirror/small/small.onnx": NETWORK, "mirror/small/tokenizer.json": TOKENS}
    monkeypatch.setenv("SUPERMAP_MODELS_MIRROR", server.url("mirror"))
    assert supermap("models", "pull", "small").exit_code == 0
    assert (folder / "small" / "small.onnx").read_bytes() == NETWORK


@pytest.mark.parametrize("origin", ["ftp://127.0.0.1/x", "file:///tmp", ""])
def test_a_source_that_is_none_is_one_line(folder: Path, origin: str) -> None:
    result = supermap("models", "pull", "small", "--from", origin)
    assert result.exit_code == 1
    assert "folder" in str(result.exception)


def test_two_programs_do_not_get_one_model_at_a_time(folder: Path) -> None:
    (folder / "small").mkdir()
    lock = os.open(folder / "small" / ".supermap-pull.lock", os.O_RDWR | os.O_CREAT)
    try:
        fcntl.flock(lock, fcntl.LOCK_EX)
        assert "another program" in str(supermap("models", "pull", "small").exception)
    finally:
        os.close(lock)


def test_removing_keeps_what_is_not_the_models(folder: Path) -> None:
    supermap("models", "pull", "small")
    (folder / "small" / "notes.txt").write_text("mine")
    supermap("models", "remove", "small")
    assert [path.name for path in (folder / "small").iterdir()] == ["notes.txt"]
    assert "not here" in str(supermap("models", "remove", "small").exception)


def test_the_detector_takes_a_model_by_name_and_one_that_was_pulled(folder: Path) -> None:
    from supermap_onnx.weights import find_model

    with pytest.raises(ModelError, match="models pull small"):
        find_model(Path("small"))
    supermap("models", "pull", "small")
    assert find_model(Path("small")) == find_model(None) == folder / "small" / "small.onnx"
