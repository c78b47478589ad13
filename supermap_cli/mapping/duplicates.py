"""Two objects of the map that are one: found by their clouds and labels, and merged.

Part of MapMerge (Algorithm 1, step 5), whose criteria the paper leaves open.
"""

from __future__ import annotations

from dataclasses import dataclass

from supermap_cli.mapping.objects import MapObject, ObjectMap
from supermap_cli.types.parameters import TUNED, parameter


@dataclass(frozen=True)
class DuplicatesParameters:
    """How much of two clouds must lie on one another."""

    gap_m: float = parameter(0.3, "m", "gap between the bounds of two objects that may be one", TUNED)
    same_label: float = parameter(
        0.3, "1", "agreement of labels above which two objects are called the same", TUNED, at_most=1.0
    )
    same_label_share: float = parameter(
        0.5, "1", "called the same: share of either that must lie on the other", TUNED, at_most=1.0
    )
    seen_apart_share: float = parameter(
        0.85, "1", "the same share, if images have shown the two side by side", TUNED, at_most=1.0
    )
    min_other_label_share: float = parameter(
        0.7, "1", "called otherwise: share of both that must lie on the other", TUNED, at_most=1.0
    )
    other_label_share: float = parameter(
        0.8, "1", "called otherwise: share of either that must lie on the other", TUNED, at_most=1.0
    )


DEFAULT = DuplicatesParameters()


def same_object(
    first: MapObject, second: MapObject, *, seen_apart: bool, parameters: DuplicatesParameters = DEFAULT
) -> bool:
    """Whether two objects of the map are one.

    One label and one lying largely within the other is enough, unless images have shown them side by side; two labels
    need clouds that cover one another.
    """
    p, q = first.labels.probabilities(), second.labels.probabilities()
    agreement = sum(p[label] * q.get(label, 0.0) for label in p)
    forth = second.shape.share_near(first.shape.points)
    if agreement > parameters.same_label:
        enough = parameters.seen_apart_share if seen_apart else parameters.same_label_share
        return forth > enough or first.shape.share_near(second.shape.points) > enough
    if forth <= parameters.min_other_label_share:
        return False
    back = first.shape.share_near(second.shape.points)
    both, either = min(forth, back), max(forth, back)
    return both > parameters.min_other_label_share and either > parameters.other_label_share


def older_first(first: MapObject, second: MapObject) -> tuple[MapObject, MapObject]:
    """The pair, the one that keeps its identity first: confirmed before tentative, then the earlier number."""
    if first.confirmed != second.confirmed:
        return (first, second) if first.confirmed else (second, first)
    return (first, second) if first.number < second.number else (second, first)


def near_pairs(
    objects: ObjectMap, numbers: set[int], parameters: DuplicatesParameters = DEFAULT
) -> list[tuple[MapObject, MapObject]]:
    """Pairs of present, still objects whose bounds overlap and of which at least one is among `numbers`."""
    return [
        (first, second)
        for first, second in objects.beside(numbers, parameters.gap_m)
        if first.present and second.present and not first.is_moving and not second.is_moving
    ]


def merge_evidence(kept: MapObject, joined: MapObject) -> None:
    """Add one object's evidence to another that is the same thing."""
    kept.voxels.absorb(joined.voxels, kept.parameters.voxel_map)
    kept.voxels.fit_voxel(kept.parameters.voxel_map)
    kept.labels.absorb(joined.labels)
    kept.existence.absorb(joined.existence)
    kept.first_seen_ns = min(kept.first_seen_ns, joined.first_seen_ns)
    if joined.last_seen_ns > kept.last_seen_ns:
        kept.last_seen_ns = joined.last_seen_ns
        kept.clear_negative_evidence()
        kept.displacement.interrupt()
    if kept.state.index == 0:
        kept.state.first_seen_ns = kept.first_seen_ns
        empty_ns = kept.state.empty_before_ns
        if empty_ns is not None and empty_ns >= kept.first_seen_ns:  # the other one stood there by then
            kept.state.empty_before_ns = joined.state.empty_before_ns
    kept.observations += joined.observations
    kept.pending += joined.pending
    for detector, looks in joined.found_by.items():
        kept.add_look(detector, looks)
    for label, seen in joined.relief.items():
        kept.add_relief(label, seen)
    kept.track_ids = joined.track_ids | kept.track_ids
    kept.voxels_changed()
