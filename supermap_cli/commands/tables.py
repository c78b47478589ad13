"""Tables for people, and the words in their cells."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Literal

from supermap_cli.printable import printable_line

if TYPE_CHECKING:
    from rich.console import Console

    from supermap_cli.query.views import BoxView, EvidenceView, Vector


def print_table(console: Console, title: str, columns: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Print a table under its title, the title alone where there are no rows.

    Columns that end in "#" are aligned to the right. In a pipe the table is as wide as it needs to be.
    """
    from rich import box  # noqa: PLC0415 - keeps start-up light
    from rich.measure import Measurement  # noqa: PLC0415
    from rich.table import Table  # noqa: PLC0415
    from rich.text import Text  # noqa: PLC0415

    if title:
        console.print(title, markup=False)
    table = Table(box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False, show_header=any(columns))
    for column in columns:
        justify: Literal["left", "right"] = "right" if column.endswith("#") else "left"
        table.add_column(column.removesuffix("#"), justify=justify, overflow="fold")
    for row in rows:
        table.add_row(*(Text(printable_line(cell)) for cell in row))
    if not table.row_count:
        return
    if not console.is_terminal:
        console.width = Measurement.get(console, console.options.update(width=10_000), table).maximum
    console.print(table, soft_wrap=False)
    console.print()


def id_text(text_id: str, label: str) -> str:
    """An id, and what its object is called today where that differs: an id never changes, its word is the object's
    first name.
    """
    from supermap_cli.memory.names import label_slug  # noqa: PLC0415 - keeps start-up light

    return text_id if text_id.rpartition("-")[0] == label_slug(label) else f"{text_id}, now {label}"


def position_text(position: Vector) -> str:
    """A place in metres."""
    return " ".join(f"{value:.2f}" for value in position)


def size_text(box: BoxView) -> str:
    """A box's size in metres."""
    return " x ".join(f"{value:.2f}" for value in box.size)


def evidence_text(evidence: EvidenceView) -> str:
    """How many observations something rests on, with the ids of the first three; how many are left, if most were given
    up.
    """
    shown = ", ".join(map(str, evidence.observations[:3]))
    more = ", ..." if evidence.observation_count > 3 else ""
    left = "" if evidence.given_up_before_ns is None else " left"
    return f"{evidence.observation_count}{left} ({shown}{more})" if shown else "none"
