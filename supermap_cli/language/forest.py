"""The readings of a sentence: the best values of a parse forest, ranked by the grammar's priorities.

lark's Earley parser gives a shared packed parse forest, which holds all derivations in polynomial space. Every node is
evaluated once, to at most `MOST_READINGS` different values.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from lark.grammar import Rule
from lark.parsers.earley_forest import PackedNode, SymbolNode, TokenNode

from supermap_cli.language.tokens import Lexeme

MOST_READINGS = 4
"""Readings of a part of a sentence that are kept."""


class NoReading(Exception):  # noqa: N818 - it is no error: one of several derivations makes no sense
    """Raised by a function of the builder where the parts do not make a whole."""


@dataclass(frozen=True)
class Word:
    """A terminal as it was matched: its name in the grammar, and its value."""

    kind: str
    value: Any
    written: str


@dataclass(frozen=True)
class Interpretation:
    """A value, its rank (higher is better), and the terminals that it was made of."""

    value: Any
    rank: int
    words: tuple[Word, ...] = ()


Builder = Mapping[Rule, Callable[[list[Any]], Any]]
Parts = tuple[Any, ...]


@dataclass
class Forest:
    """Evaluates a forest; `build` are the functions that make a rule's value from those of its parts."""

    build: Builder
    _known: dict[int, tuple[Interpretation, ...]] = field(default_factory=dict)
    _partly: dict[int, tuple[Interpretation, ...]] = field(default_factory=dict)
    _open: set[int] = field(default_factory=set)

    def readings(self, node: SymbolNode) -> tuple[Interpretation, ...]:
        """The best different values of a completed symbol, best first."""
        if id(node) in self._known:
            return self._known[id(node)]
        if id(node) in self._open:
            return ()
        self._open.add(id(node))
        found: list[Interpretation] = []
        for packed in sorted(node.children, key=lambda child: child.rule.order):
            priority = packed.rule.options.priority or 0
            for parts in self._parts(packed):
                try:
                    value = self.build[packed.rule](list(parts.value))
                except NoReading:
                    continue
                found.append(Interpretation(value, parts.rank + priority, parts.words))
        self._open.discard(id(node))
        self._known[id(node)] = best(found)
        return self._known[id(node)]

    def _parts(self, packed: PackedNode) -> tuple[Interpretation, ...]:
        """The values of a derivation's parts, as tuples."""
        befores = (Interpretation((), 0),) if packed.left is None else self._before(packed.left)
        if packed.right is None:
            return befores
        lasts = self._last(packed)
        both = [
            Interpretation((*before.value, last.value), before.rank + last.rank, before.words + last.words)
            for before in befores
            for last in lasts
        ]
        return best(both)

    def _before(self, node: SymbolNode) -> tuple[Interpretation, ...]:
        """The parts before the last one: an intermediate node, which is a sequence of parts."""
        if id(node) not in self._partly:
            found = [parts for packed in node.children for parts in self._parts(packed)]
            self._partly[id(node)] = best(found)
        return self._partly[id(node)]

    def _last(self, packed: PackedNode) -> tuple[Interpretation, ...]:
        node = packed.right
        if isinstance(node, TokenNode):
            word = _word(packed, node)
            return (Interpretation(word, 0, (word,)),)
        return self.readings(node)


def _word(packed: PackedNode, node: TokenNode) -> Word:
    """The token as the terminal of the rule that matched it."""
    done = packed.s[1] if isinstance(packed.s, tuple) else len(packed.rule.expansion)
    kind = packed.rule.expansion[done - 1].name
    piece: Lexeme = node.token.value
    return Word(kind, piece.values.get(kind, piece.written), piece.written)


def best(found: Sequence[Interpretation]) -> tuple[Interpretation, ...]:
    """The highest ranks, at most `MOST_READINGS` of them, each value once."""
    kept: list[Interpretation] = []
    for reading in sorted(found, key=lambda reading: -reading.rank):
        if len(kept) == MOST_READINGS:
            break
        if all(not _same(reading.value, other.value) for other in kept):
            kept.append(reading)
    return tuple(kept)


def _same(first: Any, second: Any) -> bool:
    return bool(first == second)
