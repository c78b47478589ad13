"""Writes a session of an agent with `supermap mcp` as Markdown: the one in docs/agents.md.

    python tools/write_agent_session.py MAP.db

Calls go over stdio by the SDK's own client; what is printed is what the server answers, long texts cut.
"""

from __future__ import annotations

import argparse
import json
import sys
from typing import Any

import anyio
from mcp.client.client import Client
from mcp.client.stdio import StdioServerParameters, stdio_client

CALLS: tuple[tuple[str, dict[str, Any]], ...] = (
    ("query", {"question": "is the plant still there"}),
    ("changes_since", {"since": "monday"}),
    ("query", {"question": "where is the flibber"}),
    (
        "ask_typed",
        {"question": {"kind": "Count", "things": {"kind": "Things", "noun": {"kind": "Named", "name": "chair"}}}},
    ),
    ("navigate", {"instruction": "go to the chair"}),
    ("navigate", {"instruction": "go to the bucket, then to the plant"}),
    ("crop", {"id": "bucket-1"}),
)
KEPT = ("message", "verdict", "count", "notes", "complete", "waypoints", "last_looked_at", "memory")
"""Fields of an answer that are shown."""
MOST = 420
"""Characters of a field that are shown."""
KEPT_OF_A_WAYPOINT = ("goal", "status", "message", "pose")


def shown(document: dict[str, Any]) -> dict[str, Any]:
    """The fields of an answer that tell most."""
    kept = {name: document[name] for name in KEPT if document.get(name)}
    if "waypoints" in kept:
        kept["waypoints"] = [
            {name: waypoint[name] for name in KEPT_OF_A_WAYPOINT if waypoint[name]} for waypoint in kept["waypoints"]
        ]
    return kept


async def session(db: str) -> None:
    """Print each call and its answer."""
    command = ["-m", "supermap_cli.main", "mcp", "--db", db]
    async with Client(stdio_client(StdioServerParameters(command=sys.executable, args=command))) as client:
        print("```text")
        for name, arguments in CALLS:
            print(f"> {name} {json.dumps(arguments)}")
            result = await client.call_tool(name, arguments)
            if result.is_error:
                print(f"error: {result.content[0].text}")  # type: ignore[union-attr]
            elif result.structured_content is None:
                print(f"{result.content[0].type}, {len(result.content[0].data)} characters of base64")  # type: ignore[union-attr]
            else:
                for field, value in shown(result.structured_content).items():
                    text = json.dumps(value, ensure_ascii=False)
                    print(f"{field}: {text if len(text) <= MOST else text[:MOST] + ' ...'}")
            print()
        print("```")


def main() -> None:
    """Write the session with the map of the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("db")
    anyio.run(session, parser.parse_args().db)


if __name__ == "__main__":
    main()
