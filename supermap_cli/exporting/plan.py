"""A floor plan of the selected part of a map, as SVG or PNG."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path, PurePath
from typing import cast

from supermap_cli.drawing.map_plan import MapPlan, PlanChange, PlanThing, PlanWay, Standing
from supermap_cli.drawing.observed_floor import observed_floor
from supermap_cli.drawing.plan_picture import CHANGES, plan_picture
from supermap_cli.exporting.selection import ExportSource
from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.memory.values import StoredInstance, StoredTraversal
from supermap_cli.types.memory import StateRecord, TemporalEdge


def write_plan(source: ExportSource, path: Path, image_format: str) -> int:
    """Draw the plan as `svg` or `png`; returns the number of things on it."""
    plan = map_plan(source)
    path.write_bytes(plan_picture(plan, image_format))
    return len(plan.things)


def map_plan(source: ExportSource) -> MapPlan:
    """The floor, the things of the selection, the ways, and the changes of the newest selected traversal.

    What disappeared in it is shown where it stood last, whatever presence is selected.
    """
    things = list(source.with_progress("things", _things(source)))
    newest = max(source.traversals, key=lambda traversal: traversal.number, default=None)
    changes: list[PlanChange] = []
    if newest is not None and newest.number > 1:
        changes, before = _changes_with_places(source, newest, {thing.id for thing in things})
        drawn = {(thing.id, *thing.middle.tolist()) for thing in things}
        things += [thing for thing in before if (thing.id, *thing.middle.tolist()) not in drawn]
    return MapPlan(
        title=_title(source, things),
        things=things,
        ways=[PlanWay(traversal.name, _way(source, traversal)) for traversal in source.traversals],
        changes=changes,
        floor=observed_floor(source.reader, *source.selection.keyframes),
        changes_of=newest.name if newest is not None else "",
    )


def _things(source: ExportSource) -> Iterator[PlanThing]:
    for instance in source.instances():
        for state in instance.states:
            yield _thing(instance.id, instance.label, state, cast("Standing", instance.presence_in(state)))


def _thing(text_id: str, label: str, state: StateRecord, standing: Standing) -> PlanThing:
    return PlanThing(text_id, label, state.box.footprint(), standing, state.box.z_max)


def _changes_with_places(
    source: ExportSource, traversal: StoredTraversal, shown: set[str]
) -> tuple[list[PlanChange], list[PlanThing]]:
    """The changes that a traversal found of the things shown and of those that disappeared; and where these stood."""
    edges = list(_changes_of(source, traversal))
    instances = _instances_of(source, edges)
    until_ns = source.selection.at_ns
    changes, places = [], {}
    for edge in edges:
        instance = instances.get(edge.to_number)
        if instance is None or (instance.id not in shown and edge.kind != "disappeared"):
            continue
        states = {
            state.index: state for state in instance.states if until_ns is None or state.first_seen_ns <= until_ns
        }
        if not states or (edge.kind == "disappeared" and edge.from_state != max(states)):
            continue  # it came back later
        end = states.get(edge.from_state if edge.to_state is None else edge.to_state, states[max(states)])  # type: ignore[arg-type]
        start = states.get(edge.from_state, end) if edge.kind == "moved" else end  # type: ignore[arg-type]
        if edge.kind == "disappeared":
            places[instance.id, end.index] = _thing(instance.id, instance.label, end, "absent")
        elif edge.kind == "moved":
            places[instance.id, start.index] = _thing(instance.id, instance.label, start, "ended")
        changes.append(PlanChange(edge.kind, instance.id, start.box.center[:2], end.box.center[:2]))
    return changes, list(places.values())


def _changes_of(source: ExportSource, traversal: StoredTraversal) -> Iterator[TemporalEdge]:
    """The changes that a traversal found, by the selected time."""
    until_ns = source.selection.at_ns
    for edge in source.reader.temporal_edges_within(traversal.start_ns, traversal.end_ns):
        within = traversal.start_ns <= edge.not_after_ns <= traversal.end_ns
        if within and edge.kind in CHANGES and (until_ns is None or edge.not_after_ns <= until_ns):
            yield edge


def _instances_of(source: ExportSource, edges: Iterable[TemporalEdge]) -> dict[int, StoredInstance]:
    """The instances that edges end at, by the numbers in these; merged ones are their survivor."""
    numbers = {edge.to_number for edge in edges}
    survivors = source.reader.survivors.of(numbers)
    found = source.reader.instances_by_number(set(survivors.values()))
    return {
        number: found[survivor]
        for number, survivor in survivors.items()
        if survivor in found and source.selection.has_label(found[survivor].label)
    }


def _way(source: ExportSource, traversal: StoredTraversal) -> FloatArray:
    stamps_ns, positions = source.reader.trajectory(traversal.id)
    until_ns = source.selection.at_ns
    return positions[:, :2] if until_ns is None else positions[stamps_ns <= until_ns, :2]


def _title(source: ExportSource, things: list[PlanThing]) -> str:
    name = PurePath(source.reader.where).name
    selection = source.selection
    if selection.at is not None:
        when = f"as of {selection.at.text}"
    elif selection.traversal is not None:
        when = f"what {selection.traversal.name} saw"
    else:
        when = f"as known at {source.clock.text(source.reader.now_ns)}" if source.traversals else "empty"
    present = sum(thing.standing == "present" for thing in things)
    labels = f" · {', '.join(sorted(selection.labels))}" if selection.labels else ""
    return f"{name} · {when} · {present} things{labels}"
