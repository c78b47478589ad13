"""Random typed questions: all that English can say, as hypothesis strategies."""

from __future__ import annotations

from hypothesis import strategies as st

from supermap_cli.language import questions as tree
from supermap_cli.language import times
from supermap_cli.language.build_things import BuildThings
from supermap_cli.relations.registry import RelationRegistry

from .typed_questions import LABELS

RELATIONS = tuple(RelationRegistry().by_name)
_EVENTS = st.sampled_from(("appeared", "disappeared", "moved", "changed", "returned"))
_COLOURS = st.sampled_from(("black", "white", "grey", "red", "green", "blue", "yellow", "brown", "pink", "purple"))
_DEFAULT = tree.Things(tree.Anything())

# --- Times ---

_NUMBERS = st.sampled_from((1.0, 2.0, 2.5, 10.0, 300.0, 3600.0))
_TRAVERSALS = st.sampled_from(("monday", "tuesday", "first", "previous", "1", "2")).map(times.InTraversal)
_CLOCKS = st.sampled_from(("10:21", "10:21:07", "2026-01-05T10:21:00Z", "12 s", "monday@10:21", "monday+12s"))
_PARTS = st.none() | st.sampled_from(("morning", "afternoon", "evening", "night"))
_DAYS = st.builds(times.OnDay, st.sampled_from(("wednesday", "today", "yesterday", "2026-01-05")), _PARTS)
_NAMED = st.sampled_from(LABELS).map(lambda label: tree.Things(tree.Named(label, label)))
_OCCURRENCES = st.builds(times.AtEvent, _NAMED, _EVENTS)
_MOMENTS = st.one_of(_TRAVERSALS, _CLOCKS.map(times.AtClock), _DAYS, _OCCURRENCES, _NUMBERS.map(times.Ago))
TIMES = st.one_of(
    st.sampled_from((times.Now(), times.Earlier())),
    _MOMENTS,
    _MOMENTS.map(times.Before),
    _MOMENTS.map(times.Since),
    st.builds(times.BetweenTimes, _MOMENTS, _MOMENTS),
    st.builds(times.Within, _NUMBERS, st.booleans()),
)

# --- Noun phrases ---

_COLOURED = _COLOURS.map(tree.Colour)
_SIZED = st.sampled_from(("big", "small", "tall", "low", "wide", "narrow")).map(tree.Size)
_MATERIALS = st.sampled_from(("wood", "metal", "plastic", "leather")).map(tree.MadeOf)
_ATTRIBUTES = st.lists(st.one_of(_COLOURED, _SIZED, _MATERIALS), max_size=2, unique=True).map(tuple)
_USES = st.sampled_from(("sit on", "drink from", "write with")).map(tree.Usable)
_IDS = st.sampled_from(("chair-1", "dining-table-12")).map(tree.Identified)
_NAMES = st.sampled_from(LABELS).map(lambda label: tree.Named(label, label))
_QUANTITIES = st.none() | st.sampled_from(("all", "every", "both", "any", "only"))
_MEASURES = st.sampled_from(("large", "small", "tall", "low", "wide", "narrow", "new", "old", "seen"))
_PLAIN = st.builds(tree.Superlative, _MEASURES, st.integers(1, 5))


def _ranked(references: st.SearchStrategy[tree.Things]) -> st.SearchStrategy[tree.Superlative]:
    distances = st.sampled_from(("near", "far"))
    return st.builds(tree.Superlative, distances, st.integers(1, 5), st.none() | references) | _PLAIN


def _phrases(conditions: st.SearchStrategy[tree.Condition]) -> st.SearchStrategy[tree.Things]:
    nouns = st.one_of(_NAMES, _NAMES, st.just(tree.Anything()))
    described = st.builds(tree.Things, nouns, _ATTRIBUTES, _QUANTITIES, condition=st.none() | conditions)
    counted = st.builds(tree.Things, nouns, number=st.integers(2, 9), condition=st.none() | conditions)
    ranked = st.builds(tree.Things, nouns, _ATTRIBUTES, superlative=_ranked(_NAMED), condition=st.none() | conditions)
    others = st.builds(tree.Things, st.one_of(_USES, _IDS), condition=st.none() | conditions)
    return st.one_of(described, described, counted, ranked, others)


