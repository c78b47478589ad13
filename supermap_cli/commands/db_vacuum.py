"""`supermap db vacuum`."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Annotated

import typer

from supermap_cli.commands.common import DbOption, JsonOption, WaitOption, database_url, err, out, print_json, waiting

if TYPE_CHECKING:
    from supermap_cli.memory.pruning import Progress, PruneCounts, PrunePolicy
    from supermap_cli.query.clock import Clock

EXAMPLES = """
Examples:

    supermap db vacuum

    supermap db vacuum --keep crops=30d --keep observations=180d --dry-run

    supermap db vacuum --keep thumbnails="2 traversals" --keep crops=none
"""


def vacuum(
    db: DbOption = None,
    keep: Annotated[
        list[str] | None,
        typer.Option(
            metavar="KIND=HOW_LONG",
            help="Of crops, observations or thumbnails keep only these; may be repeated.",
            show_default=False,
        ),
    ] = None,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Only say what would go, and how much that is.")] = False,
    wait: WaitOption = 30.0,
    json: JsonOption = False,
) -> None:
    """Make the database smaller: give up what is old, if asked to, and give the room back.

    HOW_LONG is an age (30d; units s, min, h, d, w, y) counted back from the newest time in the map, "3 traversals", a
    traversal or time from which on all is kept, or none. States, edges, visits, poses and shapes always stay; so do of
    every state its first and last observation, the best one of each traversal, and, unless crops=none, its best crop.
    """
    from supermap_cli.memory import open_store  # noqa: PLC0415 - keeps start-up light
    from supermap_cli.query.clock import clock_of  # noqa: PLC0415
    from supermap_cli.query.retention_policy import parse_retention_policy  # noqa: PLC0415
    from supermap_cli.query.views import to_document  # noqa: PLC0415

    with open_store(database_url(db), read_only=dry_run, waiting=waiting(wait)) as store:
        with store.reader() as reader:
            policy, clock, before = parse_retention_policy(keep or (), reader), clock_of(reader), reader.size_bytes()
        with _progress_bar() as progress:
            pruned = store.prune(policy, progress, dry_run=dry_run)
        if not dry_run:
            store.vacuum()
        with store.reader() as reader:
            after = reader.size_bytes()
    if json:
        print_json(
            {
                "path": store.where,
                "dry_run": dry_run,
                "kept_from": to_document(policy),
                "given_up": to_document(pruned),
                "size_before_bytes": before,
                "size_after_bytes": after,
            }
        )
        return
    _print(policy, pruned, clock, dry_run=dry_run)
    if not dry_run:
        out().print(f"{store.where}: {before / 1e6:.1f} MB before, {after / 1e6:.1f} MB now", markup=False)


def _print(policy: PrunePolicy, pruned: PruneCounts, clock: Clock, *, dry_run: bool) -> None:
    console = out()
    verb = "would go" if dry_run else "went"
    for kind, limit_ns in (
        ("observations", policy.observations_ns),
        ("crops", policy.crops_ns),
        ("thumbnails", policy.thumbnails_ns),
    ):
        if limit_ns is not None:
            count = getattr(pruned, kind)
            console.print(f"{count} {kind} from before {clock.text(limit_ns)} {verb}", markup=False)
    if pruned.size_bytes or dry_run:
        console.print(f"about {pruned.size_bytes / 1e6:.1f} MB", markup=False)


@contextmanager
def _progress_bar() -> Iterator[Progress]:
    """A bar over the instances, on stderr."""
    from rich.progress import Progress as Bar  # noqa: PLC0415 - keeps start-up light

    console = err()
    with Bar(console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("instances")
        yield lambda done, total: bar.update(task, completed=done, total=total)
