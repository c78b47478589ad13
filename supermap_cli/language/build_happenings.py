"""When something happened, and what changed: the values of those rules of the grammars."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from supermap_cli.language import questions as tree
from supermap_cli.language import times
from supermap_cli.language.build_things import BuildThings, Happening, condition_of, with_condition
from supermap_cli.language.build_times import BuildTimes
from supermap_cli.language.forest import NoReading
from supermap_cli.language.parts import maybe, only, words
from supermap_cli.language.times import Event

ANYTHING = tree.Things(tree.Anything())


@dataclass(frozen=True)
class Asked:
    """The body of a question with its time."""

    body: tree.Body
    time: times.Time | None = None
    implied: bool = False
    """Whether the time is only implied: then one that is named counts instead."""


class BuildHappenings(BuildThings, BuildTimes):
    """Functions named like rules and aliases of the grammars; each takes the values of the rule's parts."""

    def when(self, parts: list[Any]) -> tree.When:
        return tree.When(only(parts, tree.Things), only(parts, Happening).event)

    def when_seen(self, parts: list[Any]) -> tree.When | Asked:
        sight = [part for part in parts if isinstance(part, (times.First, times.Last))]
        body = tree.When(only(parts, tree.Things), "seen")
        return Asked(body, sight[0]) if sight else body

    def when_last(self, parts: list[Any]) -> Asked:
        return Asked(tree.When(only(parts, tree.Things), "seen"), times.Last())

    def when_latest(self, parts: list[Any]) -> Asked:
        return Asked(self.when(parts), times.Last())

    def when_come_by(self, parts: list[Any]) -> tree.When:
        return tree.When(only(parts, tree.Things), "seen")

    def when_sight(self, parts: list[Any]) -> Asked:
        sight = next(part for part in parts if isinstance(part, (times.First, times.Last)))
        return Asked(self.when(parts), sight)

    def when_gone(self, parts: list[Any]) -> tree.When:
        return tree.When(only(parts, tree.Things), "disappeared")

    def when_so(self, parts: list[Any]) -> tree.When:
        return tree.When(with_condition(only(parts, tree.Things), condition_of(parts)), "seen")

    def since_when(self, parts: list[Any]) -> tree.When:
        return replace(self.when_so(parts), what="since")

    def how_long(self, parts: list[Any]) -> tree.When:
        return replace(self.when_so(parts), what="how long")

    def until_when(self, parts: list[Any]) -> tree.When:
        return replace(self.when_so(parts), what="until")

    def how_often(self, parts: list[Any]) -> tree.When:
        return replace(self.when(parts), what="how often")

    def how_often_seen(self, parts: list[Any]) -> tree.When:
        return tree.When(only(parts, tree.Things), "seen", "how often")

    def changes(self, parts: list[Any]) -> tree.Changes:
        condition = condition_of(parts)
        return tree.Changes(_events(parts), None if condition is None else with_condition(ANYTHING, condition))

    def changes_listed(self, parts: list[Any]) -> tree.Changes:
        if isinstance(condition_of(parts), tree.Between):  # the difference between two things is no change
            raise NoReading
        return self.changes(parts)

    def changes_things(self, parts: list[Any]) -> tree.Changes:
        return tree.Changes(_events(parts), only(parts, tree.Things))

    def changes_count(self, parts: list[Any]) -> tree.Changes:
        return tree.Changes(_events(parts), only(parts, tree.Things), count=True)

    def changes_exist(self, parts: list[Any]) -> tree.Changes:
        things = maybe(parts, tree.Things)
        if things is None:
            condition = condition_of(parts)
            things = None if condition is None else with_condition(ANYTHING, condition)
        else:
            things = with_condition(things, condition_of(parts))
        return tree.Changes(_events(parts), None if things == ANYTHING else things, exists=True)

    def changes_between(self, parts: list[Any]) -> Asked:
        return Asked(tree.Changes(()), only(parts, times.BetweenTimes))

    changes_exist_fragment = changes_exist

    def changes_exist_by(self, parts: list[Any]) -> tree.Changes:
        events = _events(parts)
        things = only(parts, tree.Things)
        return tree.Changes(events, None if things == ANYTHING else things, exists=True)

    def came_from(self, parts: list[Any]) -> tree.MovedWhere:
        return tree.MovedWhere(only(parts, tree.Things), "from")

    def went_to(self, parts: list[Any]) -> tree.MovedWhere:
        return tree.MovedWhere(only(parts, tree.Things), "to")


def _events(parts: list[Any]) -> tuple[Event, ...]:
    """The events named; none for "changed", which is any of them."""
    kinds: dict[str, Event] = {"TAKE": "disappeared", "GONE": "disappeared", "PUT_DONE": "appeared"}
    found = [part.event for part in parts if isinstance(part, Happening)]
    found += [kinds[word.kind] for word in words(parts, *kinds)]
    return tuple(event for event in found if event != "changed")
