"""An engine as bytes and back: it goes on as if nothing had happened, with the parameters it is given."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

import numpy as np
import pytest

from supermap_cli.mapping.engine import MappingEngine
from supermap_cli.mapping.parameters import MappingParameters
from supermap_cli.mapping.snapshot import engine_snapshot, restore_engine
from supermap_cli.types.packing import PackingError
from support import scenes as s

FIRST = (*s.ROOM, s.TABLE, s.CUP, s.CHAIR.at(1.6, -1.0), s.PERSON.at(2.2, 1.2))
THEN = (*s.ROOM, s.TABLE, s.CUP.at(1.4, 0.4), s.CHAIR.at(1.6, 1.0))


def atoms(value: object) -> Iterator[object]:
    """Everything a value holds, comparable."""
    if dataclasses.is_dataclass(value):
        for field in dataclasses.fields(value):
            yield from atoms(getattr(value, field.name))
    elif isinstance(value, np.ndarray):
        yield value.tobytes()
    elif isinstance(value, dict):
        for key, item in value.items():
            yield key
            yield from atoms(item)
    elif isinstance(value, tuple | list):
        for item in value:
            yield from atoms(item)
    else:
        yield value


@pytest.fixture(scope="module")
def run() -> s.Run:
    """A run in the middle of things, written up to now."""
    run = s.Run()
    run.walk(FIRST, 5)
    run.walk(THEN, 2)
    run.take()
    return run


def test_a_restored_engine_goes_on_as_the_other_one_does(run: s.Run) -> None:
    snapshot = engine_snapshot(run.engine)
    restored = restore_engine(snapshot, free_space=run.engine.free_space)
    assert engine_snapshot(restored) == snapshot
    deltas = []
    for engine in (restored, restore_engine(snapshot, free_space=run.engine.free_space), run.engine):
        going_on = s.Run(engine=engine, at_s=run.at_s)
        going_on.walk(THEN, 4)
        deltas.append(list(atoms(going_on.take())))
    assert deltas[0] == deltas[1] == deltas[2]


def test_a_restored_engine_has_the_parameters_it_is_given(run: s.Run) -> None:
    parameters = MappingParameters.from_overrides({"belief": {"max_existence": 3.0}, "recall": {"prior_rate": 0.9}})
    engine = restore_engine(engine_snapshot(run.engine), parameters=parameters)
    assert engine.recall.parameters.prior_rate == 0.9
    assert {obj.existence.viewpoints.parameters.max_existence for obj in engine.objects} == {3.0}
    assert {obj.labels.parameters.max_existence for obj in engine.objects} == {3.0}
    assert {obj.motion.parameters for obj in engine.objects} == {parameters.motion}


def test_a_new_engine_with_other_parameters_maps_otherwise() -> None:
    parameters = MappingParameters.from_overrides({"lifecycle": {"confirm_observations": 50}})
    strict = s.Run(engine=MappingEngine(parameters=parameters))
    strict.walk(FIRST, 5)
    assert strict.map == {}


def test_bytes_that_are_no_snapshot_are_refused() -> None:
    with pytest.raises(PackingError):
        restore_engine(b"nothing")
