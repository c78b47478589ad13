"""One file over HTTP: what breaks off goes on, what is wrong never takes the file's place."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from supermap_cli.errors import ModelError
from supermap_cli.weights.download import ATTEMPTS, Expected, Received, download
from support.model_server import ModelServer, serving

CONTENT = bytes(range(256)) * 40
SHA256 = hashlib.sha256(CONTENT).hexdigest()
RIGHT = Expected(len(CONTENT), SHA256)


@pytest.fixture
def server() -> Iterator[ModelServer]:
    with serving(ModelServer({"m.onnx": CONTENT})) as running:
        yield running


def fetch(server: ModelServer, target: Path, expected: Expected = RIGHT, path: str = "m.onnx") -> Received:
    return download(server.url(path), target, expected, timeout_s=10, pause_s=0.001)


def test_a_file_arrives_whole_and_nothing_else_is_left(server: ModelServer, tmp_path: Path) -> None:
    seen = []
    target = tmp_path / "new" / "m.onnx"
    assert download(
        server.url("m.onnx"), target, RIGHT, lambda done, total: seen.append((done, total)), pause_s=0.001
    ) == Received(len(CONTENT), SHA256)
    assert target.read_bytes() == CONTENT
    assert [path.name for path in target.parent.iterdir()] == ["m.onnx"]
    assert seen[0] == (0, len(CONTENT))
    assert seen[-1] == (len(CONTENT), len(CONTENT))


@pytest.mark.parametrize("ranges", [True, False])
@pytest.mark.parametrize("etag", ['"one"', 'W/"weak"', None])
@pytest.mark.parametrize("expected", [RIGHT, Expected()], ids=["known", "unknown"])
def test_a_transfer_that_breaks_off_goes_on(
    server: ModelServer, tmp_path: Path, ranges: bool, etag: str | None, expected: Expected
) -> None:
    server.breaks, server.ranges, server.etag = [1000, 2000], ranges, etag
    fetch(server, tmp_path / "m.onnx", expected)
    assert (tmp_path / "m.onnx").read_bytes() == CONTENT
    assert server.requests[1][1] == "bytes=1000-"


def test_a_later_call_goes_on_where_the_first_one_stopped(server: ModelServer, tmp_path: Path) -> None:
    server.breaks = [4000] + [0] * ATTEMPTS
    with pytest.raises(ModelError, match="does not get on"):
        fetch(server, tmp_path / "m.onnx")
    assert not (tmp_path / "m.onnx").exists()
    server.breaks.clear()
    server.requests.clear()
    fetch(server, tmp_path / "m.onnx")
    assert server.requests == [("/m.onnx", "bytes=4000-")]


@pytest.mark.parametrize("expected", [RIGHT, Expected()], ids=["known", "unknown"])
def test_a_file_that_was_replaced_meanwhile_begins_anew(
    server: ModelServer, tmp_path: Path, expected: Expected
) -> None:
    server.files["m.onnx"] = b"another file, " * 500
    server.breaks = [4000] + [0] * ATTEMPTS
    with pytest.raises(ModelError):
        fetch(server, tmp_path / "m.onnx", Expected(None, expected.sha256))
    server.files["m.onnx"], server.etag = CONTENT, '"two"'
    server.breaks.clear()
    fetch(server, tmp_path / "m.onnx", expected)
    assert (tmp_path / "m.onnx").read_bytes() == CONTENT


def test_what_was_left_of_another_file_does_not_stay_in_the_way(server: ModelServer, tmp_path: Path) -> None:
    (tmp_path / "m.onnx.partial").write_bytes(b"x" * 500)
    fetch(server, tmp_path / "m.onnx")
    assert (tmp_path / "m.onnx").read_bytes() == CONTENT


def test_a_partial_file_that_nobody_can_check_begins_anew(server: ModelServer, tmp_path: Path) -> None:
    (tmp_path / "m.onnx.partial").write_bytes(b"x" * 500)
    fetch(server, tmp_path / "m.onnx", Expected())
    assert (tmp_path / "m.onnx").read_bytes() == CONTENT


@pytest.mark.parametrize(
    ("expected", "message"),
    [(Expected(None, "0" * 64), "SHA-256"), (Expected(7, None), "catalogue says 7"), (Expected(7, SHA256), "says 7")],
)
def test_another_file_is_refused_and_the_old_one_stays(
    server: ModelServer, tmp_path: Path, expected: Expected, message: str
) -> None:
    target = tmp_path / "m.onnx"
    target.write_bytes(b"old")
    with pytest.raises(ModelError, match=message):
        fetch(server, target, expected)
    assert [(path.name, path.read_bytes()) for path in tmp_path.iterdir()] == [("m.onnx", b"old")]


def test_a_busy_server_is_asked_again(server: ModelServer, tmp_path: Path) -> None:
    server.statuses = [503, 429, 500]
    fetch(server, tmp_path / "m.onnx")
    assert len(server.requests) == 4


@pytest.mark.parametrize("status", [401, 403, 404, 410])
def test_a_refusal_is_not_asked_again_and_says_the_way_round(server: ModelServer, tmp_path: Path, status: int) -> None:
    server.statuses = [status]
    with pytest.raises(ModelError, match=rf"HTTP {status}.*--from DIR"):
        fetch(server, tmp_path / "m.onnx")
    assert len(server.requests) == 1


def test_a_redirect_is_followed_and_a_loop_is_not(server: ModelServer, tmp_path: Path) -> None:
    server.redirects = {"old.onnx": server.url("m.onnx"), "loop": server.url("loop")}
    fetch(server, tmp_path / "m.onnx", path="old.onnx")
    with pytest.raises(ModelError, match="HTTP 302"):
        fetch(server, tmp_path / "loop.onnx", path="loop")


def test_a_redirect_that_leaves_the_web_is_refused(server: ModelServer, tmp_path: Path) -> None:
    server.redirects = {"ftp": "ftp://127.0.0.1/m.onnx"}
    with pytest.raises(ModelError, match="redirects from http to ftp"):
        fetch(server, tmp_path / "m.onnx", path="ftp")


def test_a_proxy_of_the_environment_is_used(
    server: ModelServer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("http_proxy", server.address)
    for name in ("no_proxy", "NO_PROXY"):
        monkeypatch.delenv(name, raising=False)
    download("http://models.invalid/m.onnx", tmp_path / "m.onnx", RIGHT, pause_s=0.001)
    assert server.requests == [("http://models.invalid/m.onnx", None)]


def test_a_server_that_is_not_there_is_named(server: ModelServer, tmp_path: Path) -> None:
    with serving(ModelServer({})) as gone:
        url = gone.url("m.onnx")
    with pytest.raises(ModelError, match="does not get on"):
        download(url, tmp_path / "m.onnx", RIGHT, pause_s=0.001)


def test_a_folder_that_cannot_be_written_is_one_line(server: ModelServer, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("no folder")
    with pytest.raises(ModelError, match="cannot be written"):
        fetch(server, tmp_path / "file" / "m.onnx")


@settings(max_examples=15)
@given(breaks=st.lists(st.integers(1, 4000), max_size=6), size=st.integers(0, 12000))
def test_however_it_breaks_off_the_file_is_the_same(
    tmp_path_factory: pytest.TempPathFactory, breaks: list[int], size: int
) -> None:
    content = (CONTENT * 2)[: size or 1]
    target = tmp_path_factory.mktemp("broken") / "m.onnx"
    with serving(ModelServer({"m.onnx": content}, breaks=list(breaks))) as server:
        fetch(server, target, Expected(None, hashlib.sha256(content).hexdigest()))
    assert target.read_bytes() == content
