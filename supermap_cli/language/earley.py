"""A parser for one sentence: lark's Earley parser, with only those rules of a grammar that the words can fulfil.

An Earley parser predicts all rules that could come next; of a grammar with hundreds of rules, most name words that the
sentence does not have. Leaving those out changes no reading, and makes parsing ten times as fast.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from lark import Token
from lark.common import LexerConf
from lark.grammar import NonTerminal, Rule, Terminal
from lark.parsers.earley import Parser
from lark.parsers.earley_forest import StableSymbolNode
from lark.utils import OrderedSet

ANY_WORD = "WORD"
"""The terminal that matches any word."""


@dataclass(frozen=True)
class Tokens:
    """Tokens, given as lark's Earley parser asks a lexer for them."""

    tokens: Sequence[Token]

    def lex(self, _expected: object) -> Iterator[Token]:
        """All of them, whatever is expected."""
        yield from self.tokens


@dataclass(frozen=True)
class RuleSet:
    """The rules of a grammar, and what each needs."""

    rules: Sequence[Rule]

    @cached_property
    def _terminals(self) -> list[frozenset[str]]:
        return [
            frozenset(symbol.name for symbol in rule.expansion if symbol.is_term and symbol.name != ANY_WORD)
            for rule in self.rules
        ]

    @cached_property
    def _parts(self) -> list[frozenset[str]]:
        return [frozenset(symbol.name for symbol in rule.expansion if not symbol.is_term) for rule in self.rules]

    @cached_property
    def _users(self) -> Mapping[str, list[int]]:
        users: dict[str, list[int]] = defaultdict(list)
        for index, parts in enumerate(self._parts):
            for part in parts:
                users[part].append(index)
        return users

    def forest(self, tokens: Sequence[Token], kinds: Collection[str]) -> Any:
        """The parse forest of tokens that are of some kinds. Raises `lark.UnexpectedInput` where no rule fits."""
        usable = [self.rules[index] for index in self._usable(kinds)]
        parser: Any = _SentenceParser(usable)  # lark's parsers have no types
        return parser.parse(Tokens(tokens), "start")

    def _usable(self, kinds: Collection[str]) -> list[int]:
        """The rules whose terminals are all among `kinds`, and whose other parts can be made of such."""
        missing = {
            index: len(self._parts[index]) for index, needed in enumerate(self._terminals) if needed.issubset(kinds)
        }
        open_ = [index for index, count in missing.items() if not count]
        usable, made = set(open_), set[str]()
        while open_:
            origin = self.rules[open_.pop()].origin.name
            if origin in made:
                continue
            made.add(origin)
            for index in self._users.get(origin, ()):
                if index in missing:
                    missing[index] -= 1
                    if not missing[index]:
                        usable.add(index)
                        open_.append(index)
        return sorted(usable)


class _SentenceParser(Parser):
    """lark's parser, without the analysis of a grammar that its constructor makes."""

    def __init__(self, rules: Sequence[Rule]) -> None:
        symbols = {symbol for rule in rules for symbol in rule.expansion}
        self.lexer_conf = LexerConf([], re)  # tokens are made beforehand
        self.debug = False
        self.Tree = None
        self.Set = OrderedSet
        self.SymbolNode = StableSymbolNode
        self.NULLABLE = set()
        self.TERMINALS = {symbol for symbol in symbols if isinstance(symbol, Terminal)}
        self.NON_TERMINALS = {symbol for symbol in symbols if isinstance(symbol, NonTerminal)}
        self.predictions: dict[NonTerminal, list[Rule]] = {NonTerminal("start"): []}
        for symbol in symbols:
            if isinstance(symbol, NonTerminal):
                self.predictions[symbol] = []
        for rule in rules:
            self.predictions.setdefault(rule.origin, []).append(rule)
        self.term_matcher = _matches


def _matches(terminal: Terminal, token: Token) -> bool:
    return bool(token.type == terminal.name)
