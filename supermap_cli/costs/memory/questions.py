"""Questions to a synthetic memory: every command that reads, and every kind of query."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Literal

from supermap_cli.costs.memory.traversals import SyntheticTraversal

Command = Literal["query", "show", "history", "diff", "db info", "db sql"]
AnswerGrowth = Literal["fixed", "listed", "grows"]
"""How an answer grows with the memory: not at all; it grows, but only its first rows are listed; as a whole."""


@dataclass(frozen=True)
class BenchQuestion:
    """One question: the command with its arguments, the kind of question, and how its answer grows."""

    command: Command
    arguments: tuple[str, ...]
    kind: str
    bound: AnswerGrowth

    @property
    def text(self) -> str:
        """As it is typed."""
        return " ".join((self.command, *self.arguments))


def _queries(bound: AnswerGrowth, **texts: str) -> tuple[BenchQuestion, ...]:
    return tuple(BenchQuestion("query", (text,), kind.replace("_", " "), bound) for kind, text in texts.items())


def questions(planned: Sequence[SyntheticTraversal]) -> tuple[BenchQuestion, ...]:
    """All questions to a memory of these traversals."""
    half, at = len(planned) // 2, _time_of_day(planned[len(planned) // 3])
    return (
        *_about_few(at, planned[0]),
        *_about_many(at, planned[half]),
        *_commands(at, planned[half], planned[half + 1]),
    )


def _about_few(at: str, short: SyntheticTraversal) -> tuple[BenchQuestion, ...]:
    return (
        *_queries(
            "fixed",
            label="piano",
            id="piano-1",
            count="how many pianos",
            existence="is there a piano",
            near="chair near the piano",
            beside="cabinet next to the piano",
            on="globe on the desk",
            under="desk under the globe",
            above="globe above the desk",
            inside="everything inside the aquarium",
            attached="chair attached to the piano",
            chain="chair near a desk near the piano",
            anything="everything near the piano",
            last="piano last",
            first="piano first",
            earlier="piano earlier",
            at_a_time=f"piano at {at}",
            in_a_traversal=f"chairs in {short.name}",
            relation_earlier="chair near the piano earlier",
            no_such_label="trumpet",
            too_far="piano on the globe",
            not_so="piano on the desk",
        ),
    )


def _about_many(at: str, long: SyntheticTraversal) -> tuple[BenchQuestion, ...]:
    return (
        *_queries(
            "listed",
            common_label="chair",
            common_count="how many chairs",
            similar_label="stool",
            everything="everything",
            common_near="chair near the desk",
            common_on="cup on the desk",
            common_earlier="chairs earlier",
            common_at_a_time=f"chairs at {at}",
            in_a_long_traversal=f"chairs in {long.name}",
        ),
        *_queries(
            "grows",
            common_relation_counted="how many cups on desks",
            common_counted_at_a_time=f"how many chairs at {at}",
            common_not_so="chair on the desk",
        ),
    )


def _commands(at: str, one: SyntheticTraversal, other: SyntheticTraversal) -> tuple[BenchQuestion, ...]:
    return (
        BenchQuestion("show", ("piano-1",), "one object", "fixed"),
        BenchQuestion("show", ("piano-1", "--at", at), "one object as of a time", "fixed"),
        BenchQuestion("show", (), "all objects", "listed"),
        BenchQuestion("show", ("--at", at), "all objects as of a time", "grows"),
        BenchQuestion("history", ("piano-1",), "one object's life", "fixed"),
        BenchQuestion("diff", (), "two newest, of six rooms each", "fixed"),
        BenchQuestion("diff", ("day-001", "day-002"), "two old ones, of six rooms each", "fixed"),
        BenchQuestion("diff", (one.name, other.name), "two of an eighth of the building each", "grows"),
        BenchQuestion("db info", (), "counts", "listed"),
        BenchQuestion("db sql", ("SELECT * FROM current_objects WHERE label = 'piano'",), "view by label", "fixed"),
        BenchQuestion("db sql", ("SELECT * FROM object_history WHERE id = 'piano-1'",), "view by id", "fixed"),
        BenchQuestion(
            "db sql", ("SELECT * FROM changes ORDER BY not_after_ns DESC LIMIT 20",), "newest changes", "fixed"
        ),
        BenchQuestion(
            "db sql", ("SELECT * FROM trajectory WHERE traversal = 'day-001'",), "one traversal's way", "fixed"
        ),
    )


def _time_of_day(traversal: SyntheticTraversal) -> str:
    """An hour after a traversal's start, as queries write times."""
    return f"{datetime.fromtimestamp(traversal.start_ns // 10**9 + 3600, UTC):%Y-%m-%dT%H:%M:%SZ}"
