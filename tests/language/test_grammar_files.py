"""The grammar files: prepared ones are those of their sources, and every rule has a function that makes its value."""

from __future__ import annotations

import pytest

from supermap_cli.language.detection import LANGUAGES
from supermap_cli.language.language_data import GRAMMARS
from supermap_cli.language.parsing import function_of, grammar
from supermap_cli.language.prepared import as_json


@pytest.mark.parametrize("language", LANGUAGES)
def test_the_prepared_grammar_is_that_of_its_source(language: str) -> None:
    source = (GRAMMARS / f"{language}.lark").read_text(encoding="utf-8")
    prepared = (GRAMMARS / f"{language}.json").read_text(encoding="utf-8")
    assert prepared == as_json(source), "run python tools/build_grammars.py"


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_rule_has_a_function_or_passes_its_one_part_on(language: str) -> None:
    without = {str(rule) for rule in grammar(language).rules.rules if function_of(rule) is None}
    assert not without
