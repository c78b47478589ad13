"""Whether a build goes on from one that was stopped by an earlier version."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from supermap_cli.config import BuildConfig
from supermap_cli.drivers.stopped_builds import check_built_alike
from supermap_cli.errors import ConfigError
from supermap_cli.memory.values import StoredTraversal
from supermap_cli.parameters import stored_config


def stopped(config: dict[str, Any]) -> StoredTraversal:
    fields = dict.fromkeys(StoredTraversal.__dataclass_fields__)
    return replace(StoredTraversal(**fields), config=config, versions={}, name="run")  # type: ignore[arg-type]


def now(**recording: Any) -> dict[str, Any]:
    config = BuildConfig.model_validate({"recording": recording})
    return {"build": stored_config(config), "versions": {}, "name": "run"}


def old_config() -> dict[str, Any]:
    """Of a version without tolerances of detections, limits, windows and one of the method's files."""
    config: dict[str, Any] = stored_config(BuildConfig())
    for entry in ("detection_tolerance_s", "limits", "start_s", "end_s"):
        del config["recording"][entry]
    del config["parameters"]["drift"]
    del config["keyframes"]["total_rate_hz"]
    return config


def test_what_the_configuration_did_not_have_had_its_default() -> None:
    check_built_alike(stopped(old_config()), now(), "run.mcap")


def test_a_window_is_told_by_the_fingerprint_wherever_it_was_given() -> None:
    check_built_alike(stopped(old_config()), now(start_s=1.0, end_s=2.0), "run.mcap")


def test_another_value_than_the_default_is_still_another_build() -> None:
    with pytest.raises(ConfigError, match=r"build.recording.detection_tolerance_s was 0.001, now 0.5"):
        check_built_alike(stopped(old_config()), now(detection_tolerance_s=0.5), "run.mcap")
