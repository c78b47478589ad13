"""Whether a failure is the map's own: a map that others made or damaged may hold anything."""

from __future__ import annotations

from supermap_cli.errors import STUMBLES, MemoryStoreError, SupermapError
from supermap_cli.memory.checking import check
from supermap_cli.memory.databases import database_of
from supermap_cli.memory.opening import OPENED, open_store
from supermap_cli.memory.stored_values import damaged


def damage_of_opened_maps() -> MemoryStoreError | None:
    """The error for the first map opened by this process that breaks its own invariants; `None` if all are sound."""
    for url in OPENED:
        try:
            if database_of(url).stored_version() is None:
                continue
            with open_store(url, read_only=True) as store, store.reader() as reader:
                problems = check(reader)
        except SupermapError as error:
            return MemoryStoreError(error.what, where=error.where, cure=error.cure)
        except STUMBLES as error:
            return damaged(f"it cannot be checked: {error}", url)
        if problems:
            first = problems[0]
            return MemoryStoreError(
                f"the map is damaged: {first.table} {first.row} {first.what}",
                where=store.where,
                cure="see `supermap db check`; `supermap db recover --out NEW.db` saves what can be saved",
            )
    return None
