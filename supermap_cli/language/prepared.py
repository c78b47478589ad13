"""Grammars as plain rules: compiled from a `.lark` file by lark, and kept beside it as JSON that loads faster.

It takes lark 0.25 s to read the English grammar, and 10 ms to load its JSON, which names the text that it was made
from: if that has changed, the grammar is compiled anew. `tools/build_grammars.py` writes it.
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from typing import Any

from lark.grammar import NonTerminal, Rule, RuleOptions, Symbol, Terminal

from supermap_cli.language.inflection import plain_spellings
from supermap_cli.language.language_data import GRAMMARS

Phrases = dict[str, frozenset[str]]
"""The words and phrases of a grammar -> the names of the terminals that match them."""


@dataclass(frozen=True)
class PlainGrammar:
    """The rules of a grammar, without any repetition or option, and the phrases of its terminals."""

    rules: tuple[Rule, ...]
    phrases: Phrases


@cache
def load_grammar(language: str) -> PlainGrammar:
    """The grammar of a language (ISO 639-1)."""
    text = (GRAMMARS / f"{language}.lark").read_text(encoding="utf-8")
    prepared = GRAMMARS / f"{language}.json"
    if prepared.is_file():
        table = json.loads(prepared.read_text(encoding="utf-8"))
        if table["crc32"] == zlib.crc32(text.encode()):
            phrases = {phrase: frozenset(names) for phrase, names in table["phrases"].items()}
            return PlainGrammar(tuple(_read_rules(table["rules"])), phrases)
    return compile_grammar(text)


def compile_grammar(text: str) -> PlainGrammar:
    """A grammar in lark's language as plain rules. Raises `lark.GrammarError` where it is none."""
    from lark import Lark  # noqa: PLC0415 - needed only to make a grammar

    parser = Lark(text, parser="earley", lexer="basic", ambiguity="forest", maybe_placeholders=False)
    phrases: dict[str, set[str]] = {}
    for terminal in parser.terminals:
        for phrase in terminal.pattern.value.removeprefix("(?:").removesuffix(")").split("|"):
            for spelling in plain_spellings(phrase.replace("\\", "")):
                phrases.setdefault(spelling, set()).add(terminal.name)
    rules = tuple(rule for rule in parser.rules if not str(rule.origin.name).startswith("$"))
    return PlainGrammar(rules, {phrase: frozenset(names) for phrase, names in phrases.items()})


def as_json(text: str) -> str:
    """The prepared form of a grammar's text."""
    grammar = compile_grammar(text)
    table = {
        "crc32": zlib.crc32(text.encode()),
        "rules": [_row(rule) for rule in grammar.rules],
        "phrases": {phrase: sorted(names) for phrase, names in sorted(grammar.phrases.items())},
    }
    return json.dumps(table, ensure_ascii=False, separators=(",", ":")) + "\n"


def _row(rule: Rule) -> list[Any]:
    """A rule as JSON: origin, symbols (a terminal with whether it is dropped), order, alias, priority, expand1."""
    symbols = [
        [str(symbol.name), int(symbol.filter_out)] if isinstance(symbol, Terminal) else str(symbol.name)
        for symbol in rule.expansion
    ]
    alias = None if rule.alias is None else str(rule.alias)
    return [str(rule.origin.name), symbols, rule.order, alias, rule.options.priority, int(rule.options.expand1)]


def _read_rules(rows: list[list[Any]]) -> Iterator[Rule]:
    symbols: dict[Any, Symbol] = {}

    def symbol(written: Any) -> Symbol:
        key = written if isinstance(written, str) else tuple(written)
        if key not in symbols:
            symbols[key] = NonTerminal(key) if isinstance(key, str) else Terminal(key[0], bool(key[1]))
        return symbols[key]

    for origin, expansion, order, alias, priority, expand1 in rows:
        options = RuleOptions(expand1=bool(expand1), priority=priority)
        left = symbol(origin)
        yield Rule(NonTerminal(left.name), [symbol(part) for part in expansion], order, alias, options)
