"""Grounding DINO: our whole path against transformers' processor, model and post-processing."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("torch", reason="needs torch: pip install -e '.[perception-tests]'")
pytest.importorskip("transformers", reason="needs transformers: pip install -e '.[perception-tests]'")

import torch

from parity import grounding_dino
from parity.comparing import Difference, compare, picture, together
from supermap_cli.geometry.cameras import PinholeCamera
from supermap_open_vocabulary import GroundingDinoOptions
from supermap_open_vocabulary.grounding_dino import GroundingDino
from support.frames import frame

PHRASES = ("trash can", "chair", "red coffee table", "plant")
SHAPES = ((96, 150), (150, 96), (128, 128), (480, 640))


@dataclass(frozen=True)
class Made:
    """A model, its processor, and the folder with its export."""

    model: Any
    processor: Any
    folder: Path

    def detector(self, prompt: str, name: str = "model.onnx", **more: Any) -> GroundingDino:
        return GroundingDino(
            GroundingDinoOptions(model=self.folder / name, prompt=prompt, threads=1, device="cpu", **more)
        )


@pytest.fixture(scope="module", params=list(grounding_dino.KINDS))
def made(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Made:
    return make(request.param, tmp_path_factory.mktemp(request.param))


def make(kind: str, folder: Path) -> Made:
    torch.set_num_threads(1)
    processor, model = grounding_dino.make_processor(folder), grounding_dino.make_model(kind)
    grounding_dino.export_model(model, processor, folder / "model.onnx", ["trash can", "chair"])
    return Made(model, processor, folder)


@pytest.fixture(scope="module")
def baked(tmp_path_factory: pytest.TempPathFactory) -> Made:
    """A model with an export besides in which the mask of one phrase is built in."""
    made = make("grounding-dino", tmp_path_factory.mktemp("baked"))
    grounding_dino.export_model(made.model, made.processor, made.folder / "baked.onnx", ["chair"], baked=True)
    return made


def reference(made: Made, image: Any, phrases: tuple[str, ...]) -> tuple[Any, Any, list[str]]:
    """transformers' boxes, scores and labels of every query, in the order of the queries.

    Its label is all tokens above a threshold: just below a query's score that is the best token alone.
    """
    inputs = made.processor(images=image, text=[list(phrases)], return_tensors="pt")
    with torch.no_grad():
        outputs = made.model(**inputs)
    (all_found,) = made.processor.post_process_grounded_object_detection(
        outputs, inputs.input_ids, threshold=0.0, text_threshold=0.0, target_sizes=[image.shape[:2]]
    )
    best = torch.sigmoid(outputs.logits[0]).max(dim=1).values
    words = []
    for query, score in enumerate(best):
        (found,) = made.processor.post_process_grounded_object_detection(
            outputs, inputs.input_ids, threshold=0.0, text_threshold=float(score) - 1e-7, target_sizes=None
        )
        words.append(found["text_labels"][query])
    return all_found["boxes"].numpy(), all_found["scores"].numpy(), words


def differences(made: Made, shape: tuple[int, int], phrases: tuple[str, ...], **more: Any) -> Difference:
    """For the queries whose best token lies in a phrase: delimiters name nothing."""
    image = picture(sum(shape), *shape)
    detector = made.detector(", ".join(phrases), **more)
    found = [detector.candidates(image)]
    passes = [tuple(detector.phrases[i] for i in caption.phrases) for caption in detector.captions]
    queries = len(found[0].scores) // len(passes)
    results = []
    for number, asked in enumerate(passes):
        boxes, scores, words = reference(made, image, asked)
        owners = [[phrase for phrase in asked if set(word.split()) <= set(phrase.split())] for word in words]
        named = [i for i, owner in enumerate(owners) if words[i] and len(owner) == 1]
        part = slice(number * queries, (number + 1) * queries)
        own_boxes, own_scores = found[0].boxes_xyxy[part][named], found[0].scores[part][named]
        labels = [detector.phrases[i] for i in own_scores.argmax(axis=1)]
        theirs = [owners[i][0] for i in named]
        results.append(compare((own_boxes, own_scores.max(axis=1), labels), (boxes[named], scores[named], theirs)))
    return together(results)


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: f"{shape[1]}x{shape[0]}")
def test_several_phrases_at_once_are_found_as_transformers_finds_them(made: Made, shape: tuple[int, int]) -> None:
    difference = differences(made, shape, PHRASES)
    difference.check()
    assert difference.boxes >= 10


def test_one_phrase(made: Made) -> None:
    differences(made, SHAPES[0], ("trash can",)).check()


def test_prompts_longer_than_the_text_encoder_takes_are_asked_for_in_parts(
    made: Made, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("supermap_open_vocabulary.grounding_dino._max_text_tokens", lambda _: 9)
    phrases = (*PHRASES, "office monitor", "cup", "books")
    assert len(made.detector(", ".join(phrases)).captions) == 4
    differences(made, SHAPES[0], phrases).check()


def test_the_scores_of_all_phrases_are_those_of_their_tokens(made: Made) -> None:
    image = picture(3)
    inputs = made.processor(images=image, text=[list(PHRASES)], return_tensors="pt")
    with torch.no_grad():
        tokens = torch.sigmoid(made.model(**inputs).logits[0]).numpy()
    texts = made.processor.tokenizer.convert_ids_to_tokens(inputs.input_ids[0])
    ends = [i for i, text in enumerate(texts) if text == "."]
    spans = zip([1, *(end + 1 for end in ends)], ends, strict=False)
    expected = np.stack([tokens[:, first:end].max(axis=1) for first, end in spans], axis=1)
    ours = made.detector(", ".join(PHRASES)).candidates(image).scores
    np.testing.assert_allclose(ours, expected, atol=1e-4)


def test_detections_keep_the_other_phrases_as_hypotheses(made: Made) -> None:
    found = made.detector(", ".join(PHRASES), score_floor=0.001).detect(
        frame(picture(3), camera=PinholeCamera(150, 96, 100, 100, 75, 48))
    )
    assert len(found)
    assert {len(hypotheses) for hypotheses in found.hypotheses} <= {1, 2, 3, 4}
    assert max(len(hypotheses) for hypotheses in found.hypotheses) > 1
    assert (found.scores[:-1] >= found.scores[1:]).all()


def test_a_mask_that_is_built_into_the_export_is_detected_and_one_phrase_a_pass_is_asked_for(baked: Made) -> None:
    sound, trapped = baked.detector(", ".join(PHRASES)), baked.detector(", ".join(PHRASES), "baked.onnx")
    assert (len(sound.captions), list(sound.warnings)) == (1, [])
    assert len(trapped.captions) == len(PHRASES)
    assert "one phrase" in trapped.warnings[0]
    image = picture(5)
    single = baked.detector(", ".join(PHRASES), one_phrase=True)
    one, other = single.candidates(image), trapped.candidates(image)
    compare((one.boxes_xyxy, one.scores.max(axis=1), []), (other.boxes_xyxy, other.scores.max(axis=1), [])).check()
