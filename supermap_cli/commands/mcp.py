"""`supermap mcp`."""

from __future__ import annotations

from typing import Annotated

import typer

from supermap_cli.commands.common import DbOption, database_url, err
from supermap_cli.commands.whole_numbers import whole
from supermap_cli.errors import ConfigError

EXAMPLES = """
Examples:

    supermap mcp --db office.db

    supermap mcp --db office.db --http 8765
"""
CURE = "pip install 'supermap-cli[mcp]'"


def register(app: typer.Typer) -> None:
    """Add the command to the app."""
    app.command(epilog=EXAMPLES)(mcp)


def mcp(
    db: DbOption = None,
    http: Annotated[
        int | None,
        typer.Option(
            min=1,
            max=65535,
            callback=whole,
            metavar="PORT",
            help="Serve http://127.0.0.1:PORT/mcp, for this machine only, instead of stdin and stdout.",
        ),
    ] = None,
) -> None:
    """Serve the map to an agent as tools of the Model Context Protocol, read-only.

    An agent's settings name the command: {"command": "supermap", "args": ["mcp", "--db", "/path/to/office.db"]}.
    A build may write to the map meanwhile. Needs the extra `mcp`.
    """
    try:
        from supermap_cli.mcp_server.server import serve_http, serve_stdio  # noqa: PLC0415 - an extra
    except ImportError as error:
        if (error.name or "").partition(".")[0] != "mcp":
            raise
        raise ConfigError("the protocol's library is not installed", cure=CURE) from error
    from supermap_cli.memory_api import open_memory  # noqa: PLC0415 - keeps start-up light

    with open_memory(database_url(db)) as memory:
        if http is None:
            serve_stdio(memory)
        else:
            err().print(f"serving http://127.0.0.1:{http}/mcp until Ctrl-C", markup=False)
            serve_http(memory, http)
