"""The server as an agent starts it: a process on stdin and stdout, and one on loopback HTTP."""

from __future__ import annotations

import socket
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import anyio
import pytest
from mcp.client.client import Client
from mcp.client.stdio import StdioServerParameters, stdio_client

from support import kitchen
from support.cli import supermap

LIMIT_S = 90
COMMAND = (sys.executable, "-m", "supermap_cli.main", "mcp", "--db")


@pytest.fixture(scope="module")
def db(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return kitchen.make_kitchen(tmp_path_factory.mktemp("transports") / "kitchen.db")


async def answers(server: Any) -> tuple[set[str], Any, Any]:
    async with Client(server) as client:
        tools = {tool.name for tool in (await client.list_tools()).tools}
        return (
            tools,
            await client.call_tool("query", {"question": "where is the vase"}),
            await client.call_tool("show", {"id": "nothing-1"}),
        )


def check(found: tuple[set[str], Any, Any]) -> None:
    tools, vase, nothing = found
    assert "navigate" in tools
    assert vase.structured_content["instances"][0]["id"] == "vase-1"
    assert nothing.is_error
    assert "no object 'nothing-1'" in nothing.content[0].text


def test_over_stdio(db: Path) -> None:
    async def run() -> tuple[set[str], Any, Any]:
        with anyio.fail_after(LIMIT_S):
            parameters = StdioServerParameters(command=COMMAND[0], args=[*COMMAND[1:], str(db)])
            return await answers(stdio_client(parameters))

    check(anyio.run(run))


def test_over_http_on_loopback(db: Path) -> None:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    server = subprocess.Popen([*COMMAND, str(db), "--http", str(port)], stderr=subprocess.PIPE)
    try:
        _wait_for(port, server)

        async def run() -> tuple[set[str], Any, Any]:
            with anyio.fail_after(LIMIT_S):
                return await answers(f"http://127.0.0.1:{port}/mcp")

        check(anyio.run(run))
    finally:
        server.terminate()
        _, said = server.communicate(timeout=LIMIT_S)
    assert f"http://127.0.0.1:{port}/mcp".encode() in said


def _wait_for(port: int, server: subprocess.Popen[bytes]) -> None:
    end = time.monotonic() + LIMIT_S
    while time.monotonic() < end:
        assert server.poll() is None, "the server has stopped"
        with socket.socket() as client:
            client.settimeout(1)
            if client.connect_ex(("127.0.0.1", port)) == 0:
                return
        time.sleep(0.1)
    raise AssertionError("the server does not listen")


def test_a_missing_map_is_one_line_before_anything_is_served(tmp_path: Path) -> None:
    result = supermap("mcp", "--db", tmp_path / "none.db")
    assert "supermap build" in str(result.exception)


def test_without_the_library_the_command_names_the_extra(db: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in [name for name in sys.modules if name.startswith("supermap_cli.mcp_server")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "mcp", None)
    monkeypatch.setitem(sys.modules, "mcp.server.mcpserver", None)
    result = supermap("mcp", "--db", db)
    assert "supermap-cli[mcp]" in str(result.exception)


def test_a_port_that_is_taken_is_refused_with_the_cure(db: Path) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        result = supermap("mcp", "--db", db, "--http", str(taken.getsockname()[1]))
    assert "name another port" in str(result.exception)
