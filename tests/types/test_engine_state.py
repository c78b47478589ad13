"""What the engine stores of an object for the next build."""

from __future__ import annotations

import math

import pytest

from supermap_cli.errors import MemoryStoreError
from supermap_cli.types.engine_state import EngineState

STATE = EngineState({"chair": 4.0, "stool": 0.5}, 6.0, {"1,1,1": (3, 4, 2.5, 3.5, 1.5)}, 0, 10, None, None, 1.5)


def test_it_is_read_as_it_was_written() -> None:
    assert EngineState.of(STATE.to_document()) == STATE


def test_that_of_version_0_1_held_log_likelihoods_instead_of_counts() -> None:
    document = STATE.to_document()
    del document["label_counts"], document["label_weight"]
    logs = {"chair": -18.0 + 4 * math.log(20), "stool": -18.0}
    read = EngineState.of(document | {"label_logs": logs, "unseen_log": -18.0, "looks": 6.0})
    assert read.label_counts == pytest.approx({"chair": 4.0, "stool": 0.0})
    assert read.label_weight == 6.0


@pytest.mark.parametrize("missing", ["label_counts", "viewpoints", "gone_ns"])
def test_anything_else_is_damage(missing: str) -> None:
    document = STATE.to_document()
    del document[missing]
    with pytest.raises(MemoryStoreError, match="damaged"):
        EngineState.of(document)


def test_cells_without_magnitudes_held_views_that_said_equally_much() -> None:
    document = STATE.to_document()
    assert EngineState.of(document | {"viewpoints": {"1,1,1": [3, 4, 2.5]}}).viewpoints == {
        "1,1,1": (3, 4, 2.5, 2.5, 0.625)
    }
