"""A web server on loopback that has files, and the faults that servers have."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer


@dataclass
class ModelServer:
    """What is served, and how badly. `requests` are (path, Range header) as they came.

    `breaks`: bytes after which the next answers break off, one entry an answer. `statuses`: what the next answers say
    instead. `etag` is the files' validator, `ranges` whether it knows ranges, `redirects` maps a path to an address.
    """

    files: dict[str, bytes]
    breaks: list[int] = field(default_factory=list)
    statuses: list[int] = field(default_factory=list)
    redirects: dict[str, str] = field(default_factory=dict)
    etag: str | None = '"one"'
    ranges: bool = True
    requests: list[tuple[str, str | None]] = field(default_factory=list)
    address: str = ""

    def url(self, path: str) -> str:
        """The address of a file."""
        return f"{self.address}/{path}"


@contextmanager
def serving(server: ModelServer) -> Iterator[ModelServer]:  # noqa: C901 - a handler is a class
    """The server runs on a free port of loopback."""

    class Handler(BaseHTTPRequestHandler):
        timeout = 20

        def log_message(self, *_: object) -> None:
            """Say nothing."""

        def do_GET(self) -> None:
            path = self.path.partition("://")[2].partition("/")[2] if "://" in self.path else self.path[1:]
            server.requests.append((self.path, self.headers["Range"]))
            if server.statuses:
                self._end(server.statuses.pop(0))
            elif path in server.redirects:
                self.send_response(302)
                self.send_header("Location", server.redirects[path])
                self._no_body()
            elif path not in server.files:
                self._end(404)
            else:
                self._send(server.files[path])

        def _send(self, content: bytes) -> None:
            begin = self._begin(len(content))
            if begin >= len(content):
                self._end(416)
                return
            self.send_response(206 if begin else 200)
            if begin:
                self.send_header("Content-Range", f"bytes {begin}-{len(content) - 1}/{len(content)}")
            if server.etag is not None:
                self.send_header("ETag", server.etag)
            self.send_header("Content-Length", str(len(content) - begin))
            self.end_headers()
            end = begin + server.breaks.pop(0) if server.breaks else len(content)
            self.wfile.write(content[begin:end])
            self.close_connection = True

        def _begin(self, size: int) -> int:
            asked, condition = self.headers["Range"], self.headers["If-Range"]
            if asked is None or not server.ranges or (condition is not None and condition != server.etag):
                return 0
            return int(asked.removeprefix("bytes=").partition("-")[0])

        def _end(self, status: int) -> None:
            self.send_response(status)
            self._no_body()

        def _no_body(self) -> None:
            self.send_header("Content-Length", "0")
            self.end_headers()

    running = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    server.address = f"http://127.0.0.1:{running.server_port}"
    thread = threading.Thread(target=running.serve_forever, kwargs={"poll_interval": 0.01}, daemon=True)
    thread.start()
    try:
        yield server
    finally:
        running.shutdown()
        running.server_close()
        thread.join(10)
