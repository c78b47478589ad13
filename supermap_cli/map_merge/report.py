"""The result of a merge as `supermap db merge --json` prints it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.map_merge.merge import MergeSummary


@dataclass(frozen=True)
class MergedTraversal:
    """A traversal's name in the other map and here."""

    other_name: str
    name: str


@dataclass(frozen=True)
class MergeCandidate:
    """An object of this map that another map's object may be, with its probability."""

    id: str
    probability: float


@dataclass(frozen=True)
class MergedObject:
    """An object of the other map and its id here, which is empty for a new object of a dry run. `how`: `MatchKind`."""

    other_id: str
    id: str
    label: str
    how: str
    distance_m: float | None
    part_of: str | None
    candidates: tuple[MergeCandidate, ...]


@dataclass(frozen=True)
class MergeReport:
    """The document. `T_map_other` registers the other map, whose times are `clock_shift_ns` later here; `gone` are the
    objects that the other map saw to be gone.
    """

    into: str
    other: str
    written: bool
    placed: str
    T_map_other: tuple[tuple[float, ...], ...]
    clock_shift_ns: int
    traversals: tuple[MergedTraversal, ...]
    objects: tuple[MergedObject, ...]
    gone: tuple[str, ...]
    warnings: tuple[str, ...]


def report_of(summary: MergeSummary, into: str, other: str, ids: Mapping[int, str]) -> MergeReport:
    """The report; `ids` are the text ids here, by number, after the merge."""
    moved = {match.number for match in summary.matches if match.kind != "new"}
    gone = [
        change.from_number for change in summary.changes if change.kind == "disappeared" and change.from_number in ids
    ]
    return MergeReport(
        into=into,
        other=other,
        written=summary.written,
        placed=summary.placement.method,
        T_map_other=_rows(summary.placement.T_map_odom),
        clock_shift_ns=summary.time.shift_ns,
        traversals=tuple(MergedTraversal(*name) for name in summary.names),
        objects=tuple(
            MergedObject(
                summary.other_ids[match.other],
                ids.get(match.number, ""),
                summary.labels[match.other],
                match.kind,
                None if match.distance_m is None else round(match.distance_m, 4),
                None if match.into is None else ids[match.into],
                tuple(MergeCandidate(ids[number], round(p, 4)) for number, p in match.candidates),
            )
            for match in summary.matches
        ),
        gone=tuple(dict.fromkeys(ids[number] for number in gone if number not in moved and number in summary.ids)),
        warnings=summary.warnings,
    )


def _rows(T: FloatArray) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(round(value, 6) for value in row) for row in T.tolist())
