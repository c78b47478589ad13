"""Downloads one file: resumed where it broke off, checked, and put in its place as a whole or not at all."""

from __future__ import annotations

import hashlib
import http.client
import json
import os
import shutil
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any
from urllib.parse import urlsplit

from supermap_cli.errors import ModelError
from supermap_cli.version import __version__

Progress = Callable[[int, int | None], None]
"""Called with the bytes that are there, and those that there will be as far as that is known."""

TIMEOUT_S = 30.0
"""s; a server that sends nothing for so long is given up. Chosen."""
ATTEMPTS = 4
"""Attempts in a row that get nothing, after which the download fails; what was got stays for the next time. Chosen."""
PAUSE_S = 1.0
"""s before the second attempt; it doubles with each further one. Chosen."""
MAX_REQUESTS = 1000
"""Requests for one file at most: a server that breaks off after every few bytes is no server. Chosen."""

_CHUNK = 1 << 20
"""Bytes read at a time."""
_PASSING = (408, 425, 429)
"""Client errors of HTTP that go away by themselves (RFC 9110, 8470, 6585); so do all of the server's, from 500 on."""


@dataclass(frozen=True)
class Expected:
    """What a file should be: exact size in bytes and SHA-256 in hex, each as far as it is known."""

    size: int | None = None
    sha256: str | None = None


@dataclass(frozen=True)
class Received:
    """What a file is: size in bytes, and SHA-256 in hex."""

    size: int
    sha256: str


class _BrokenOffError(Exception):
    """The transfer broke off; another attempt may get further."""


def download(
    url: str,
    target: Path,
    expected: Expected,
    progress: Progress | None = None,
    *,
    timeout_s: float = TIMEOUT_S,
    pause_s: float = PAUSE_S,
) -> Received:
    """Download a file over HTTP to `target`, and tell what it is.

    What arrives is kept in `<target>.partial` and goes on from there (RFC 9110, ranges) also in a later call; it takes
    the target's name when it is complete and as expected. Proxies are those of the environment (`https_proxy`,
    `no_proxy`). Raises `ModelError`: no such file, no connection, a wrong size or digest, no room, a folder that
    cannot be written. Then nothing is left at `target` that was not there before.
    """
    partial = _Partial(target, url, can_check=expected.sha256 is not None)
    resumed, fruitless, pause = partial.size > 0, 0, pause_s
    for _ in range(MAX_REQUESTS):
        before = partial.size
        try:
            _transfer(url, partial, expected, progress or _no_progress, timeout_s)
            received = digest_of(partial.path)
            if resumed and _is_wrong(received, expected):  # what lay there may have been of another file
                resumed = False
                partial.discard()
                continue
            return _accept(partial, received, expected, url)
        except _BrokenOffError as error:
            got_further = partial.size > before
            fruitless, pause = (0, pause_s) if got_further else (fruitless + 1, pause * 2)
            if fruitless >= ATTEMPTS:
                raise ModelError(
                    f"the download does not get on: {error}",
                    where=url,
                    cure="try again later: it goes on from where it broke off; or copy the files, see --from",
                ) from error
            time.sleep(pause)
    raise ModelError(f"the download broke off {MAX_REQUESTS} times", where=url, cure="try another source with --from")


def digest_of(path: Path) -> Received:
    """Size and digest of a file. Raises `ModelError` where it cannot be read."""
    try:
        with path.open("rb") as file:
            return Received(path.stat().st_size, hashlib.file_digest(file, "sha256").hexdigest())
    except OSError as error:
        raise ModelError(
            f"it cannot be read: {error.strerror}", where=str(path), cure="see to its permissions"
        ) from error


def _is_wrong(received: Received, expected: Expected) -> bool:
    return expected.size not in {None, received.size} or expected.sha256 not in {None, received.sha256}


def check(received: Received, expected: Expected, where: str) -> None:
    """Raise `ModelError` for a file that is not what it should be."""
    if expected.size is not None and received.size != expected.size:
        what = f"{received.size} bytes instead of {expected.size}"
    elif expected.sha256 is not None and received.sha256 != expected.sha256:
        what = f"the SHA-256 is {received.sha256} instead of {expected.sha256}"
    else:
        return
    raise ModelError(f"not the file that the catalogue names: {what}", where=where, cure="get it from another source")


