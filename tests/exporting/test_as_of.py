"""`supermap export --at`: every format agrees with `supermap show --at`, including unknown presence."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from jsonschema import Draft202012Validator
from plyfile import PlyData

from supermap_cli.types.memory import MapDelta
from supermap_schema.json_schemas import load_schema
from support import kitchen
from support import memories as m
from support.cli import document, supermap

TIMES = ("0 s", "40 s", "99 s", "500 s", "1000.5 s", "1002 s", "1090 s", "monday", "tuesday")
CHANGED_CUPS = (11, 12, 13, 14)
"""A cup that is labelled mug later, one that left in a gap, one that was lost, one that moved in a gap."""


@dataclass(frozen=True)
class InstanceValues:
    """The exported values of one instance as of a time."""

    presence: str
    label: str
    position: tuple[float, ...]
    not_before_ns: int | None
    not_after_ns: int | None


@pytest.fixture(scope="module")
def db(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_gaps(tmp_path_factory.mktemp("gaps") / "map.db")


def make_gaps(path: Path) -> Path:
    """The kitchen, with instances that changed while they were not in view."""
    renamed, left, lost, moved = CHANGED_CUPS
    monday, tuesday = kitchen.MONDAY, kitchen.TUESDAY
    first = MapDelta(
        keyframes=m.keyframes([2, 41, 91]),
        instances=tuple(m.instance(number, "cup", (number, 0, 0.5), seen=monday) for number in CHANGED_CUPS),
        observations=tuple(m.observation(number, at, "cup") for number in CHANGED_CUPS for at in (2, 41, 91)),
        states=tuple(m.state(number, 0, monday, (number, 0, 0.5), label="cup") for number in CHANGED_CUPS),
        visits=tuple(m.visit(number, 3, 3, 0, monday) for number in CHANGED_CUPS),
    )
    second = MapDelta(
        keyframes=m.keyframes([1002, 1041, 1091]),
        instances=(
            m.instance(renamed, "mug", (renamed, 0, 0.5), seen=(1, 1090)),
            m.instance(left, "cup", (left, 0, 0.5), seen=monday, presence="absent"),
            m.instance(lost, "cup", (lost, 0, 0.5), seen=monday, presence="absent"),
            m.instance(moved, "cup", (moved, 5, 0.5), seen=(1, 1090)),
        ),
        observations=(
            *(m.observation(renamed, at, "mug") for at in (1002, 1041, 1091)),
            *(m.observation(moved, at, "cup") for at in (1002, 1041, 1091)),
        ),
        states=(
            m.state(renamed, 0, (1, 1090), (renamed, 0, 0.5), label="mug"),
            m.state(left, 0, monday, (left, 0, 0.5), gone=1005, label="cup"),
            m.state(moved, 0, monday, (moved, 0, 0.5), label="cup", gone=1001),
            m.state(moved, 1, tuesday, (moved, 5, 0.5), label="cup", empty_before=90),
        ),
        visits=(
            *(m.visit(number, 3, 3, 0, tuesday) for number in (renamed, moved)),
            *(m.visit(number, 0, 3, 3) for number in (left, lost)),
        ),
    )
    days = (("monday", (0, 100), kitchen.monday, first), ("tuesday", (1000, 1100), kitchen.tuesday, second))
    with m.open_store(str(path), create=True) as store:
        for name, span, *deltas in days:
            m.add_traversal(store, name, span, *deltas)
    return path


def shown(db: Path, at: str, *presences: str) -> dict[str, InstanceValues]:
    """The instances that `show --at` lists as present or unknown, by id."""
    printed = document("show", "show", "--db", db, "--at", at)
    by_id = {
        instance["id"]: InstanceValues(
            instance["presence"],
            instance["label"],
            tuple(instance["position"]),
            instance["standing"]["not_before_ns"],
            instance["standing"]["not_after_ns"],
        )
        for instance in (*printed["instances"], *printed["unknown"])
    }
    return {id_: values for id_, values in by_id.items() if not presences or values.presence in presences}


def exported(db: Path, at: str, format_: str, *options: str) -> Any:
    result = supermap("export", "--db", db, "--out", "-", "--format", format_, "--at", at, *options)
    assert result.exit_code == 0, result.output or repr(result.exception)
    return json.loads(result.stdout)


def in_document(db: Path, at: str, *options: str) -> dict[str, InstanceValues]:
    found = exported(db, at, "json", *options)
    Draft202012Validator(load_schema("export")).validate(found)
    assert all(instance["presence"] == instance["standing"]["presence"] for instance in found["instances"])
    return {
        instance["id"]: InstanceValues(
            instance["presence"],
            instance["label"],
            tuple(instance["position"]),
            instance["standing"]["not_before_ns"],
            instance["standing"]["not_after_ns"],
        )
        for instance in found["instances"]
    }


def in_geojson(db: Path, at: str, *options: str) -> dict[str, InstanceValues]:
    features = (properties["properties"] for properties in exported(db, at, "geojson", *options)["features"])
    return {
        properties["id"]: InstanceValues(
            properties["presence"],
            properties["label"],
            (properties["x"], properties["y"], properties["z"]),
            properties["not_before_ns"],
            properties["not_after_ns"],
        )
        for properties in features
        if properties["kind"] == "object"
    }


def in_tables(db: Path, out: Path, at: str) -> tuple[dict[str, InstanceValues], dict[str, InstanceValues]]:
    """By `instances.csv`, and by `states.csv`."""
    result = supermap("export", "--db", db, "--out", out, "--format", "csv", "--at", at)
    assert result.exit_code == 0, result.output or repr(result.exception)
    tables = []
    for name in ("instances", "states"):
        with (out / f"{name}.csv").open(newline="") as file:
            tables.append({row["id"]: values_of_row(row) for row in csv.DictReader(file)})
    return tables[0], tables[1]


def values_of_row(row: dict[str, str]) -> InstanceValues:
    place = tuple(float(row[axis]) for axis in "xyz")
    low_ns, high_ns = (int(row[name]) if row[name] else None for name in ("not_before_ns", "not_after_ns"))
    return InstanceValues(row["presence"], row["label"], place, low_ns, high_ns)


def presences(by_id: dict[str, InstanceValues]) -> set[str]:
    return {values.presence for values in by_id.values()}


def test_the_test_map_has_unknown_presence(db: Path) -> None:
    """Otherwise the tests below would not cover unknown presence."""
    assert presences(shown(db, "500 s")) == {"present", "unknown"}
    assert {values.label for values in shown(db, "tuesday").values()} - {
        values.label for values in shown(db, "monday").values()
    }


@pytest.mark.parametrize("at", TIMES)
def test_the_document_says_what_show_says(db: Path, at: str) -> None:
    assert in_document(db, at) == shown(db, at)


@pytest.mark.parametrize("at", TIMES)
def test_the_plan_says_what_show_says(db: Path, at: str) -> None:
    assert in_geojson(db, at) == shown(db, at)


@pytest.mark.parametrize("at", TIMES)
def test_the_tables_say_what_show_says(db: Path, tmp_path: Path, at: str) -> None:
    instances, states = in_tables(db, tmp_path / "tables", at)
    assert instances == shown(db, at)
    assert {id_: (values.presence, values.position) for id_, values in states.items()} == {
        id_: (values.presence, values.position) for id_, values in instances.items()
    }


@pytest.mark.parametrize("at", TIMES)
def test_the_cloud_says_what_show_says(db: Path, tmp_path: Path, at: str) -> None:
    result = supermap("export", "--db", db, "--out", tmp_path / "cloud.ply", "--at", at)
    assert result.exit_code == 0, result.output
    read = PlyData.read(tmp_path / "cloud.ply")
    words = [comment.split() for comment in read.comments]
    ids = {words[1]: words[2] for words in words if words[0] == "instance" and words[3] == "label"}
    presence_by_id = {
        ids[words[1]]: words[3].rstrip(":") for words in words if words[0] == "instance" and words[2] == "is"
    }
    labels = {words[1]: " ".join(words[2:]) for words in words if words[0] == "label"}
    label_by_id = {words[2]: labels[words[4]] for words in words if words[0] == "instance" and words[3] == "label"}
    expected = shown(db, at)
    assert presence_by_id == {id_: values.presence for id_, values in expected.items()}
    assert label_by_id == {id_: values.label for id_, values in expected.items()}
    assert {int(number) for number in ids} == set(np.unique(read["vertex"]["instance"]))


@pytest.mark.parametrize("at", TIMES)
def test_only_certain_presence_is_exported_as_present(db: Path, at: str) -> None:
    assert in_geojson(db, at, "--present") == shown(db, at, "present")


@pytest.mark.parametrize("at", TIMES)
def test_all_includes_absent_instances(db: Path, at: str) -> None:
    found = in_document(db, at, "--all")
    absent = {id_ for id_, values in found.items() if values.presence == "absent"}
    assert len(absent) == document("show", "show", "--db", db, "--at", at)["absent"]
    assert {id_: values for id_, values in found.items() if id_ not in absent} == shown(db, at)


def test_what_a_traversal_saw_is_exported_as_present_at_its_end(db: Path) -> None:
    assert in_document(db, "monday")["cup-1"].presence == "present"
    assert in_document(db, "500 s")["cup-1"].presence == "unknown"
    assert "cup-1" not in in_document(db, "tuesday")


def test_labels_are_selected_as_of_the_time(db: Path) -> None:
    def found(at: str, label: str) -> Iterable[str]:
        return in_document(db, at, "--label", label).keys()

    mug = next(id_ for id_, values in in_document(db, "tuesday").items() if values.label == "mug")
    assert mug in found("monday", "cup")
    assert mug not in found("monday", "mug")
    assert mug in found("tuesday", "mug")
    assert mug not in found("tuesday", "cup")


def test_geojson_and_json_tell_their_time(db: Path) -> None:
    assert exported(db, "monday", "geojson")["supermap"]["as_of"] == "monday"
    selection = exported(db, "monday", "json")["selection"]
    assert (selection["as_of"], selection["at_ns"]) == ("monday", m.ns(100))


def test_what_was_seen_later_is_not_counted(db: Path) -> None:
    then, today = (
        {instance["id"]: instance for instance in exported(db, at, "json")["instances"]} for at in ("monday", "tuesday")
    )
    table = "dining-table-1"
    assert (then[table]["observation_count"], today[table]["observation_count"]) == (3, 6)
    assert (then[table]["last_seen_ns"], today[table]["last_seen_ns"]) == (m.ns(90), m.ns(1090))
