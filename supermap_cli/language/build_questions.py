"""Questions: the values of the grammars' rules for whole sentences."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, cast, get_args

from supermap_cli.language import questions as tree
from supermap_cli.language import times
from supermap_cli.language.build_happenings import ANYTHING, Asked, BuildHappenings
from supermap_cli.language.build_things import (
    TIMES,
    condition_of,
    related_to,
    to_reference,
    with_condition,
)
from supermap_cli.language.build_times import AtStart
from supermap_cli.language.forest import NoReading, Word
from supermap_cli.language.parts import Comparative, maybe, of_type, only, words
from supermap_cli.language.refusals import RefusalKind

BODIES = get_args(tree.Body)


@dataclass(frozen=True)
class Refused:
    """A sentence that is understood, and cannot be answered from any map; `part` is the word that says so."""

    kind: RefusalKind
    part: str | None = None


@dataclass(frozen=True)
class Alternatives:
    """The two things after a comparison."""

    first: tree.Things
    second: tree.Things


class BuildQuestions(BuildHappenings):
    """Functions named like rules and aliases of the grammars; each takes the values of the rule's parts."""

    def __getattr__(self, name: str) -> Callable[[list[Any]], Any]:
        """An alias that ends in "_at" is that without the ending, with a time in the midst of its parts."""
        alias = name.removesuffix("_at")
        if alias == name or not hasattr(type(self), alias):
            raise AttributeError(name)
        return lambda parts: _timed_inside(getattr(self, alias), parts)

    # --- Sentences ---

    def start(self, parts: list[Any]) -> Asked | Refused:
        return cast("Asked | Refused", _only_value(parts))

    def untimed(self, parts: list[Any]) -> Asked:
        return self.timed(parts)

    def timed(self, parts: list[Any]) -> Asked:
        body = next(part for part in parts if isinstance(part, (*BODIES, Asked)))
        found = [part for part in parts if isinstance(part, TIMES)]
        if isinstance(body, Asked):
            if body.time is not None and not (body.implied and found):
                found = [body.time, *found]
            body = body.body
        if len(found) > 1:
            raise NoReading
        time = _started(found[0], body) if found and isinstance(found[0], AtStart) else found[0] if found else None
        return Asked(cast("tree.Body", body), cast("times.Time | None", time))

    timed_front = timed

    def no_question(self, _parts: list[Any]) -> Refused:
        return Refused("no question about the place")

    def refers_back(self, parts: list[Any]) -> Refused:
        return Refused("not understood", words(parts, "REFERRING")[0].written)

    def unknowable(self, parts: list[Any]) -> Refused:
        told = words(parts, "STATE", "UNKNOWABLE", "UNKNOWABLE_MEASURE", "UNKNOWABLE_ASPECT")
        return Refused("unknowable", told[0].written if told else None)

    # --- Finding, counting ---

    def find_place(self, parts: list[Any]) -> tree.Find:
        return tree.Find(only(parts, tree.Things), place=True)

    def find_place_so(self, parts: list[Any]) -> tree.Find:
        return tree.Find(with_condition(only(parts, tree.Things), condition_of(parts)), place=True)

    def find_without(self, parts: list[Any]) -> tree.Find:
        condition = condition_of(parts)
        if condition is None:
            raise NoReading
        return tree.Find(with_condition(only(parts, tree.Things), tree.Not(condition)))

    def find_seen(self, parts: list[Any]) -> Asked:
        sight = [part for part in parts if isinstance(part, (times.First, times.Last))]
        body = tree.Find(only(parts, tree.Things), place=True)
        return Asked(body, sight[0] if sight else times.Last(), implied=not sight)

    def find_sighted(self, parts: list[Any]) -> Asked:
        last = bool(of_type(parts, times.Last))
        measure: tree.Measure = "seen" if last else "old"
        things = maybe(parts, tree.Things) or ANYTHING
        if things.superlative is not None:
            raise NoReading
        sight = times.Last() if last else times.First()
        return Asked(tree.Find(replace(things, superlative=tree.Superlative(measure))), sight)

    def find_earlier(self, parts: list[Any]) -> Asked:
        return Asked(self.find_what(parts), times.Earlier(), implied=True)

    def find_place_earlier(self, parts: list[Any]) -> Asked:
        return Asked(self.find_place(parts), times.Earlier(), implied=True)

    def find_compared(self, parts: list[Any]) -> tree.Find:
        things, measure = only(parts, tree.Things), _compared(parts)
        if things.superlative is not None or measure in {"near", "far"}:
            raise NoReading
        return tree.Find(replace(things, superlative=tree.Superlative(measure)))

    def which_sight(self, parts: list[Any]) -> times.First | times.Last:
        return times.First() if only(parts, Word).kind == "FIRST_TIME" else times.Last()

    def find_use(self, parts: list[Any]) -> tree.Find:
        return tree.Find(_usable(parts), place=True)

    def find_which_use(self, parts: list[Any]) -> tree.Find:
        return tree.Find(_usable(parts))

    def find_what(self, parts: list[Any]) -> tree.Find:
        superlative = maybe(parts, tree.Superlative)
        things = replace(ANYTHING, superlative=superlative)
        return tree.Find(with_condition(things, condition_of(parts)))

    def find_all(self, _parts: list[Any]) -> tree.Find:
        return tree.Find(ANYTHING)

    def find_who(self, parts: list[Any]) -> tree.Find:
        return tree.Find(with_condition(_person(), condition_of(parts)))

    def find_support(self, parts: list[Any]) -> tree.Find:
        return tree.Find(with_condition(ANYTHING, _carrying(parts, only(parts, tree.Things))))

    find_support_front = find_support

    def find_upon(self, parts: list[Any]) -> tree.Find:
        return tree.Find(with_condition(ANYTHING, related_to(parts, only(parts, tree.Things))))

    def find_which_support(self, parts: list[Any]) -> tree.Find:
        things, carried = of_type(parts, tree.Things)
        return tree.Find(with_condition(things, _carrying(parts, carried)))

    find_which_support_front = find_which_support

    def find_which_support_last(self, parts: list[Any]) -> tree.Find:
        carried, things = of_type(parts, tree.Things)
        return tree.Find(with_condition(things, _carrying(parts, carried)))

    def find_which(self, parts: list[Any]) -> tree.Find:
        things = only(parts, tree.Things)
        superlative = maybe(parts, tree.Superlative)
        if superlative is not None:
            if things.superlative is not None:
                raise NoReading
            things = replace(things, superlative=superlative)
        return tree.Find(with_condition(things, condition_of(parts)))

    def find_things(self, parts: list[Any]) -> tree.Find:
        return tree.Find(only(parts, tree.Things))

    def find_fragment(self, parts: list[Any]) -> tree.Find | tree.Exists:
        things = only(parts, tree.Things)
        return tree.Exists(things) if things.quantity == "any" else tree.Find(things)

    def find_identity(self, parts: list[Any]) -> tree.Find | tree.Describe:
        things = only(parts, tree.Things)
        if isinstance(things.noun, tree.Identified):
            return tree.Describe(things, "all")
        if things.superlative is None and things.condition is None:
            raise NoReading
        return tree.Find(things)

    def count(self, parts: list[Any]) -> tree.Count:
        return tree.Count(only(parts, tree.Things))

    def count_so(self, parts: list[Any]) -> tree.Count:
        return tree.Count(with_condition(only(parts, tree.Things), condition_of(parts)))

    def count_without(self, parts: list[Any]) -> tree.Count:
        return tree.Count(self.find_without(parts).things)

    def count_except(self, parts: list[Any]) -> tree.Count:
        things, excepted = of_type(parts, tree.Things)
        return tree.Count(with_condition(things, condition_of(parts), tree.Except(excepted)))

    # --- Yes or no ---

    def exists(self, parts: list[Any]) -> tree.Exists | tree.Holds:
        things = only(parts, tree.Things)
        if things.quantity in {"all", "every"} and things.condition is None:
            return tree.Holds(things, still=True)
        return tree.Exists(things)

    def sees_nobody(self, parts: list[Any]) -> tree.Exists:
        return tree.Exists(self.no_person(parts))

    def exists_any(self, parts: list[Any]) -> tree.Exists:
        return tree.Exists(replace(only(parts, tree.Things), quantity="any"))

    def exists_so(self, parts: list[Any]) -> tree.Exists:
        return tree.Exists(with_condition(only(parts, tree.Things), condition_of(parts)))

    def exists_use(self, parts: list[Any]) -> tree.Exists:
        return tree.Exists(_usable(parts))

    def holds(self, parts: list[Any]) -> tree.Holds | tree.Exists:
        condition = condition_of(parts)
        if condition is None:
            raise NoReading
        things = only(parts, tree.Things)
        if _is_second_clause(condition) or _names_two(things.condition):
            raise NoReading
        if things.quantity == "any" or things.number is not None or things == ANYTHING or _is_anybody(things):
            return tree.Exists(with_condition(things, condition))
        return tree.Holds(things, condition)

    def holds_carrying(self, parts: list[Any]) -> tree.Holds | tree.Exists:
        things, condition = only(parts, tree.Things), condition_of(parts)
        if not isinstance(things.noun, tree.Anything):
            return self.holds(parts)
        if not (isinstance(condition, tree.Or) and isinstance(condition.conditions[0], tree.Related)):
            raise NoReading
        return tree.Exists(condition.conditions[0].reference)  # "does the place have a fridge"

    def holds_still(self, parts: list[Any]) -> tree.Holds:
        return tree.Holds(only(parts, tree.Things), still=True)

    holds_still_ = holds_still

    def holds_mutually(self, parts: list[Any]) -> tree.Holds:
        first, second = of_type(parts, tree.Things)
        return tree.Holds(first, tree.Related(str(words(parts, "RELATION")[0].value), second))

    def holds_there(self, parts: list[Any]) -> tree.Exists | tree.Holds:
        return self.exists(parts)

    still_or_left = holds_there

    def still_so(self, parts: list[Any]) -> tree.Holds | tree.Exists:
        return self.holds(parts)

    # --- Comparing, measuring, describing ---

    def most_of(self, parts: list[Any]) -> tree.MostOf:
        things, counted = of_type(parts, tree.Things)
        relation = words(parts, "RELATION")
        return tree.MostOf(
            things,
            counted,
            str(relation[0].value).partition("|")[0] if relation else "on",
            bool(words(parts, "FEWEST")),
        )

    def most_of_front(self, parts: list[Any]) -> tree.MostOf:
        return self.most_of(parts)

    def compare_counts(self, parts: list[Any]) -> tree.CompareCounts:
        first, second = self._two(parts)
        return tree.CompareCounts(first, second, bool(words(parts, "LESS")))

    def compare_equal(self, parts: list[Any]) -> tree.CompareCounts:
        first, second = self._two(parts)
        return tree.CompareCounts(first, second, equal=True)

    def compare_measure(self, parts: list[Any]) -> tree.CompareMeasure:
        first, second = self._two(parts)
        return tree.CompareMeasure(_compared(parts), first, second)

    compare_alternatives = compare_alternatives_last = compare_measure

    def compare_measure_to(self, parts: list[Any]) -> tree.CompareMeasure:
        first, reference, second = of_type(parts, tree.Things)
        return tree.CompareMeasure(_compared(parts), first, second, to_reference(reference))

    def compare_named_to(self, parts: list[Any]) -> tree.CompareMeasure:
        _, reference = of_type(parts, tree.Things)
        either = only(parts, Alternatives)
        return tree.CompareMeasure(_compared(parts), either.first, either.second, to_reference(reference))

    def compare_named(self, parts: list[Any]) -> tree.CompareMeasure:
        either = only(parts, Alternatives)
        return tree.CompareMeasure(_compared(parts), either.first, either.second)

    def compare_references(self, parts: list[Any]) -> tree.CompareMeasure:
        things, first, second = of_type(parts, tree.Things)
        measure = _compared(parts)
        if measure not in {"near", "far"}:
            raise NoReading
        return tree.CompareMeasure(measure, first, second, to_reference(things))

    def compare_alternatives_to(self, parts: list[Any]) -> tree.CompareMeasure:
        either = only(parts, Alternatives)
        reference = to_reference(only(parts, tree.Things))
        return tree.CompareMeasure(_compared(parts), either.first, either.second, reference)

    def alternatives(self, parts: list[Any]) -> Alternatives:
        return Alternatives(*of_type(parts, tree.Things))

    def _two(self, parts: list[Any]) -> tuple[tree.Things, tree.Things]:
        either = maybe(parts, Alternatives)
        if either is not None:
            return either.first, either.second
        first, second = of_type(parts, tree.Things)
        return first, second

    def how_far(self, parts: list[Any]) -> tree.HowFar:
        found = [to_reference(things) for things in of_type(parts, tree.Things)]
        named = [things for things in found if things is not None]
        if not named:
            raise NoReading
        return tree.HowFar(named[0], named[1] if len(named) > 1 else None)

    def describe(self, parts: list[Any]) -> tree.Describe:
        return tree.Describe(only(parts, tree.Things), cast("Any", only(parts, Aspect).what))

    def describe_sure(self, parts: list[Any]) -> tree.Describe:
        return tree.Describe(only(parts, tree.Things), "confidence")

    def describe_all(self, parts: list[Any]) -> tree.Describe:
        return tree.Describe(only(parts, tree.Things), "all")

    def describe_long(self, parts: list[Any]) -> tree.Describe:
        return tree.Describe(only(parts, tree.Things), "width")

    def aspect(self, parts: list[Any]) -> Aspect:
        names = {"COLOUR_": "colour", "SIZE_": "size", "HEIGHT_": "height", "WIDTH_": "width"}
        return Aspect(names[only(parts, Word).kind])

    def dimension(self, parts: list[Any]) -> Aspect:
        return Aspect({"BIG": "size", "TALL": "height", "WIDE": "width"}[only(parts, Word).kind])


