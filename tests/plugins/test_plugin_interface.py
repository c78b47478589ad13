"""Everything a plugin needs is importable from where a third party may import it."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import supermap_cli
from supermap_cli.geometry.boxes import Box3D
from supermap_cli.types.relations import GraphNode, Pair, SpatialPredicate

CHECKOUT = Path(__file__).resolve().parents[2]
INTERFACE = ("protocols", "types", "geometry", "errors", "input_files", "inference", "weights")
"""Modules and packages of `supermap_cli` that plugins import, besides the names in `supermap_cli` itself."""
PLUGIN_FILES = sorted(
    path.relative_to(CHECKOUT)
    for folder in ("plugins", "examples")
    for path in (CHECKOUT / folder).rglob("supermap_*/*.py")
)


def imported_modules(path: Path) -> Iterator[str]:
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        match node:
            case ast.Import(names=names):
                yield from (alias.name for alias in names)
            case ast.ImportFrom(module=str(module), level=0):
                yield module


@pytest.mark.parametrize("path", PLUGIN_FILES, ids=str)
def test_a_plugin_imports_the_interface_only(path: Path) -> None:
    ours = [module.split(".") for module in imported_modules(CHECKOUT / path) if module.split(".")[0] == "supermap_cli"]
    outside = [".".join(parts) for parts in ours if len(parts) > 1 and parts[1] not in INTERFACE]
    assert not outside, f"{path} imports {outside}; plugins import supermap_cli, and of it {', '.join(INTERFACE)}"


@pytest.mark.parametrize("name", ["Options", "RecordingRequest", "Register", "hookimpl"])
def test_the_package_offers_what_registration_needs(name: str) -> None:
    assert name in supermap_cli.__all__
    assert getattr(supermap_cli, name) is not None


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="no attribute 'Detector'"):
        supermap_cli.Detector  # noqa: B018 - the access is what is tested


def test_a_predicate_is_written_with_types_and_geometry_only() -> None:
    def taller_than(pair: Pair, slack: float) -> float:
        return 1.0 if pair.subject.box.size[2] * slack > pair.other.box.size[2] else 0.0

    shelf, cup = (
        GraphNode(number, label, Box3D(np.zeros(3), np.array([0.3, 0.3, height]), 0.0), np.zeros((0, 3)))
        for number, label, height in ((1, "shelf", 2.0), (2, "cup", 0.1))
    )
    predicate = SpatialPredicate("taller than", taller_than)
    assert predicate.holds(Pair(shelf, cup), 1.0) == 1.0
    assert predicate.holds(Pair(cup, shelf), 1.0) == 0.0
