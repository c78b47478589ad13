"""Labels of all detectors are spelled in one way, and a label counts once."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from supermap_cli.language.inflection import normalise
from supermap_cli.types.detections import Detections, Hypothesis, plain_hypotheses, plainly_labelled
from supermap_cli.types.labels import plain_label


@pytest.mark.parametrize(
    ("recorded", "plain"),
    [
        ("Person", "person"),
        ("potted_plant", "potted plant"),
        ("TV", "tv"),
        ("dining table", "dining table"),
        ("t-shirt", "t shirt"),
        ("t_shirt", "t shirt"),
        ("T-Shirt", "t shirt"),
        ("__traffic--Light_", "traffic light"),
        (" Dining\u00a0 table\n", "dining table"),
        ("B\u00fcrostuhl", "b\u00fcrostuhl"),
        ("B\u00fcrostuhl 'gro\u00df'", "B\u00fcrostuhl 'gro\u00df'"),
        ("56", "56"),
        ("-1", "-1"),
        ("a chair, the Red one", "a chair, the Red one"),
        ("", ""),
        (" \t", ""),
        ("_", "_"),
        ("wall-", "wall"),
    ],
)
def test_words_are_spelled_as_questions_spell_them(recorded: str, plain: str) -> None:
    assert plain_label(recorded) == plain


@given(st.text(max_size=30))
def test_a_plain_label_stays_as_it_is_and_reads_the_same(label: str) -> None:
    plain = plain_label(label)
    assert plain_label(plain) == plain
    assert plain == " ".join(plain.split())
    if label.isascii():
        assert normalise(plain) == normalise(label)


def test_spellings_of_one_label_are_one_hypothesis() -> None:
    said = [Hypothesis("t_shirt", 0.3), Hypothesis("", 0.9), Hypothesis("T-Shirt", 0.6), Hypothesis("jacket", 0.4)]
    assert plain_hypotheses(said) == (Hypothesis("t shirt", 0.6), Hypothesis("jacket", 0.4))


def test_what_has_no_label_is_no_detection() -> None:
    boxes, scores = np.zeros((2, 4), np.float32), np.array([0.9, 0.8], np.float32)
    labelled = plainly_labelled(
        Detections(1, boxes, scores, ((Hypothesis("  ", 0.9),), (Hypothesis("Cup", 0.8),)), (None, None))
    )
    assert labelled.labels == ("cup",)
    assert plainly_labelled(labelled) is labelled
