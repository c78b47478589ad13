"""The encoder of sentences, and what is suggested by it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from supermap_cli.errors import EncoderError
from supermap_cli.geometry.arrays import Float32Array
from supermap_cli.language.language_data import language_data
from supermap_cli.plugin_manager import load_plugins
from supermap_cli.query import unseen_words
from supermap_cli.query.unseen_words import similar_labels, with_suggestions
from supermap_sentence_encoder import SentenceOptions
from support.tiny_onnx import write_token_vectors

WORDS = ("[PAD]", "[UNK]", "couch", "settee", "lamp")
VECTORS = np.array([[9, 9], [1, 1], [1, 0], [0.9, 0.1], [0, 1]], np.float32)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A model whose vector of a text is the mean of those of its words."""
    tokenizers = pytest.importorskip("tokenizers")
    words = tokenizers.Tokenizer(tokenizers.models.WordLevel({word: at for at, word in enumerate(WORDS)}, "[UNK]"))
    words.pre_tokenizer = tokenizers.pre_tokenizers.Whitespace()
    words.save(str(tmp_path / "tokenizer.json"))
    write_token_vectors(tmp_path / "model.onnx", VECTORS)
    return tmp_path


def encoder(folder: Path) -> unseen_words.TextEncoder:
    made: unseen_words.TextEncoder = load_plugins().encoders.make("sentence", {"model": str(folder)})
    return made


class FixedEncoder:
    """Gives each text the vector that it is told to."""

    def __init__(self, **vectors: tuple[float, float]) -> None:
        self.vectors = vectors

    def encode(self, texts: Sequence[str]) -> Float32Array:
        chosen = [next(vector for word, vector in self.vectors.items() if text.endswith(word)) for text in texts]
        found = np.array(chosen, np.float32)
        return np.asarray(found / np.linalg.norm(found, axis=1, keepdims=True), np.float32)


def test_vectors_have_unit_length_and_leave_out_padding(folder: Path) -> None:
    vectors = encoder(folder).encode(["couch lamp", "couch"])
    assert vectors.dtype == np.float32
    assert np.allclose(vectors, [[0.5**0.5, 0.5**0.5], [1, 0]])


def test_a_folder_without_a_model_is_refused(folder: Path) -> None:
    (folder / "model.onnx").unlink()
    with pytest.raises(EncoderError, match=r"no \.onnx file"):
        encoder(folder)


def test_a_folder_without_a_tokenizer_is_refused(tmp_path: Path) -> None:
    pytest.importorskip("tokenizers")
    with pytest.raises(EncoderError, match=r"no folder with a tokenizer\.json"):
        encoder(tmp_path)


def test_the_options_are_described() -> None:
    assert all(field.description for field in SentenceOptions.model_fields.values())


def test_the_most_similar_labels_are_suggested_first_and_say_whether_the_lexicon_agrees() -> None:
    model = FixedEncoder(settee=(1, 0), couch=(1, 0.2), chair=(1, 1), lamp=(0, 1))
    couch, chair = similar_labels("settee", ["lamp", "chair", "couch"], model)
    assert (couch.label, couch.agreed) == ("couch", True)
    assert (chair.label, chair.agreed) == ("chair", False)
    assert couch.similarity > chair.similarity


def test_a_map_without_labels_gives_no_suggestion() -> None:
    assert similar_labels("settee", [], FixedEncoder(settee=(1, 0))) == ()


def test_a_refused_word_gets_suggestions(monkeypatch: pytest.MonkeyPatch) -> None:
    refusal = language_data("en").refusal("unknown word", "flatscreen", "where is the flatscreen")
    monkeypatch.setattr(unseen_words, "load_encoder", lambda: FixedEncoder(flatscreen=(1, 0), tv=(1, 0), cup=(0, 1)))
    assert "did you mean 'tv'?" in str(with_suggestions(refusal, ["tv", "cup"]))


def test_without_an_encoder_a_refusal_stays_as_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    def none() -> None:
        raise EncoderError("there is none")

    monkeypatch.setattr(unseen_words, "load_encoder", none)
    refusal = language_data("en").refusal("unknown word", "flatscreen", "where is the flatscreen")
    assert with_suggestions(refusal, ["tv"]) is refusal


def test_words_of_other_languages_are_not_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(unseen_words, "load_encoder", lambda: pytest.fail("it knows English only"))
    refusal = language_data("de").refusal("unknown word", "quux", "wo ist der quux")
    assert with_suggestions(refusal, ["tv"]) is refusal
