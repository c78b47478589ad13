"""A truth goes into a file and comes back as it was, but for the rounding; nothing else is taken for one."""

from __future__ import annotations

import json
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from jsonschema import Draft202012Validator

from supermap_cli.errors import TruthError
from supermap_cli.truth_file import from_document, read_truth, to_document, write_truth
from supermap_cli.types.truth import GroundTruth, TrueObject, TrueQuestion
from supermap_schema.json_schemas import load_schema
from support import kitchen_truth, truths

SCHEMA = Draft202012Validator(load_schema("truth"))


def test_a_truth_of_nothing_comes_back(tmp_path: Path) -> None:
    write_truth(truths.EMPTY, tmp_path / "truth.json")
    assert read_truth(tmp_path / "truth.json") == truths.EMPTY


@pytest.mark.parametrize("fingerprint", ["c0ffee", None])
def test_a_fingerprint_comes_back_and_may_be_missing(fingerprint: str | None) -> None:
    truth = kitchen_truth.kitchen_truth()
    document = to_document(replace(truth, traversals=(replace(truth.traversals[0], fingerprint=fingerprint),)))
    assert from_document(document).traversals[0].fingerprint == fingerprint
    if fingerprint is None:
        del document["traversals"][0]["fingerprint"]
        SCHEMA.validate(json.loads(json.dumps(document)))
        assert from_document(document).traversals[0].fingerprint is None


def test_the_cameras_of_images_come_back_and_are_left_out_of_a_truth_of_one_camera() -> None:
    truth = kitchen_truth.kitchen_truth()
    (traversal, *_), images = truth.traversals, len(truth.traversals[0].stamps_ns)
    cameras = tuple("left" if k % 2 else "right" for k in range(images))
    document = json.loads(json.dumps(to_document(replace(truth, traversals=(replace(traversal, camera_ids=cameras),)))))
    SCHEMA.validate(document)
    assert from_document(document).traversals[0].camera_ids == cameras
    assert "camera_ids" not in to_document(truth)["traversals"][0]
    assert from_document(to_document(truth)).traversals[0].camera_ids == ()


def test_a_truth_with_fewer_cameras_than_images_is_damaged() -> None:
    truth = kitchen_truth.kitchen_truth()
    document = to_document(truth)
    document["traversals"][0]["camera_ids"] = ["left"]
    with pytest.raises(ValueError, match="1 cameras of"):
        from_document(document)


@settings(deadline=None, max_examples=60)
@given(truth=truths.truths())
def test_written_again_it_has_the_same_bytes_and_follows_its_schema(truth: GroundTruth) -> None:
    document = json.loads(json.dumps(to_document(truth)))
    SCHEMA.validate(document)
    assert json.dumps(to_document(from_document(document))) == json.dumps(document)


@settings(deadline=None, max_examples=60)
@given(truth=truths.truths())
def test_what_is_read_differs_from_what_was_written_only_by_the_rounding(truth: GroundTruth) -> None:
    read = from_document(to_document(truth))
    assert (read.scenario, read.seed, read.questions) == (truth.scenario, truth.seed, truth.questions)
    for back, there in zip(read.traversals, truth.traversals, strict=True):
        assert (back.name, back.recording, back.start_ns, back.end_ns) == (
            there.name,
            there.recording,
            there.start_ns,
            there.end_ns,
        )
        np.testing.assert_array_equal(back.stamps_ns, there.stamps_ns)
        np.testing.assert_allclose(back.T_world_base, there.T_world_base, atol=1e-4)
        for column in ("frame", "object", "state", "present", "pixels"):
            np.testing.assert_array_equal(getattr(back.sightings, column), getattr(there.sightings, column))
        np.testing.assert_allclose(back.sightings.visible, there.sightings.visible, atol=1e-3)
    for thing, other in zip(read.objects, truth.objects, strict=True):
        assert (thing.id, thing.label, thing.kind) == (other.id, other.label, other.kind)
        assert [state.since_ns for state in thing.states] == [state.since_ns for state in other.states]
        for state, original in zip(thing.states, other.states, strict=True):
            np.testing.assert_allclose(state.box.center, original.box.center, atol=1e-4)
            np.testing.assert_allclose(state.centroid, original.centroid, atol=1e-4)
            assert state.on == original.on
        seen, were_seen = thing.surface_object[thing.surface_seen], other.surface_object[other.surface_seen]
        np.testing.assert_allclose(seen, were_seen, atol=6e-4)
        assert len(thing.surface_object) == len(other.surface_object)


def test_an_office_is_read_in_less_than_a_second(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    points = rng.uniform(-5, 5, (5000, 3)).astype(np.float32)
    things = tuple(TrueObject(f"box-{k}", "box", "object", (), (), points, points[:, 0] > 0) for k in range(60))
    truth = GroundTruth("office", 1, (), things, (), (), (TrueQuestion("box", ("box-1",)),))
    write_truth(truth, tmp_path / "truth.json")
    began = time.process_time()
    read_truth(tmp_path / "truth.json")
    assert time.process_time() - began < 1


def test_a_missing_file_says_how_to_make_one(tmp_path: Path) -> None:
    with pytest.raises(TruthError, match=r"there is no ground truth .*supermap simulate"):
        read_truth(tmp_path / "truth.json")


@pytest.mark.parametrize(
    "content",
    [b"", b"\x89PNG\r\n\xff", b"hello", b"[]", b'{"instances": []}', b'{"format": "supermap map", "version": 1}'],
    ids=["empty", "binary", "text", "list", "answer", "other format"],
)
def test_a_file_of_another_kind_is_no_truth(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "other.json"
    path.write_bytes(content)
    with pytest.raises(TruthError, match=r"not a ground truth: .*other\.json.*truth\.json"):
        read_truth(path)


def test_a_file_that_was_cut_off_is_damaged(tmp_path: Path) -> None:
    path = tmp_path / "truth.json"
    write_truth(truths.EMPTY, path)
    path.write_text(path.read_text(encoding="utf-8")[:-20], encoding="utf-8")
    with pytest.raises(TruthError, match="a damaged ground truth"):
        read_truth(path)


@pytest.mark.parametrize(
    ("changed", "what"),
    [
        ({"version": 2}, "of version 2, newer than"),
        ({"version": None}, "damaged.*version None"),
        ({"objects": None}, "damaged"),
        ({"objects": [{"id": "a"}]}, "damaged.*missing"),
        ({"questions": [{"text": "mug", "answer": ["mug-1"]}]}, "damaged.*there is no object 'mug-1'"),
        ({"questions": [{"text": 3, "answer": []}]}, "damaged.*expected a text"),
    ],
)
def test_what_does_not_fit_is_told(tmp_path: Path, changed: dict[str, object], what: str) -> None:
    path = tmp_path / "truth.json"
    path.write_text(json.dumps(to_document(truths.EMPTY) | changed), encoding="utf-8")
    with pytest.raises(TruthError, match=what):
        read_truth(path)
