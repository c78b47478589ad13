"""Measures what calls of the tools of `supermap mcp` take, over stdio by the SDK's own client: p50 and p95.

    python tools/measure_agent_tools.py MAP.db [--calls 30] [--tools query,show]

Each tool is called once before it is timed. Ids and labels are drawn from the map. The table in docs/agents.md is of a
map that `supermap bench memory` made: 100,000 objects.
"""

from __future__ import annotations

import argparse
import random
import sys
import time
from collections.abc import Callable
from typing import Any

import anyio
import numpy as np
from mcp.client.client import Client
from mcp.client.stdio import StdioServerParameters, stdio_client

from supermap_cli.memory_api import Memory

Arguments = Callable[[], dict[str, Any]]


def calls_of(db: str, rng: random.Random) -> dict[str, Arguments]:
    """Tool -> the arguments of a call, drawn anew for each."""
    with Memory(db) as memory:
        overview = memory.overview(limit=2000)
        ids = [instance.id for instance in overview.instances]
        labels = sorted(overview.counts)
        traversals = [traversal.name for traversal in memory.traversals()]
    late = traversals[-5:]

    def typed() -> dict[str, Any]:
        things = {"kind": "Things", "noun": {"kind": "Named", "name": rng.choice(labels)}}
        return {"question": {"body": {"kind": "Count", "things": things}}}

    return {
        "query": lambda: {"question": f"{rng.choice(labels)} near the {rng.choice(labels)}"},
        "ask_typed": typed,
        "list_objects": dict,
        "show": lambda: {"id": rng.choice(ids)},
        "history": lambda: {"id": rng.choice(ids)},
        "relations_around": lambda: {"id": rng.choice(ids)},
        "changes_since": lambda: {"since": rng.choice(late[:-1])},
        "diff": dict,
        "places_not_seen_since": lambda: {"since": rng.choice(late)},
        "navigate": lambda: {"instruction": f"go to {rng.choice(ids)}"},
        "goal_near": lambda: {"x": 0.0, "y": 0.0},
        "crop": lambda: {"id": rng.choice(ids)},
    }


async def measure(db: str, calls: int, tools: set[str]) -> None:
    """Print a line for each tool."""
    command = ["-m", "supermap_cli.main", "mcp", "--db", db]
    async with Client(stdio_client(StdioServerParameters(command=sys.executable, args=command))) as client:
        for name, arguments in calls_of(db, random.Random(1)).items():  # noqa: S311 - draws examples
            if tools and name not in tools:
                continue
            took_ms, errors, said = [], 0, ""
            for number in range(calls + 1):
                given = arguments()
                began = time.perf_counter()
                result = await client.call_tool(name, given)
                if number:
                    took_ms.append(1000 * (time.perf_counter() - began))
                errors += bool(result.is_error)
                said = str(getattr(result.content[0], "text", ""))[:90] if result.is_error else said
            p50, p95 = np.percentile(took_ms, [50, 95])
            print(f"| {name} | {p50:.0f} | {p95:.0f} |" + (f" {errors} errors: {said}" if errors else ""), flush=True)


def main() -> None:
    """Measure the map of the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("db")
    parser.add_argument("--calls", type=int, default=30)
    parser.add_argument("--tools", default="", help="only these, by their names [default: all]")
    given = parser.parse_args()
    anyio.run(measure, given.db, given.calls, set(filter(None, given.tools.split(","))))


if __name__ == "__main__":
    main()
