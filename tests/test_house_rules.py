"""Rules of the code that no linter knows: one class name has one meaning, and objects are whole once they are made."""

from __future__ import annotations

import ast
import inspect
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from supermap_cli import errors

CHECKOUT = Path(__file__).resolve().parents[1]
SOURCES = ("supermap_cli", "plugins", "schema")

TABLE_ROWS = {"Checkpoint", "Keyframe", "Observation", "SpatialEdge", "TemporalEdge", "Visit"}
"""Classes of `supermap_schema.models`: the rows of a table have the name of the value that they store."""


@dataclass(frozen=True)
class SourceClass:
    """A class statement and where it stands, relative to the checkout."""

    node: ast.ClassDef
    path: Path

    @property
    def where(self) -> str:
        return f"{self.path}:{self.node.lineno}"


def source_classes() -> list[SourceClass]:
    found = []
    for path in sorted(path for folder in SOURCES for path in (CHECKOUT / folder).rglob("*.py")):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        nodes = [node for node in ast.walk(tree) if isinstance(node, ast.ClassDef)]
        found += [SourceClass(node, path.relative_to(CHECKOUT)) for node in nodes]
    return found


CLASSES = source_classes()


def shared_names() -> dict[str, list[str]]:
    """Class name -> where its classes stand, for names of more than one."""
    places = defaultdict(list)
    for source in CLASSES:
        places[source.node.name].append(source.where)
    return {name: where for name, where in places.items() if len(where) > 1}


def late_attributes() -> dict[str, dict[str, str]]:
    """Class -> attribute -> where it is set, for attributes that exist only after some method has run."""
    by_name = {source.node.name: source.node for source in CLASSES}
    late: dict[str, dict[str, str]] = defaultdict(dict)
    for source in CLASSES:
        declared = declared_attributes(source.node, by_name)
        for method in methods_of(source.node):
            for attribute, line in assigned_to_self(method):
                if attribute not in declared:
                    late[source.node.name].setdefault(attribute, f"{source.path}:{line}")
    return late


def declared_attributes(node: ast.ClassDef, by_name: dict[str, ast.ClassDef]) -> set[str]:
    """What every object of the class has once it is made: fields, class attributes, what `__init__` sets, and
    properties with a setter; those of the bases too.
    """
    declared: set[str] = set()
    fields_have_values = bool(node.decorator_list or node.bases)
    for statement in node.body:
        match statement:
            case ast.AnnAssign(target=ast.Name(id=name), value=value) if value is not None or fields_have_values:
                declared.add(name)
            case ast.Assign(targets=targets):
                declared.update(target.id for target in targets if isinstance(target, ast.Name))
            case ast.FunctionDef(name=name, decorator_list=[ast.Attribute(attr="setter")]):
                declared.add(name)
    for method in methods_of(node):
        if method.name in {"__init__", "__post_init__", "__new__"}:
            declared.update(attribute for attribute, _ in assigned_to_self(method))
    for base in node.bases:
        if isinstance(base, ast.Name) and base.id in by_name and by_name[base.id] is not node:
            declared |= declared_attributes(by_name[base.id], by_name)
    return declared


def methods_of(node: ast.ClassDef) -> Iterator[ast.FunctionDef]:
    yield from (statement for statement in node.body if isinstance(statement, ast.FunctionDef))


def assigned_to_self(method: ast.FunctionDef) -> Iterator[tuple[str, int]]:
    """(attribute, line) of every `self.attribute = ...`, also in tuples, loops and `with`."""
    for node in ast.walk(method):
        match node:
            case ast.Attribute(value=ast.Name(id="self"), attr=attribute, ctx=ast.Store()):
                yield attribute, node.lineno


def test_one_class_name_has_one_meaning() -> None:
    unexpected = {name: where for name, where in shared_names().items() if name not in TABLE_ROWS}
    told = "\n".join(f"  {name}: {', '.join(where)}" for name, where in sorted(unexpected.items()))
    assert not unexpected, f"classes with one name and two meanings; rename one of each:\n{told}"


def test_the_excepted_class_names_are_still_needed() -> None:
    needless = TABLE_ROWS - shared_names().keys()
    assert not needless, f"these names have one class by now; take them out of the exceptions: {sorted(needless)}"


@pytest.mark.parametrize("name", sorted(TABLE_ROWS))
def test_an_excepted_table_row_is_one_of_the_schema_and_shares_its_name_once(name: str) -> None:
    places = shared_names()[name]
    assert len(places) == 2
    assert sum(place.startswith("schema/supermap_schema/models.py") for place in places) == 1


def test_no_attribute_is_born_after_init() -> None:
    late = {
        f"{name}.{attribute}": where
        for name, attributes in late_attributes().items()
        for attribute, where in attributes.items()
    }
    told = "\n".join(f"  {attribute}, {where}" for attribute, where in sorted(late.items()))
    assert not late, f"attributes that do not exist until a method has run; set them in __init__:\n{told}"


MADE_UP = """
class Base:
    def __init__(self):
        self.inherited = 1

class Late(Base):
    limit = 3

    def __init__(self):
        self.whole = []

    def run(self):
        self.limit, self.inherited, self.whole = 1, 2, 3
        self.engine = None
        for self.index in range(3):
            pass
"""


def test_the_check_finds_what_is_set_in_other_methods_only() -> None:
    classes = {node.name: node for node in ast.parse(MADE_UP).body if isinstance(node, ast.ClassDef)}
    declared = declared_attributes(classes["Late"], classes)
    run = next(method for method in methods_of(classes["Late"]) if method.name == "run")
    assert {name for name, _ in assigned_to_self(run)} - declared == {"engine", "index"}


WITHOUT_CURE = {
    "supermap_cli/memory/depth_png.py",  # parts of what `db check` says
    "supermap_cli/plugin_manager.py",  # why a plugin was left out: for its authors
    "supermap_cli/memory/store.py",  # calls in a wrong order, of Python programs
}
"""Files whose errors may say what is wrong and no more."""


def _raised_without_cure(path: Path) -> Iterator[int]:
    names = {name for name, value in vars(errors).items() if inspect.isclass(value)} | {"error_type"}
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call) and isinstance(node.exc.func, ast.Name):
            given = {keyword.arg for keyword in node.exc.keywords}
            if node.exc.func.id in names and "cure" not in given:
                yield node.lineno


def test_every_error_that_a_user_meets_says_how_to_mend_it() -> None:
    paths = [path for folder in SOURCES for path in (CHECKOUT / folder).rglob("*.py")]
    found = {str(path.relative_to(CHECKOUT)): list(_raised_without_cure(path)) for path in paths}
    assert {path: lines for path, lines in found.items() if lines and path not in WITHOUT_CURE} == {}
    assert all(found[path] for path in WITHOUT_CURE)
