"""Noun phrases, conditions: the values of those rules of the grammars."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, cast, get_args

from supermap_cli.language import questions as tree
from supermap_cli.language.forest import NoReading, Word
from supermap_cli.language.parts import Comparative, Length, maybe, of_type, only, words
from supermap_cli.language.times import Event, Time

METRES = {"METRE": 1.0, "CENTIMETRE": 0.01, "FOOT": 0.3048, "INCH": 0.0254, "METRE_ALONE": 1.0}
"""Metres of a unit; the international foot and inch."""

_QUANTITIES = {
    "QUANTITY_ALL": "all",
    "QUANTITY_EVERY": "every",
    "QUANTITY_BOTH": "both",
    "QUANTITY_ANY": "any",
    "QUANTITY_ONLY": "only",
    "QUANTITY_NO": "no",
}
_MEASURES: dict[str, tree.Measure] = {
    "NEAREST": "near",
    "FARTHEST": "far",
    "LARGEST": "large",
    "SMALLEST": "small",
    "TALLEST": "tall",
    "LOWEST": "low",
    "WIDEST": "wide",
    "NARROWEST": "narrow",
    "NEWEST": "new",
    "OLDEST": "old",
    "LATEST_SEEN": "seen",
}
_COMPARATIVES: dict[str, tree.Measure] = {
    "NEARER": "near",
    "FARTHER": "far",
    "LARGER": "large",
    "SMALLER": "small",
    "TALLER": "tall",
    "LOWER": "low",
    "WIDER": "wide",
    "NARROWER": "narrow",
    "NEWER": "new",
    "OLDER": "old",
}
_DIRECTIONS: dict[str, tree.Direction] = {
    "LEFT_OF": "left of",
    "RIGHT_OF": "right of",
    "IN_FRONT_OF": "in front of",
    "BEHIND": "behind",
}
_EVENTS: dict[str, Event] = {
    "MOVED": "moved",
    "MOVE": "moved",
    "GONE": "disappeared",
    "GO": "disappeared",
    "LEFT_DONE": "disappeared",
    "NEW": "appeared",
    "COME": "appeared",
    "BACK": "returned",
    "RETURN": "returned",
    "CHANGED": "changed",
    "CHANGE": "changed",
    "SEEN": "seen",
}
PERSONS = frozenset({"person", "human", "man", "woman", "child", "anybody", "anyone", "somebody", "someone"})
"""Names of those who come by."""

CARRYING = ("on", "inside", "attached to", "at")
"""The relations of what a thing has, where none is named: a desk without a monitor has none on it, in it, or at it."""

CONDITIONS = get_args(tree.Condition)
ATTRIBUTES = get_args(tree.Attribute)
NOUNS = get_args(tree.Noun)


@dataclass(frozen=True)
class Happening:
    """What happened, as the words of an event say it."""

    event: Event


def condition_of(parts: Sequence[Any]) -> tree.Condition | None:
    """The one condition among the parts, if any."""
    found = [part for part in parts if isinstance(part, CONDITIONS)]
    if len(found) > 1:
        raise NoReading
    return cast("tree.Condition | None", found[0] if found else None)


def conditions_of(parts: Sequence[Any]) -> tuple[tree.Condition, ...]:
    """All conditions among the parts."""
    return tuple(cast("tree.Condition", part) for part in parts if isinstance(part, CONDITIONS))


def with_condition(things: tree.Things, *more: tree.Condition | None) -> tree.Things:
    """Things that fulfil further conditions."""
    conditions = [part for part in (things.condition, *more) if part is not None]
    flat = [inner for part in conditions for inner in (part.conditions if isinstance(part, tree.And) else (part,))]
    if not flat:
        return things
    return replace(things, condition=flat[0] if len(flat) == 1 else tree.And(tuple(flat)))


class BuildThings:
    """Functions named like rules and aliases of the grammars; each takes the values of the rule's parts."""

    # --- Noun phrases ---

    def phrase(self, parts: list[Any]) -> tree.Things:
        nouns = [part for part in parts if isinstance(part, (*NOUNS, tree.Things))]
        if len(nouns) != 1:
            raise NoReading
        things = nouns[0] if isinstance(nouns[0], tree.Things) else tree.Things(cast("tree.Noun", nouns[0]))
        numbers = words(parts, "NUMBER", "AT_LEAST")
        quantities = words(parts, *_QUANTITIES)
        if len(numbers) > 1 or len(quantities) > 1 or any(word.value != int(word.value) for word in numbers):
            raise NoReading
        superlatives = of_type(parts, tree.Superlative)
        reference = maybe(parts, Reference)
        if len(superlatives) > 1 or (reference is not None and not superlatives):
            raise NoReading
        superlative = superlatives[0] if superlatives else None
        if superlative is not None and reference is not None:
            if superlative.measure not in {"near", "far"} or superlative.to is not None:
                raise NoReading
            superlative = replace(superlative, to=to_reference(reference.things))
        quantity = cast("tree.Quantity | None", _QUANTITIES[quantities[0].kind] if quantities else things.quantity)
        made = replace(
            things,
            attributes=tuple(part for part in parts if isinstance(part, ATTRIBUTES)),
            quantity=quantity,
            number=int(numbers[0].value) if numbers else None,
            superlative=superlative,
        )
        return with_condition(made, *conditions_of(parts))

    def one(self, parts: list[Any]) -> tree.Things:
        return self.phrase([*parts, tree.Anything()])

    def phrase_except(self, parts: list[Any]) -> tree.Things:
        *rest, excepted = parts
        if not isinstance(excepted, tree.Things):
            raise NoReading
        return with_condition(self.phrase(rest), tree.Except(excepted))

    def phrase_except_first(self, parts: list[Any]) -> tree.Things:
        excepted, *rest = parts
        return self.phrase_except([*rest, excepted])

    def phrase_happened(self, parts: list[Any]) -> tree.Things:
        event = only(parts, Happening)
        return with_condition(self.phrase(parts), tree.Happened(event.event))

    def union(self, parts: list[Any]) -> tree.Things:
        members = tuple(of_type(parts, tree.Things))
        if any(isinstance(member.noun, tree.Union) for member in members):
            raise NoReading
        *others, last = members
        if last.condition is not None and all(member.condition is None for member in others):
            return tree.Things(tree.Union((*others, replace(last, condition=None))), condition=last.condition)
        return tree.Things(tree.Union(members))

    def union_of_all(self, parts: list[Any]) -> tree.Things:
        things = self.union(parts)
        members = cast("tree.Union", things.noun).members
        first = replace(members[0], quantity=None if members[0].quantity == "both" else members[0].quantity)
        return replace(things, noun=tree.Union((first, *members[1:]), every=True))

    def nothing(self, _parts: list[Any]) -> None:
        return None

    def passed(self, parts: list[Any]) -> Any:
        values = [part for part in parts if part is not None]
        if len(values) != 1:
            raise NoReading
        return values[0]

    def at_least(self, parts: list[Any]) -> Word:
        return replace(only(parts, Word), kind="AT_LEAST")

    def more_than(self, parts: list[Any]) -> Word:
        word = only(parts, Word)
        return replace(word, kind="AT_LEAST", value=word.value + 1)

    def superlative(self, parts: list[Any]) -> tree.Superlative:
        ordinals = words(parts, "ORDINAL")
        measure = only(parts, Measured).measure
        return tree.Superlative(measure, int(ordinals[0].value) if ordinals else 1)

    def measure(self, parts: list[Any]) -> Measured:
        return Measured(_MEASURES[only(parts, Word).kind])

    def comparative(self, parts: list[Any]) -> Comparative:
        return Comparative(_COMPARATIVES[only(parts, Word).kind])

    def superlative_to(self, parts: list[Any]) -> Reference:
        return Reference(only(parts, tree.Things))

    def ranked_to(self, parts: list[Any]) -> tree.Superlative:
        superlative = only(parts, tree.Superlative)
        if superlative.measure not in {"near", "far"}:
            raise NoReading
        return replace(superlative, to=to_reference(only(parts, tree.Things)))

    def ranked(self, parts: list[Any]) -> tree.Superlative:
        return only(parts, tree.Superlative)

    def attribute(self, parts: list[Any]) -> tree.Attribute:
        part = parts[0]
        if isinstance(part, Word):
            return tree.MadeOf(str(part.value))
        return cast("tree.Attribute", part)

    def colour(self, parts: list[Any]) -> tree.Colour:
        return tree.Colour(cast("Any", only(parts, Word).kind.lower()))

    def size(self, parts: list[Any]) -> tree.Size:
        return tree.Size(cast("Any", only(parts, Word).kind.lower()))

    def named(self, parts: list[Any]) -> tree.Named:
        return cast("tree.Named", only(parts, Word).value)

    def identified(self, parts: list[Any]) -> tree.Identified:
        return cast("tree.Identified", only(parts, Word).value)

    def numbered(self, parts: list[Any]) -> tree.Identified:
        noun, number = words(parts, "NOUN")[0].value, words(parts, "NUMBER")[0]
        if not number.written.isdecimal():
            raise NoReading
        return tree.Identified(f"{noun.name.replace(' ', '-')}-{number.written}")

    def everything(self, _parts: list[Any]) -> tree.Things:
        return tree.Things(tree.Anything(), quantity="all")

    def all_of_them(self, parts: list[Any]) -> tree.Things:
        things = only(parts, tree.Things)
        if things.quantity is not None:
            raise NoReading
        return replace(things, quantity="all")

    def restricted(self, parts: list[Any]) -> tree.Things:
        if any(part is not None and not isinstance(part, (*CONDITIONS, tree.Things)) for part in parts):
            raise NoReading
        return with_condition(only(parts, tree.Things), *conditions_of(parts))

    def nothing_at_all(self, _parts: list[Any]) -> tree.Things:
        return tree.Things(tree.Anything(), quantity="no")

    def anything(self, _parts: list[Any]) -> tree.Anything:
        return tree.Anything()

    def robot(self, _parts: list[Any]) -> tree.Robot:
        return tree.Robot()

    def a_person(self, parts: list[Any]) -> tree.Things:
        return tree.Things(self.a_person_noun(parts))

    def no_person(self, _parts: list[Any]) -> tree.Things:
        return tree.Things(tree.Named("person", "person", hypernym=True), quantity="no")

    def a_person_noun(self, parts: list[Any]) -> tree.Named:
        noun = words(parts, "NOUN")
        if noun:
            if noun[0].value.name not in PERSONS:
                raise NoReading
            return cast("tree.Named", noun[0].value)
        return tree.Named("person", words(parts, "PERSON", "NOUN_PERSON")[0].written, hypernym=True)

    def usable(self, parts: list[Any]) -> tree.Usable:
        return tree.Usable(str(only(parts, Word).value))

    # --- Conditions ---

    def related(self, parts: list[Any]) -> tree.Condition:
        return related_to(parts, only(parts, tree.Things))

    def related_all(self, parts: list[Any]) -> tree.Condition:
        return tree.And(tuple(related_to(parts, things) for things in of_type(parts, tree.Things)))

    def related_either(self, parts: list[Any]) -> tree.Condition:
        things = only(parts, tree.Things)
        return tree.Or(tuple(related_to([word], things) for word in words(parts, "RELATION")))

    def related_any(self, parts: list[Any]) -> tree.Condition:
        return tree.Or(tuple(related_to(parts, things) for things in of_type(parts, tree.Things)))

    def directed(self, parts: list[Any]) -> tree.Condition:
        direction = _DIRECTIONS[only(parts, Word).kind]
        viewpoints = [part for part in parts if isinstance(part, (tree.SeenFrom, Viewing))]
        viewpoint = viewpoints[0] if viewpoints else None
        seen = tree.Robot() if isinstance(viewpoint, Viewing) else viewpoint
        return tree.Directed(direction, only(parts, tree.Things), seen)

    def seen_from(self, parts: list[Any]) -> tree.SeenFrom | Viewing:
        things = only(parts, tree.Things)
        return Viewing() if isinstance(things.noun, tree.Robot) else tree.SeenFrom(things)

    def seen_by_robot(self, _parts: list[Any]) -> Viewing:
        return Viewing()

    def between(self, parts: list[Any]) -> tree.Condition:
        first, *second = of_type(parts, tree.Things)
        return tree.Between(first, second[0] if second else None)

    def within(self, parts: list[Any]) -> tree.Condition:
        return tree.Distant(only(parts, Length).metres, reference=to_reference(maybe(parts, tree.Things)))

    def beyond(self, parts: list[Any]) -> tree.Condition:
        return tree.Distant(only(parts, Length).metres, farther=True, reference=to_reference(maybe(parts, tree.Things)))

    def length(self, parts: list[Any]) -> Length:
        numbers = words(parts, "NUMBER")
        unit = words(parts, *METRES)[0].kind
        return Length(round((float(numbers[0].value) if numbers else 1.0) * METRES[unit], 6))

    def happened(self, parts: list[Any]) -> tree.Condition:
        times = [part for part in parts if isinstance(part, TIMES)]
        return tree.Happened(only(parts, Happening).event, cast("Time | None", times[0] if times else None))

    def not_happened(self, parts: list[Any]) -> tree.Condition:
        return tree.Not(self.happened(parts))

    def seen_so(self, parts: list[Any]) -> tree.Condition:
        return self.happened([Happening("seen"), *parts])

    def event_done(self, parts: list[Any]) -> Happening:
        return Happening(_EVENTS[only(parts, Word).kind.removesuffix("_PAST").removesuffix("_COUNT")])

    event_past = event_base = event_adjective = event_state = event_done

    def negated(self, parts: list[Any]) -> tree.Condition:
        condition = condition_of(parts)
        if condition is None:
            raise NoReading
        if isinstance(condition, tree.Distant):
            return replace(condition, farther=not condition.farther)
        return tree.Not(condition)

    def neither(self, parts: list[Any]) -> tree.Condition:
        return tree.And(tuple(tree.Not(part) for part in conditions_of(parts)))

    def all_of(self, parts: list[Any]) -> tree.Condition:
        found = conditions_of(parts)
        flat = [inner for part in found for inner in (part.conditions if isinstance(part, tree.And) else (part,))]
        return tree.And(tuple(flat))

    def any_of(self, parts: list[Any]) -> tree.Condition:
        return tree.Or(conditions_of(parts))

    def having(self, parts: list[Any]) -> tree.Condition:
        return tree.Having(parts[0])

    def any_attribute(self, parts: list[Any]) -> tree.Condition:
        return tree.Or(tuple(tree.Having(part) for part in parts if isinstance(part, ATTRIBUTES)))

    def not_having(self, parts: list[Any]) -> tree.Condition:
        return tree.Not(tree.Having(parts[0]))

    def having_material(self, parts: list[Any]) -> tree.Condition:
        return tree.Having(tree.MadeOf(str(only(parts, Word).value)))

    def gone_from(self, parts: list[Any]) -> tree.Condition:
        return tree.Related("on", only(parts, tree.Things))

    def inverse(self, parts: list[Any]) -> tree.Condition:
        return related_to(parts, only(parts, tree.Things), inverse=True)

    def carrying(self, parts: list[Any]) -> tree.Condition:
        return cast("tree.Not", self.lacking(parts)).condition

    def carrying_all(self, parts: list[Any]) -> tree.Condition:
        return tree.And(tuple(self.carrying([things]) for things in of_type(parts, tree.Things)))

    def lacking(self, parts: list[Any]) -> tree.Condition:
        things = only(parts, tree.Things)
        if things.quantity not in {None, "any"} or things.superlative is not None:
            raise NoReading
        reference = replace(things, quantity=None)
        return tree.Not(tree.Or(tuple(tree.Related(name, reference, inverse=True) for name in CARRYING)))

    def inverse_all(self, parts: list[Any]) -> tree.Condition:
        return tree.And(tuple(related_to(parts, things, inverse=True) for things in of_type(parts, tree.Things)))

    def inverse_any(self, parts: list[Any]) -> tree.Condition:
        return tree.Or(tuple(related_to(parts, things, inverse=True) for things in of_type(parts, tree.Things)))


@dataclass(frozen=True)
class Measured:
    """What a superlative ranks by."""

    measure: tree.Measure


@dataclass(frozen=True)
class Reference:
    """The reference of a superlative that stands after its noun: "the closest chair to the door"."""

    things: tree.Things


@dataclass(frozen=True)
class Viewing:
    """Seen from where the robot is."""


TIMES = get_args(Time)


def to_reference(things: tree.Things | None) -> tree.Things | None:
    """A reference of distances: `None` for the robot."""
    return None if things is None or isinstance(things.noun, tree.Robot) else things


def related_to(parts: Sequence[Any], things: tree.Things, *, inverse: bool = False) -> tree.Condition:
    """The relation among the parts, to some things; a word that may mean two relations is fulfilled by either.

    "near no table" is not near a table.
    """
    names = str(words(parts, "RELATION")[0].value).split("|")
    reference = replace(things, quantity=None) if things.quantity == "no" else things
    either = tuple(tree.Related(name, reference, inverse) for name in names)
    related = either[0] if len(either) == 1 else tree.Or(either)
    return tree.Not(related) if things.quantity == "no" else related
