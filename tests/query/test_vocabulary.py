"""Which labels a phrase matches."""

from __future__ import annotations

import pytest

from supermap_cli.query.vocabulary import load_vocabulary, match_labels

KITCHEN = ("chair", "dining table", "cup", "tv", "potted plant", "refrigerator", "book", "couch", "knife", "wine glass")


@pytest.mark.parametrize(
    ("phrase", "label"),
    [
        ("chairs", "chair"),
        ("Chair", "chair"),
        ("sofa", "couch"),
        ("television", "tv"),
        ("mugs", "cup"),
        ("plant", "potted plant"),
        ("potted plants", "potted plant"),
        ("table", "dining table"),
        ("fridge", "refrigerator"),
        ("knives", "knife"),
        ("wine glasses", "wine glass"),
        ("glasses", "wine glass"),
        ("cup of coffee", "cup"),
    ],
)
def test_words_for_the_same_thing_find_its_label(phrase: str, label: str) -> None:
    match = match_labels(phrase, KITCHEN)
    assert match.labels == {label}
    assert match.note is None


def test_nothing_is_found_among_no_labels() -> None:
    assert match_labels("chair", ()).labels == frozenset()


@pytest.mark.parametrize("phrase", ["piano", "chairlift", "carpet", ""])
def test_what_is_not_there_is_not_found(phrase: str) -> None:
    assert match_labels(phrase, KITCHEN).labels == frozenset()


def test_a_wider_word_finds_all_its_kinds() -> None:
    assert match_labels("tables", ("coffee table", "picnic table", "desk", "tablet")).labels == {
        "coffee table",
        "picnic table",
        "desk",
    }


def test_a_narrower_word_does_not_find_another_kind() -> None:
    assert match_labels("coffee table", ("dining table",)).note == "'coffee' is not understood and was left out"


def test_unknown_words_before_the_head_noun_are_left_out_and_said() -> None:
    match = match_labels("big red chairs", KITCHEN)
    assert (match.labels, match.note) == ({"chair"}, "'big red' is not understood and was left out")


def test_a_coarse_detectors_word_is_taken_only_when_nothing_fits() -> None:
    assert match_labels("monitor", ("tv", "monitor")).labels == {"monitor"}
    match = match_labels("monitor", ("tv",))
    assert (match.labels, match.note) == ({"tv"}, "'monitor' was taken as 'tv'")


@pytest.mark.parametrize(
    ("plural", "singular"),
    [
        ("benches", "bench"),
        ("boxes", "box"),
        ("vases", "vase"),
        ("suitcases", "suitcase"),
        ("batteries", "battery"),
        ("glasses", "glass"),
        ("people", "person"),
        ("toothbrushes", "toothbrush"),
        ("scissors", "scissors"),
        ("bus", "bus"),
        ("couches", "couch"),
        ("oranges", "orange"),
    ],
)
def test_plurals(plural: str, singular: str) -> None:
    assert load_vocabulary().singular(plural) == singular
    assert load_vocabulary().singular(singular) == singular


def test_the_table_is_in_normal_form_and_names_nothing_twice() -> None:
    vocabulary = load_vocabulary()
    for name, group in vocabulary.synonyms.items():
        assert name in group, f"{name!r} stands in two groups"
    for table in (vocabulary.kinds, vocabulary.similar):
        for name, others in table.items():
            assert all(vocabulary.normalise(synonym) == synonym for synonym in (name, *others))
