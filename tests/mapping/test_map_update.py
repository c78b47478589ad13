"""It came, or nobody had looked."""

from __future__ import annotations

from supermap_cli.mapping.engine import MappingEngine
from support import scenes as s


def test_a_thing_where_space_had_been_seen_empty_has_appeared() -> None:
    run = s.Run()
    run.walk(s.ROOM, 4)
    run.walk((*s.ROOM, s.CHAIR), 4)
    delta = run.take()
    (edge,) = delta.temporal_edges
    assert (edge.kind, edge.from_state, edge.to_number, edge.to_state) == ("appeared", None, 1, 0)
    assert (edge.not_before_ns, edge.not_after_ns) == (s.ns(1), s.ns(4 / 3))
    assert delta.states[0].empty_before_ns == s.ns(1)


def test_a_thing_where_nobody_had_looked_has_not() -> None:
    run = s.Run()
    run.walk(s.ROOM, 4, target=(1.6, 4, 0.4))
    run.walk((*s.ROOM, s.CHAIR), 4)
    delta = run.take()
    assert delta.temporal_edges == ()
    assert delta.states[0].empty_before_ns is None


def test_a_thing_that_stood_behind_another_has_not() -> None:
    screen = s.Thing("", (0.9, 0, 0.8), (0.05, 1.6, 1.8))
    run = s.Run()
    run.walk((*s.ROOM, screen), 4)
    run.walk((*s.ROOM, s.CHAIR), 4)
    assert run.take().temporal_edges == ()


def test_a_thing_that_was_there_from_the_first_look_has_not() -> None:
    run = s.Run()
    run.walk((*s.ROOM, s.CHAIR), 8)
    assert run.take().temporal_edges == ()


def test_what_an_earlier_traversal_saw_empty_counts() -> None:
    monday = s.Run()
    monday.walk(s.ROOM, 4)
    tuesday = s.Run(engine=MappingEngine(free_space=monday.engine.free_space), traversal=2, at_s=86_400)
    tuesday.walk((*s.ROOM, s.CHAIR), 4)
    (edge,) = tuesday.take().temporal_edges
    assert edge.kind == "appeared"
    assert edge.not_before_ns == s.ns(1)
