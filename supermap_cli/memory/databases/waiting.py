"""How long a writer waits while another program holds the database's write lock."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from supermap_cli.errors import MemoryStoreError

DEFAULT_WAIT_S = 30.0
"""Seconds; longer than a backup of a map takes, shorter than people wait for a sign of life. Chosen."""

ATTEMPT_S = 1.0
"""Seconds of one attempt; after the first one the user is told what is being waited for."""


def _nothing(message: str) -> None:
    """Nobody is told."""


@dataclass(frozen=True)
class Waiting:
    """Wait for so many seconds; `tell` is called once, with one line, when there is something to wait for."""

    limit_s: float = DEFAULT_WAIT_S
    tell: Callable[[str], None] = _nothing

    def tell_about(self, where: str) -> None:
        """Say that another program writes to a map, and how long that is waited for."""
        self.tell(f"another program writes to {where}: waiting up to {self.limit_s:g} s for it")


def another_program_writes(where: str) -> MemoryStoreError:
    """The error when the waiting is over."""
    return MemoryStoreError(
        "another program writes to the map database",
        where=where,
        cure="end its change (a browser's, a backup's) and repeat the command; --wait SECONDS waits longer",
    )
