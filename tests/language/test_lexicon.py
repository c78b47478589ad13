"""The English lexicon: what is known, what it is called otherwise, and what it is a kind of."""

from __future__ import annotations

from importlib.resources import files

import pytest

from supermap_cli.language.lexicon import Lexicon, load_lexicon
from supermap_cli.language.spelling import LEAST_SIMILARITY, close_words

LABELS = ("chair", "dining table", "couch", "tv", "cup", "keyboard", "suitcase", "desk", "cabinet", "fire extinguisher")


@pytest.fixture(scope="module")
def lexicon() -> Lexicon:
    return load_lexicon()


@pytest.mark.parametrize("word", ["piano", "giraffe", "stapler", "kettle", "christmas tree", "oscilloscope", "wok"])
def test_things_that_may_be_denied_are_known(lexicon: Lexicon, word: str) -> None:
    assert lexicon.knows(word)


@pytest.mark.parametrize("word", ["quix", "moved", "missing", "tasse", "still", "near", "monday", "freedom", "change"])
def test_what_names_no_thing_is_not_known(lexicon: Lexicon, word: str) -> None:
    assert lexicon.name_of(word) is None


@pytest.mark.parametrize(
    ("word", "category"),
    [("kitchen", "place"), ("wall", "structure"), ("elbow", "part"), ("corduroy", "material"), ("highway", "place")],
)
def test_what_a_map_of_things_does_not_hold_is_not_denied(lexicon: Lexicon, word: str, category: str) -> None:
    assert lexicon.category(word) == category
    assert not lexicon.knows(word)


@pytest.mark.parametrize(
    ("written", "name"),
    [
        ("cups", "cup"),
        ("book shelves", "book shelf"),
        ("note book", "notebook"),
        ("knives", "knife"),
        ("wolves", "wolf"),
        ("mice", "mouse"),
        ("people", "person"),
        ("glasses", "spectacles"),
        ("T-shirts", "t shirt"),
        ("couches", "couch"),
        ("potted plants", "potted plant"),
        ("scissors", "scissors"),
    ],
)
def test_plurals_hyphens_and_compounds_are_understood(lexicon: Lexicon, written: str, name: str) -> None:
    assert lexicon.name_of(written) == name


def test_the_longest_noun_is_found(lexicon: Lexicon) -> None:
    words = ["where", "is", "the", "fire", "extinguisher", "sign"]
    found = lexicon.longest_noun(words, 3)
    assert found is not None
    assert (found.name, found.length) == ("fire extinguisher", 2)
    assert lexicon.longest_noun(words, 2) is None


def test_a_label_of_the_map_counts_as_a_noun(lexicon: Lexicon) -> None:
    assert lexicon.longest_noun(["zorptrons"], 0) is None
    found = lexicon.longest_noun(["zorptrons"], 0, ["zorptron"])
    assert found is not None
    assert found.name == "zorptron"


@pytest.mark.parametrize(
    ("first", "second"),
    [("couch", "sofa"), ("cup", "mug"), ("tv", "television"), ("bookcase", "bookshelf"), ("fridge", "refrigerator")],
)
def test_names_of_the_same_thing_find_each_other(lexicon: Lexicon, first: str, second: str) -> None:
    assert second in lexicon.synonyms(first)
    assert first in lexicon.synonyms(second)


@pytest.mark.parametrize(
    ("name", "other"),
    [
        ("table", "tabular array"),
        ("mouse", "rodent"),
        ("bank", "depository financial institution"),
        ("plant", "factory"),
    ],
)
def test_other_senses_of_a_word_give_no_synonyms(lexicon: Lexicon, name: str, other: str) -> None:
    assert other not in lexicon.synonyms(name)


@pytest.mark.parametrize(
    ("kind", "other"),
    [
        ("couch", "furniture"),
        ("sofa", "furniture"),
        ("dining table", "table"),
        ("microwave", "kitchen appliance"),
        ("laptop", "electronics"),
        ("banana", "fruit"),
        ("dog", "animal"),
        ("guitar", "musical instrument"),
        ("woman", "person"),
        ("armchair", "seat"),
    ],
)
def test_kinds_belong_to_their_classes(lexicon: Lexicon, kind: str, other: str) -> None:
    assert lexicon.is_kind_of(kind, other)
    assert not lexicon.is_kind_of(other, kind)


@pytest.mark.parametrize(
    ("name", "other"), [("car", "container"), ("lamp", "furniture"), ("axe", "cutlery"), ("wheelchair", "vehicle")]
)
def test_classes_are_as_wide_as_people_mean_them(lexicon: Lexicon, name: str, other: str) -> None:
    assert not lexicon.is_kind_of(name, other)


@pytest.mark.parametrize(
    ("said", "name"),
    [
        ("sit down on", "chair"),
        ("lie on", "couch"),
        ("drink out of", "mug"),
        ("eat with", "fork"),
        ("write with", "pencil"),
        ("cut with", "scissors"),
        ("store things in", "wardrobe"),
        ("watch", "tv"),
        ("type on", "keyboard"),
        ("put out a fire with", "fire extinguisher"),
    ],
)
def test_things_serve_their_uses(lexicon: Lexicon, said: str, name: str) -> None:
    assert name in lexicon.uses[lexicon.use_phrases[said]]


def test_a_chair_is_nothing_to_drink_from(lexicon: Lexicon) -> None:
    assert "chair" not in lexicon.uses["drink from"]


@pytest.mark.parametrize(
    ("typed", "meant"),
    [
        ("chiar", "chair"),
        ("keybaord", "keyboard"),
        ("suticase", "suitcase"),
        ("cabnet", "cabinet"),
        ("coutch", "couch"),
    ],
)
def test_misspellings_of_the_maps_words_are_mended_first(lexicon: Lexicon, typed: str, meant: str) -> None:
    assert lexicon.suggest(typed, LABELS)[0] == meant


def test_a_word_that_is_far_from_all_is_not_mended(lexicon: Lexicon) -> None:
    assert lexicon.suggest("quix", LABELS) == ()


def test_close_words_are_ranked_by_similarity() -> None:
    found = close_words("tabel", ["table", "label", "cable", "chair"])
    assert found[0] == ("table", 0.8)
    assert all(score >= LEAST_SIMILARITY for _, score in found)


def test_the_licence_of_wordnet_comes_along() -> None:
    text = (files("supermap_cli.language.lexicons") / "WORDNET-LICENSE.txt").read_text(encoding="utf-8")
    assert "WordNet 3.0 Copyright 2006 by Princeton University" in text


def test_the_files_are_small() -> None:
    folder = files("supermap_cli.language.lexicons")
    assert sum(len(path.read_bytes()) for path in folder.iterdir() if path.is_file()) < 1_500_000
