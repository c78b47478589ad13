"""What is declared is used, what is used is declared, and what the program reads is in the wheel."""

from __future__ import annotations

import ast
import re
import shutil
import subprocess
import sys
import tomllib
import zipfile
from collections.abc import Iterator
from importlib.metadata import packages_distributions
from importlib.resources import files
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).resolve().parents[1]
PROJECT = tomllib.loads((CHECKOUT / "pyproject.toml").read_text(encoding="utf-8"))
OWN = {
    path.parent.name: path.parent
    for root in (CHECKOUT, CHECKOUT / "plugins", CHECKOUT / "schema")
    for path in root.glob("supermap_*/__init__.py")
}
READ_AT_RUN_TIME = [
    ("supermap_cli.language.grammars", "en.lark"),
    ("supermap_cli.language.lexicons", "en.tsv"),
    ("supermap_cli.language.lexicons", "de.toml"),
    ("supermap_cli.language.lexicons", "WORDNET-LICENSE.txt"),
    ("supermap_cli.mapping", "class_sizes.toml"),
    ("supermap_cli.simulation.detection", "look_alikes.toml"),
    ("supermap_cli.weights", "catalogue.toml"),
    ("supermap_onnx", "coco80.txt"),
    ("supermap_schema.json_schemas", "answer.schema.json"),
    ("supermap_schema.json_schemas", "definitions.json"),
    ("supermap_schema.migrations", "env.py"),
    ("supermap_schema.migrations", "script.py.mako"),
]


FOR_DEVELOPERS = {"dev", "perception-tests"}
"""Extras with what tests need and the program does not import."""


def normal(distribution: str) -> str:
    """A distribution's name as it is compared."""
    return re.sub(r"[-_.]+", "-", distribution).lower()


def declared() -> set[str]:
    """The distributions that the project depends on, those that it can do without among them."""
    optional = PROJECT["project"]["optional-dependencies"]
    lines = [
        *PROJECT["project"]["dependencies"],
        *(line for extra in optional if extra not in FOR_DEVELOPERS for line in optional[extra]),
    ]
    return {normal(re.split(r"[<>=!~;\[ ]", line)[0]) for line in lines}


def imported() -> set[str]:
    """Top-level names that the program imports, by statement or by `importlib.import_module("...")`."""
    return {name for folder in OWN.values() for path in folder.rglob("*.py") for name in imports_of(path)}


def imports_of(path: Path) -> Iterator[str]:
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        match node:
            case ast.Import(names=names):
                yield from (alias.name.partition(".")[0] for alias in names)
            case ast.ImportFrom(module=str(module), level=0):
                yield module.partition(".")[0]
            case ast.Call(func=ast.Attribute(attr="import_module"), args=[ast.Constant(value=str(module))]):
                yield module.partition(".")[0]


def test_every_dependency_is_used():
    providers = packages_distributions()
    used = {normal(provider) for name in imported() for provider in providers.get(name, ())}
    assert declared() - used == set()


def test_everything_imported_is_declared():
    foreign = imported() - set(sys.stdlib_module_names) - OWN.keys()
    providers = packages_distributions()
    undeclared = {
        name for name in foreign if not declared() & {normal(provider) for provider in providers.get(name, ())}
    }
    assert undeclared == set()


def test_every_first_party_plugin_is_an_entry_point_and_is_checked():
    plugins = {path.name for path in (CHECKOUT / "plugins").glob("supermap_*")}
    tools = PROJECT["tool"]
    assert set(PROJECT["project"]["entry-points"]["supermap"].values()) == plugins
    assert set(tools["mypy"]["packages"]) == OWN.keys()
    assert set(tools["importlinter"]["root_packages"]) == OWN.keys()


@pytest.mark.parametrize(("package", "name"), READ_AT_RUN_TIME)
def test_package_data_is_found_where_it_is_installed(package, name):
    assert files(package).joinpath(name).read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> frozenset[str]:
    """The names of the files in a wheel built from what is checked out."""
    source, target = tmp_path_factory.mktemp("source") / "supermap", tmp_path_factory.mktemp("wheel")
    source.mkdir()
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(CHECKOUT / name, source)
    ignored = shutil.ignore_patterns("__pycache__", "*.egg-info")
    for folder in ("supermap_cli", "plugins", "schema"):
        shutil.copytree(CHECKOUT / folder, source / folder, ignore=ignored)
    subprocess.run(
        [
            *(sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation", "--no-index"),
            *("--disable-pip-version-check", "--wheel-dir", str(target), str(source)),
        ],
        check=True,
        timeout=300,
    )
    (built,) = target.glob("supermap_cli-*.whl")
    return frozenset(zipfile.ZipFile(built).namelist())


def test_whatever_lies_in_a_package_is_in_the_wheel(wheel):
    ours = {
        path.relative_to(folder.parent).as_posix()
        for folder in OWN.values()
        for path in folder.rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }
    assert ours - wheel == set()


def test_nothing_else_is_in_the_wheel(wheel):
    tops = {name.partition("/")[0] for name in wheel}
    assert {top for top in tops if not top.endswith(".dist-info")} == OWN.keys()


@pytest.mark.parametrize("package", sorted(OWN))
def test_every_package_says_that_it_is_typed(wheel, package):
    assert f"{package}/py.typed" in wheel