@dataclass(frozen=True)
class Aspect:
    """What is asked of a thing: its colour, its height, ..."""

    what: str


def _timed_inside(build: Callable[[list[Any]], tree.Body | Asked], parts: list[Any]) -> tree.Body | Asked:
    """The value of a rule, asked of the time among its parts, if there is one."""
    found = [part for part in parts if isinstance(part, TIMES)]
    body = build([part for part in parts if not isinstance(part, TIMES)])
    if not found:
        return body
    if len(found) > 1 or not isinstance(body, BODIES):
        raise NoReading
    return Asked(body, cast("times.Time", found[0]))


def _started(start: AtStart, body: Any) -> times.Time:
    """The start of what a question is about: "where was the cup originally" asks for its own first place; whether it
    was there at the start, for the first traversal.
    """
    if isinstance(body, tree.Find) and body.place and body.things.condition is None:
        return times.First()
    return times.InTraversal(start.name)


def _only_value(parts: list[Any]) -> Any:
    values = [part for part in parts if isinstance(part, (Asked, Refused))]
    if len(values) != 1:
        raise NoReading
    return values[0]


def _person() -> tree.Things:
    return tree.Things(tree.Named("person", "who", hypernym=True))


def _is_second_clause(condition: tree.Condition) -> bool:
    """Whether a condition may be two clauses: "is the cup on the table and the book on the desk"."""
    if not isinstance(condition, tree.And):
        return False
    last = condition.conditions[-1]
    return isinstance(last, tree.Related) and last.reference.condition is not None


def _names_two(condition: tree.Condition | None) -> bool:
    """Whether the subject stands in one relation to two things: "the cup on the table and the book" is two clauses."""
    parts = condition.conditions if isinstance(condition, tree.And) else ()
    names = [part.relation for part in parts if isinstance(part, tree.Related)]
    return len(set(names)) < len(names)


def _is_anybody(things: tree.Things) -> bool:
    return isinstance(things.noun, tree.Named) and things.noun.written in {"anybody", "anyone", "somebody", "someone"}


def _usable(parts: list[Any]) -> tree.Things:
    use = str(words(parts, "USE", "USE_VERB")[0].value)
    return with_condition(tree.Things(tree.Usable(use)), condition_of(parts))


def _carrying(parts: list[Any], carried: tree.Things) -> tree.Condition:
    return related_to(parts, carried, inverse=True)


def _compared(parts: list[Any]) -> tree.Measure:
    return cast("tree.Measure", only(parts, Comparative).measure)
