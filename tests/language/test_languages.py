"""Questions in other languages: the same typed question as in English, or a refusal in the language."""

from __future__ import annotations

import json
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import pytest

from supermap_cli.errors import QueryError
from supermap_cli.language.build_questions import BuildQuestions
from supermap_cli.language.detection import LANGUAGES, detected_language
from supermap_cli.language.known_names import KnownNames
from supermap_cli.language.language_data import GRAMMARS
from supermap_cli.language.parsing import parse
from supermap_cli.language.prepared import as_json, load_grammar
from supermap_cli.language.refusals import RefusedQuestionError
from supermap_cli.language.translations import load_nouns
from supermap_cli.relations.registry import RELATIONS

PRONOUNS = {"anybody", "anyone", "somebody", "someone"}
FOLDER = Path(__file__).parent
OTHERS = [language for language in LANGUAGES if language != "en"]
LABELS = ("chair", "tv", "cup", "dining table", "couch", "potted plant", "laptop", "suitcase")
KNOWN = KnownNames(LABELS, ("monday", "tuesday"), {"en": dict(RELATIONS.phrases("en"))})


def rows(language: str) -> list[Any]:
    lines = (FOLDER / f"{language}.jsonl").read_text(encoding="utf-8").splitlines()
    return [pytest.param(language, json.loads(line), id=json.loads(line)["text"]) for line in lines]


ROWS = [row for language in OTHERS for row in rows(language)]
ANSWERED = [row for row in ROWS if "same_as" in row.values[1]]
REFUSED = [row for row in ROWS if "refused" in row.values[1]]


def meaning(value: Any) -> Any:
    """A typed question without how its nouns were written; a pronoun for people is a person."""
    if isinstance(value, tuple):
        return tuple(map(meaning, value))
    if not is_dataclass(value) or isinstance(value, type):
        return value
    changed = {field.name: meaning(getattr(value, field.name)) for field in fields(value)}
    if changed.get("name") in PRONOUNS:
        changed["name"] = "person"
    return replace(value, **{**changed, **({"written": ""} if "written" in changed else {})})


@pytest.mark.parametrize(("language", "row"), ANSWERED)
def test_a_question_means_the_same_as_in_english(language: str, row: dict[str, str]) -> None:
    asked, english = parse(row["text"], KNOWN), parse(row["same_as"], KNOWN, "en")
    assert asked.language == language
    assert meaning(asked.body) == meaning(english.body)
    assert meaning(asked.time) == meaning(english.time)


@pytest.mark.parametrize(("language", "row"), REFUSED)
def test_what_cannot_be_asked_is_refused_in_the_language(language: str, row: dict[str, str]) -> None:
    with pytest.raises(RefusedQuestionError) as refused:
        parse(row["text"], KNOWN, language)
    assert refused.value.kind == row["refused"]
    with pytest.raises(RefusedQuestionError) as english:
        parse("where is the quux", KNOWN, "en")
    assert refused.value.cure != english.value.cure


@pytest.mark.parametrize("language", OTHERS)
def test_there_are_many_questions_of_each_language(language: str) -> None:
    assert len(rows(language)) >= 40


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_rule_of_a_grammar_has_its_function(language: str) -> None:
    builder = BuildQuestions()
    for rule in load_grammar(language).rules:
        kept = [symbol for symbol in rule.expansion if not (symbol.is_term and symbol.filter_out)]
        inlined = rule.alias is None and (rule.origin.name.startswith("_") or (rule.options.expand1 and len(kept) == 1))
        assert inlined or callable(getattr(builder, str(rule.alias or rule.origin.name), None)), rule


@pytest.mark.parametrize("language", LANGUAGES)
def test_the_prepared_grammar_is_that_of_the_text(language: str) -> None:
    prepared = (GRAMMARS / f"{language}.json").read_text(encoding="utf-8")
    assert prepared == as_json((GRAMMARS / f"{language}.lark").read_text(encoding="utf-8")), "tools/build_grammars.py"


@pytest.mark.parametrize("language", OTHERS)
def test_every_noun_of_a_language_is_one_of_english(language: str) -> None:
    english = load_nouns("en")
    names = set(load_nouns(language).nouns.values())
    assert len(names) >= 290
    assert {name for name in names if english.category(name) is None} == set()


def test_words_of_no_language_count_as_english() -> None:
    assert detected_language("wher si teh chiar", KNOWN) == "en"


@pytest.mark.parametrize(
    ("text", "language"),
    [("chair-1", "en"), ("table", "en"), ("wo ist chair-1", "de"), ("tv", "en"), ("la silla", "es"), ("杯子", "zh")],
)
def test_the_language_is_that_of_the_words(text: str, language: str) -> None:
    assert detected_language(text, KNOWN) == language


def test_a_language_without_a_grammar_is_refused() -> None:
    with pytest.raises(QueryError, match="no grammar of the language 'it': known: en, de, es, fr, zh"):
        parse("dov'è la tazza", KNOWN, "it")


def test_a_misspelt_noun_is_mended_in_its_language() -> None:
    with pytest.raises(RefusedQuestionError, match="meintest du 'Tasse'"):
        parse("wo ist die tassse", KNOWN)


def test_the_head_of_a_compound_is_suggested() -> None:
    with pytest.raises(RefusedQuestionError, match="meintest du 'Stuhl'"):
        parse("wo steht der gartenstuhl", KNOWN)
