"""A parser for one sentence: only the rules of a grammar that its words can fulfil.

An Earley parser predicts all rules that could come next; of a grammar with hundreds of rules, most name words that the
sentence does not have. Leaving those out changes no reading.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Mapping
from copy import copy
from dataclasses import dataclass
from typing import Any

from lark import Lark
from lark.grammar import Rule, Symbol
from lark.parsers.earley import Parser

from supermap_cli.language.tokens import ANY_WORD


@dataclass(frozen=True)
class _RuleNeeds:
    rule: Rule
    terminals: frozenset[str]
    symbols: frozenset[str]


class PrunedGrammar:
    """The rules of a grammar with what each needs. Only for lark's Earley parser with tokens made beforehand."""

    def __init__(self, lark: Lark) -> None:
        self._parser: Parser = lark.parser.parser  # type: ignore[attr-defined]
        rules = [rule for listed in self._parser.predictions.values() for rule in listed]
        unique = list({id(rule): rule for rule in rules}.values())
        self._needs = [
            _RuleNeeds(
                rule,
                frozenset(symbol.name for symbol in rule.expansion if symbol.is_term and symbol.name != ANY_WORD),
                frozenset(symbol.name for symbol in rule.expansion if not symbol.is_term),
            )
            for rule in unique
        ]
        self._needing: Mapping[str, list[int]] = self._users()
        at = {id(need.rule): index for index, need in enumerate(self._needs)}
        self._predictions: list[tuple[Symbol, frozenset[int]]] = [
            (origin, frozenset(at[id(rule)] for rule in listed))
            for origin, listed in self._parser.predictions.items()
        ]

    def _users(self) -> dict[str, list[int]]:
        users: dict[str, list[int]] = defaultdict(list)
        for index, need in enumerate(self._needs):
            for symbol in need.symbols:
                users[symbol].append(index)
        return users

    def parser_for(self, kinds: Collection[str]) -> Parser:
        """A parser with the rules whose terminals are all among `kinds`, and whose parts can be made of such."""
        usable = self._usable(kinds)
        pruned: Any = copy(self._parser)
        pruned.predictions = {
            origin: [self._needs[index].rule for index in sorted(listed & usable)]
            for origin, listed in self._predictions
        }
        made: Parser = pruned
        return made

    def _usable(self, kinds: Collection[str]) -> set[int]:
        missing = {index: len(need.symbols) for index, need in enumerate(self._needs) if need.terminals <= kinds}
        open_ = [index for index, count in missing.items() if not count]
        usable, made = set(open_), set[str]()
        while open_:
            origin = self._needs[open_.pop()].rule.origin.name
            if origin in made:
                continue
            made.add(origin)
            for index in self._needing[origin] if origin in self._needing else ():
                if index in missing:
                    missing[index] -= 1
                    if not missing[index]:
                        usable.add(index)
                        open_.append(index)
        return usable
