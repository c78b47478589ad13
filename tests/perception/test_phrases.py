"""What a user asks for, as captions of Grounding DINO."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tokenizers import Tokenizer
from tokenizers.models import WordLevel
from tokenizers.normalizers import BertNormalizer
from tokenizers.pre_tokenizers import BertPreTokenizer
from tokenizers.processors import TemplateProcessing

from supermap_cli.errors import DetectorError
from supermap_open_vocabulary import GroundingDinoOptions
from supermap_open_vocabulary.captions import caption_text, make_captions
from supermap_open_vocabulary.grounding_dino import GroundingDino
from supermap_open_vocabulary.phrase_order import order_change
from supermap_open_vocabulary.phrases import normal_phrases, read_phrases
from support.tiny_onnx import write_constant_model

WORDS = ("chair", "trash", "can", "plant", "red", "coffee", "table", "cup")


def tokenizer() -> Tokenizer:
    """A tokenizer that splits words and marks as BERT's does, and knows `WORDS`."""
    vocabulary = {word: i for i, word in enumerate(("[UNK]", "[CLS]", "[SEP]", ".", *WORDS))}
    made = Tokenizer(WordLevel(vocabulary, unk_token="[UNK]"))  # noqa: S106 - a token of text
    made.normalizer, made.pre_tokenizer = BertNormalizer(), BertPreTokenizer()
    made.post_processor = TemplateProcessing(single="[CLS] $A [SEP]", special_tokens=[("[CLS]", 1), ("[SEP]", 2)])
    return made


ENCODE = tokenizer().encode
PHRASE = st.lists(st.sampled_from(WORDS), min_size=1, max_size=3).map(" ".join)


def test_prompts_are_lower_case_phrases_each_once() -> None:
    assert normal_phrases(["Trash  Can", "chair", "trash can", " ", "St. Bernard?"]) == (
        "trash can",
        "chair",
        "st bernard",
    )


def test_a_prompt_and_a_file_are_asked_for_together(tmp_path: Path) -> None:
    (tmp_path / "words.txt").write_text("cup\nTrash can\n\n", encoding="utf-8")
    assert read_phrases("chair, trash can", tmp_path / "words.txt", "grounding-dino") == ("chair", "trash can", "cup")


@pytest.mark.parametrize("prompt", [None, "", " , ;", "..."])
def test_nothing_to_look_for_says_how_to_say_it(prompt: str | None) -> None:
    with pytest.raises(DetectorError, match=r"what to look for.*grounding-dino\.prompt="):
        read_phrases(prompt, None, "grounding-dino")


@given(st.lists(PHRASE, min_size=1, max_size=12, unique=True), st.integers(6, 40))
def test_captions_hold_every_phrase_once_within_the_budget(phrases: list[str], budget: int) -> None:
    captions = make_captions(phrases, ENCODE, budget=budget)
    assert [number for caption in captions for number in caption.phrases] == list(range(len(phrases)))
    for caption in captions:
        assert len(caption.ids) <= budget
        for number, (first, end) in zip(caption.phrases, caption.spans, strict=True):
            words = [WORDS[token - 4] for token in caption.ids[first:end]]
            assert " ".join(words) == phrases[number]


@given(st.lists(PHRASE, min_size=2, max_size=6, unique=True))
def test_a_phrase_scores_as_the_best_of_its_tokens(phrases: list[str]) -> None:
    (caption,) = make_captions(phrases, ENCODE, budget=256)
    logits = np.full((2, 256), -np.inf, np.float32)
    logits[:, : len(caption.ids)] = np.random.default_rng(0).normal(0, 30, (2, len(caption.ids)))
    scores = caption.scores(logits)
    assert ((scores >= 0) & (scores <= 1)).all()
    for column, (first, end) in enumerate(caption.spans):
        np.testing.assert_allclose(scores[:, column], 1 / (1 + np.exp(-logits[:, first:end].max(axis=1))), atol=1e-6)


def test_one_phrase_a_pass_and_tokens_filled_up_to_the_models_number() -> None:
    captions = make_captions(["trash can", "chair"], ENCODE, budget=8, length=8, one_phrase=True)
    assert [caption.phrases for caption in captions] == [(0,), (1,)]
    assert captions[0].attention.tolist() == [1, 1, 1, 1, 1, 0, 0, 0]
    assert caption_text(["trash can", "chair"]) == "trash can. chair."


def test_a_phrase_longer_than_the_model_takes_is_one_line() -> None:
    with pytest.raises(DetectorError, match="a phrase of 9 tokens, the model takes 8"):
        make_captions(["red red red red red red"], ENCODE, budget=8)


def test_logits_in_another_order_are_no_change_and_others_are() -> None:
    one = [np.sort(np.random.default_rng(1).normal(0, 3, (40, 2)), axis=0).astype(np.float32)]
    assert order_change(one, one) == 0
    assert order_change(one, [one[0] + 1]) > 0.2
    assert order_change([np.zeros((4, 1), np.float32)], [np.zeros((4, 1), np.float32)]) == 0


def test_missing_weights_and_tokenizers_say_what_to_do(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    with pytest.raises(DetectorError, match=r"no weights.*grounding-dino\.model=PATH"):
        GroundingDino(GroundingDinoOptions(prompt="chair"))
    model = write_constant_model(tmp_path / "m.onnx", [np.zeros((1, 7, 4), np.float32)], (64, 64))
    with pytest.raises(DetectorError, match=r"no tokenizer\.json beside the model"):
        GroundingDino(GroundingDinoOptions(prompt="chair", model=model))
    tokenizer().save(str(tmp_path / "tokenizer.json"))
    with pytest.raises(DetectorError, match=r"no Grounding DINO: images.*pixel_values"):
        GroundingDino(GroundingDinoOptions(prompt="chair", model=model))
    (tmp_path / "tokenizer.json").write_text("{}", encoding="utf-8")
    with pytest.raises(DetectorError, match=r"no Grounding DINO|tokenizer cannot be read"):
        GroundingDino(GroundingDinoOptions(prompt="chair", model=tmp_path))
