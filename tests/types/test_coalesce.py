"""Several deltas as one: what is written twice counts as written last."""

from __future__ import annotations

from dataclasses import replace

from hypothesis import given
from hypothesis import strategies as st

from supermap_cli.types.memory import MapDelta, SpatialEdge, TemporalEdge, Visit, coalesce
from support import memories as m


@st.composite
def deltas(draw: st.DrawFn) -> MapDelta:
    keys = st.tuples(st.integers(1, 3), st.integers(0, 2))
    rows = draw(st.dictionaries(keys, st.integers(0, 99), max_size=3))
    return MapDelta(
        states=tuple(m.state(number, index, (0, seen)) for (number, index), seen in sorted(rows.items())),
        visits=tuple(Visit(number, seen, seen, 0, None, None) for (number, _), seen in sorted(rows.items())),
        spatial_edges=tuple(
            SpatialEdge(number, "on", index, number, seen or None, 1.0) for (number, index), seen in rows.items()
        ),
        temporal_edges=tuple(
            TemporalEdge("moved", number, index, number, index + 1, None, seen, 1.0)
            for (number, index), seen in rows.items()
        ),
    )


def written(parts: list[MapDelta]) -> dict[object, object]:
    """What a store holds after each part in turn."""
    rows: dict[object, object] = {}
    for part in parts:
        rows |= {("state", row.object_number, row.index): row for row in part.states}
        rows |= {("visit", row.object_number): row for row in part.visits}
        rows |= {("edge", row.subject, row.relation, row.object, row.since_ns): row for row in part.spatial_edges}
    return rows


@given(st.lists(deltas(), max_size=5))
def test_the_store_ends_the_same_written_at_once_or_one_by_one(parts: list[MapDelta]) -> None:
    whole = coalesce(parts)
    assert written([whole]) == written(parts)
    assert whole.temporal_edges == tuple(edge for part in parts for edge in part.temporal_edges)


@given(st.lists(deltas(), max_size=4), st.lists(deltas(), max_size=4))
def test_parts_may_be_coalesced_in_groups(first: list[MapDelta], second: list[MapDelta]) -> None:
    assert coalesce([coalesce(first), coalesce(second)]) == coalesce([*first, *second])


def test_an_instance_that_was_merged_away_comes_last_with_where_it_went() -> None:
    kept, joined = m.instance(2, "chair"), m.instance(1, "chair")
    whole = coalesce([MapDelta(instances=(joined, kept)), MapDelta(instances=(kept, replace(joined, merged_into=2)))])
    assert [(instance.number, instance.merged_into) for instance in whole.instances] == [(2, None), (1, 2)]