def _accept(partial: _Partial, received: Received, expected: Expected, url: str) -> Received:
    """The partial file takes its place; a wrong one goes."""
    try:
        check(received, expected, url)
    except ModelError:
        partial.discard()
        raise
    partial.finish()
    return received


def _transfer(url: str, partial: _Partial, expected: Expected, progress: Progress, timeout_s: float) -> None:
    """One request for all that is missing. Raises `_BrokenOffError` where it may be tried again."""
    if expected.size is not None and partial.size == expected.size:
        return
    if expected.size is not None and partial.size > expected.size:
        partial.discard()
    request = urllib.request.Request(url, headers=_headers(partial))  # noqa: S310 - the catalogue holds only http(s)
    try:
        with _opener().open(request, timeout=timeout_s) as response:
            _receive(response, partial, expected, progress, url)
    except urllib.error.HTTPError as error:
        _refused(error, partial, url)
    except urllib.error.URLError as error:
        raise _BrokenOffError(_reason(error.reason)) from error
    except (http.client.HTTPException, OSError) as error:
        raise _BrokenOffError(_reason(error)) from error


def _receive(response: Any, partial: _Partial, expected: Expected, progress: Progress, url: str) -> None:
    begin = _begin(response.headers) if response.status == http.HTTPStatus.PARTIAL_CONTENT else 0
    if begin != partial.size:  # the server sends the whole, or another part than was asked for
        partial.discard()
        if begin != 0:
            raise _BrokenOffError("the server sent another range")
    announced = _announced(response.headers)
    total = expected.size if announced is None else begin + announced
    if expected.size is not None and total is not None and total != expected.size:
        raise ModelError(
            f"the server has {total} bytes, the catalogue says {expected.size}",
            where=url,
            cure="it is another file: get it from another source with --from",
        )
    partial.make_room(None if total is None else total - begin)
    with partial.opened(_validator(response.headers)) as file:
        done = begin
        progress(done, total)
        while chunk := response.read(_CHUNK):
            if total is not None and done + len(chunk) > total:
                chunk = chunk[: total - done]
            partial.write(file, chunk)
            done += len(chunk)
            progress(done, total)
            if done == total:
                break
    if total is not None and done < total:
        raise _BrokenOffError(f"it broke off after {done} of {total} bytes")


def _refused(error: urllib.error.HTTPError, partial: _Partial, url: str) -> None:
    """What a status beyond 2xx means."""
    if error.code == http.HTTPStatus.REQUESTED_RANGE_NOT_SATISFIABLE:
        partial.discard()
        raise _BrokenOffError("the server knows no such range") from error
    if error.code >= 500 or error.code in _PASSING:
        raise _BrokenOffError(f"HTTP {error.code} {error.reason}") from error
    cures = {
        401: "it is only given to those who log in: get it by hand, and say --from DIR",
        403: "it is only given to those who log in: get it by hand, and say --from DIR",
    }
    cure = cures.get(error.code, "the file has moved: get it by hand, and say --from DIR")
    raise ModelError(f"the server refuses: HTTP {error.code} {error.reason}", where=url, cure=cure) from error


class _Redirects(urllib.request.HTTPRedirectHandler):
    """Redirects stay on the web, and what was asked for encrypted is not fetched in the clear."""

    def redirect_request(  # noqa: PLR0917 - urllib's
        self, req: urllib.request.Request, fp: IO[bytes], code: int, msg: str, headers: Any, newurl: str
    ) -> urllib.request.Request | None:
        before, after = urlsplit(req.full_url).scheme, urlsplit(newurl).scheme
        if after not in {"http", "https"} or (before == "https" and after == "http"):
            raise ModelError(
                f"the server redirects from {before} to {after}",
                where=newurl,
                cure="get it by hand, and say --from DIR",
            )
        return super().redirect_request(req, fp, code, msg, headers, newurl)