def _conditions(references: st.SearchStrategy[tree.Things]) -> st.SearchStrategy[tree.Condition]:
    viewpoints = st.none() | st.just(tree.Robot()) | references.map(tree.SeenFrom)
    directions = st.sampled_from(("left of", "right of", "in front of", "behind"))
    metres = st.sampled_from((0.5, 1.0, 2.0, 3.25))
    return st.one_of(
        st.builds(tree.Related, st.sampled_from(RELATIONS), references, st.booleans()),
        st.builds(tree.Directed, directions, references, viewpoints),
        st.builds(tree.Between, references, st.none() | references),
        st.builds(tree.Distant, metres, st.booleans(), st.none() | references),
        st.builds(tree.Happened, _EVENTS, st.none() | TIMES),
        st.builds(tree.Having, st.one_of(_COLOURED, _SIZED)),
    )


def _combined(simple: st.SearchStrategy[tree.Condition]) -> st.SearchStrategy[tree.Condition]:
    """and, or, not; an And within an And, and an Or within an Or, are written as one."""
    denied = st.one_of(simple, simple.filter(lambda part: not isinstance(part, tree.Distant)).map(tree.Not))
    either = st.lists(denied, min_size=2, max_size=3).map(lambda parts: tree.Or(tuple(parts)))
    parts = st.one_of(denied, denied, either)
    both = st.lists(parts, min_size=2, max_size=3).map(lambda parts: tree.And(tuple(parts)))
    return st.one_of(denied, denied, denied, both, either)


_REFERENCES = _phrases(_conditions(_NAMED))
CONDITIONS = _combined(_conditions(st.one_of(_NAMED, _NAMED, _REFERENCES)))
THINGS = _phrases(CONDITIONS)
_UNIONS = st.lists(_phrases(_conditions(_NAMED)), min_size=2, max_size=3).map(
    lambda members: BuildThings().union(members)
)
_SOME_THINGS = st.one_of(THINGS, THINGS, THINGS, _UNIONS)
_OBJECTS = st.one_of(_NAMED, _REFERENCES)

# --- Questions ---

_COMPARED = st.sampled_from(("large", "small", "tall", "low", "wide", "narrow", "new", "old"))
_NOT_ANYTHING = THINGS.filter(lambda things: things != _DEFAULT)
_ONE_EVENT = st.sampled_from(((), ("moved",), ("appeared",), ("disappeared",), ("returned",)))


_CERTAIN = _OBJECTS.filter(lambda things: things.quantity != "any" and things != _DEFAULT)


def _find(things: tree.Things, where: str) -> tree.Body:
    return tree.Find(things, place=where == "where")


BODIES = st.one_of(
    st.builds(_find, _SOME_THINGS.filter(lambda things: things.quantity != "any"), st.sampled_from(("", "where"))),
    st.builds(tree.Count, _SOME_THINGS),
    st.builds(tree.Exists, _SOME_THINGS.filter(lambda things: things.quantity not in {"all", "every", "both"})),
    st.builds(tree.Holds, _CERTAIN, CONDITIONS),
    st.builds(tree.Holds, _OBJECTS, still=st.just(value=True)),
    st.builds(tree.MostOf, _NAMED, _OBJECTS, st.sampled_from(RELATIONS), st.booleans()),
    st.builds(tree.CompareCounts, _OBJECTS, _OBJECTS, st.booleans()),
    st.builds(tree.CompareMeasure, _COMPARED, _OBJECTS, _OBJECTS),
    st.builds(tree.CompareMeasure, st.sampled_from(("near", "far")), _OBJECTS, _OBJECTS, _OBJECTS),
    st.builds(tree.HowFar, _OBJECTS, st.none() | _OBJECTS),
    st.builds(tree.Describe, _OBJECTS, st.sampled_from(("colour", "size", "height", "width", "confidence", "all"))),
    st.builds(tree.When, _OBJECTS, _EVENTS, st.sampled_from(("at", "how often"))),
    st.builds(tree.When, _OBJECTS, st.just("seen"), st.sampled_from(("at", "since", "until", "how long", "how often"))),
    st.builds(tree.Changes, _ONE_EVENT, st.none() | _NOT_ANYTHING),
    st.builds(tree.Changes, _ONE_EVENT, st.none() | _NOT_ANYTHING, exists=st.just(value=True)),
    st.builds(tree.Changes, _ONE_EVENT, THINGS, count=st.just(value=True)),
    st.builds(tree.MovedWhere, _OBJECTS, st.sampled_from(("from", "to"))),
)
_PLACES = st.builds(tree.Find, _NAMED, st.just(value=True))
_AT_FIRST = st.builds(tree.Question, st.just(""), _PLACES, st.just(times.First()))
"""Only where a thing is is asked of its own first place; of all others "at first" is the first traversal."""

QUESTIONS = st.builds(tree.Question, st.just(""), BODIES, st.none() | TIMES) | _AT_FIRST
