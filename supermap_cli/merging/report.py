"""What a merge did, as it leaves the program."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.merging.merge import MergeSummary


@dataclass(frozen=True)
class MergedTraversal:
    """A traversal's name in the other map and here."""

    other_name: str
    name: str


@dataclass(frozen=True)
class MergeCandidate:
    """A thing of the map that an object may be."""

    id: str
    probability: float


@dataclass(frozen=True)
class MergedObject:
    """What an object of the other map is here. `id` is empty where nothing was written and it would be a new one."""

    other_id: str
    id: str
    label: str
    how: str
    distance_m: float | None
    part_of: str | None
    candidates: tuple[MergeCandidate, ...]


@dataclass(frozen=True)
class MergeReport:
    """A merge. `T_map_other` places the other map, whose times are `clock_shift_ns` later here; `gone` are the objects
    that the other map saw to be gone.
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
    """The report; `ids` are the text ids here, by number, as they are now."""
    moved = {each.number for each in summary.joined if each.how != "new"}
    gone = [each.from_number for each in summary.changes if each.kind == "disappeared" and each.from_number in ids]
    return MergeReport(
        into=into,
        other=other,
        written=summary.written,
        placed=summary.placement.method,
        T_map_other=_rows(summary.placement.T_map_odom),
        clock_shift_ns=summary.time.shift_ns,
        traversals=tuple(MergedTraversal(*each) for each in summary.names),
        objects=tuple(
            MergedObject(
                summary.other_ids[each.other],
                ids.get(each.number, ""),
                summary.labels[each.other],
                each.how,
                None if each.distance_m is None else round(each.distance_m, 4),
                None if each.into is None else ids[each.into],
                tuple(MergeCandidate(ids[number], round(p, 4)) for number, p in each.candidates),
            )
            for each in summary.joined
        ),
        gone=tuple(dict.fromkeys(ids[each] for each in gone if each not in moved and each in summary.ids)),
        warnings=summary.warnings,
    )


def _rows(T: FloatArray) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(round(value, 6) for value in row) for row in T.tolist())