def _opener() -> urllib.request.OpenerDirector:
    return urllib.request.build_opener(_Redirects)


def _headers(partial: _Partial) -> dict[str, str]:
    headers = {"User-Agent": f"supermap/{__version__}", "Accept-Encoding": "identity"}
    if partial.size:
        headers["Range"] = f"bytes={partial.size}-"
        if partial.validator is not None:
            headers["If-Range"] = partial.validator
    return headers


def _begin(headers: Mapping[str, str]) -> int:
    """The first byte of a range (`Content-Range: bytes 5-9/10`)."""
    unit, _, rest = headers.get("Content-Range", "").partition(" ")
    first = rest.partition("-")[0]
    if unit != "bytes" or not first.isdecimal():
        raise _BrokenOffError("a range that is not understood")
    return int(first)


def _announced(headers: Mapping[str, str]) -> int | None:
    length = headers.get("Content-Length", "")
    return int(length) if length.isdecimal() else None


def _validator(headers: Mapping[str, str]) -> str | None:
    """A strong validator of the file (RFC 9110, 13.1.5); weak ones do not go with ranges."""
    etag = headers.get("ETag", "")
    return etag if etag.startswith('"') else None


def _reason(error: object) -> str:
    text = getattr(error, "strerror", None) or str(error)
    return text or type(error).__name__


def _no_progress(done: int, total: int | None) -> None:
    """Nobody looks."""


class _Partial:
    """What has arrived of a file, and by which the server tells that it is still the same."""

    def __init__(self, target: Path, url: str, *, can_check: bool) -> None:
        self.path = target.with_name(target.name + ".partial")
        self._target = target
        self._url = url
        self._notes = target.with_name(target.name + ".partial.json")
        try:
            target.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise self._unwritable(error) from error
        self.validator = self._known_validator()
        if self.validator is None and not can_check:
            self.discard()  # nobody could tell whether the rest belongs to it

    @property
    def size(self) -> int:
        """Bytes that are there."""
        try:
            return self.path.stat().st_size
        except OSError:
            return 0

    def opened(self, validator: str | None) -> IO[bytes]:
        """The file, to be written on."""
        self.validator = validator
        try:
            self._notes.write_text(json.dumps({"url": self._url, "validator": validator}), encoding="utf-8")
            return self.path.open("ab")
        except OSError as error:
            raise self._unwritable(error) from error

    def write(self, file: IO[bytes], chunk: bytes) -> None:
        """Add what arrived."""
        try:
            file.write(chunk)
            file.flush()
        except OSError as error:
            raise self._unwritable(error) from error

    def make_room(self, missing: int | None) -> None:
        """Raise `ModelError` where the disk has no room for what is missing."""
        free = shutil.disk_usage(self._target.parent).free
        if missing is not None and missing > free:
            raise ModelError(
                f"there is no room for {missing / 1e6:.0f} MB, {free / 1e6:.0f} MB are free",
                where=str(self._target.parent),
                cure="make room, or name another folder with SUPERMAP_MODELS",
            )

    def finish(self) -> None:
        """The file takes its name."""
        try:
            with self.path.open("rb") as file:
                os.fsync(file.fileno())
            self.path.replace(self._target)
        except OSError as error:
            raise self._unwritable(error) from error
        self._notes.unlink(missing_ok=True)

    def discard(self) -> None:
        """Begin anew."""
        self.validator = None
        with suppress(FileNotFoundError):
            self.path.unlink()
        with suppress(FileNotFoundError):
            self._notes.unlink()

    def _known_validator(self) -> str | None:
        try:
            notes = json.loads(self._notes.read_text(encoding="utf-8"))
        except (OSError, ValueError, RecursionError):
            return None
        if not isinstance(notes, dict) or notes.get("url") != self._url:
            return None
        validator = notes.get("validator")
        return validator if isinstance(validator, str) else None

    def _unwritable(self, error: OSError) -> ModelError:
        return ModelError(
            f"it cannot be written: {error.strerror}",
            where=str(self._target),
            cure="make room, or name another folder with SUPERMAP_MODELS",
        )
