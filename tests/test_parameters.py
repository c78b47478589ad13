"""The method's parameters, all together."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from pathlib import Path

import numpy as np
import pytest

import supermap_cli
from supermap_cli.errors import ConfigError
from supermap_cli.graph.parameters import GraphParameters
from supermap_cli.mapping.mask_core import erode
from supermap_cli.mapping.parameters import MappingParameters
from supermap_cli.parameters import MethodParameters

HOUSE = Path(supermap_cli.__file__).parent
ROWS = list(MethodParameters().describe())


def test_every_set_is_that_of_a_file_and_no_two_files_share_a_name() -> None:
    files = [(group, own.name) for group in (MappingParameters, GraphParameters) for own in fields(group)]
    assert len({name for _, name in files}) == len(files)
    for group, name in files:
        folder = "mapping" if group is MappingParameters else "graph"
        assert any((HOUSE / place / f"{name}.py").is_file() for place in (folder, "types"))


@pytest.mark.parametrize("row", ROWS, ids=lambda row: f"{row.file}.{row.name}")
def test_every_parameter_says_its_unit_meaning_and_source(row) -> None:
    assert row.unit
    assert row.meaning
    assert row.source
    assert not row.overridden


def test_every_default_may_be_given() -> None:
    given: dict[str, dict[str, object]] = {}
    for row in ROWS:
        given.setdefault(row.file, {})[row.name] = list(row.value) if isinstance(row.value, tuple) else row.value
    assert MethodParameters.from_overrides(given) == MethodParameters()


def test_overrides_reach_both_groups_and_what_uses_them() -> None:
    changed = MethodParameters.from_overrides({"mask_core": {"max_cut": 0.1}, "scene_graph": {"reach_m": 3}})
    assert changed.graph.scene_graph.reach_m == 3.0
    assert changed.mapping.lifting_sets().mask_core.max_cut == 0.1
    mask = np.ones((40, 40), bool)
    assert erode(mask, 6, changed.mapping.mask_core).sum() != erode(mask, 6).sum()


def test_an_unknown_file_is_named_with_those_of_both_groups_that_are_near() -> None:
    with pytest.raises(ConfigError, match="is it predicates"):
        MethodParameters.from_overrides({"predicate": {}})


def test_a_confidence_that_nothing_reaches_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"min_confidence is 0\.99, and no object can be surer than 0\.967"):
        MethodParameters.from_overrides({"lifecycle": {"min_confidence": 0.99}})
    surer = {"belief": {"max_existence": 20.0}, "lifecycle": {"min_confidence": 0.99}}
    assert MethodParameters.from_overrides(surer).mapping.lifecycle.min_confidence == 0.99


def test_all_sets_are_frozen_values() -> None:
    for group in (MappingParameters(), GraphParameters()):
        for own in fields(group):
            values = getattr(group, own.name)
            assert is_dataclass(values)
            assert hash(values) == hash(type(values)())
