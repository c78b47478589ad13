"""Questions to a small kitchen, and their answers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from supermap_cli.errors import QueryError
from supermap_cli.language.questions import Find, Named, Question, Things
from supermap_cli.memory import open_store
from supermap_cli.query.answers import Answer, answer, answer_question
from supermap_cli.types.memory import MapDelta
from support import kitchen
from support import memories as m

Ask = Callable[[str], Answer]


@pytest.fixture(scope="module")
def kitchen_map(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return kitchen.make_kitchen(tmp_path_factory.mktemp("kitchen") / "map.db")


@pytest.fixture(scope="module")
def ask(kitchen_map: Path) -> Ask:
    def answered(text: str) -> Answer:
        with open_store(str(kitchen_map), read_only=True) as store, store.reader() as reader:
            return answer(text, reader)

    return answered


@pytest.mark.parametrize(
    ("question", "ids"),
    [
        ("chairs", ["chair-1", "chair-2"]),
        ("table", ["dining-table-1"]),
        ("cup", []),
        ("cup last", ["cup-1"]),
        ("where was the cup", ["cup-1"]),
        ("cup earlier", ["cup-1"]),
        ("cup in monday", ["cup-1"]),
        ("cup in tuesday", []),
        ("lamp earlier", []),
        ("vase first", ["vase-1"]),
        ("cup on the table", []),
        ("cup on the table earlier", ["cup-1"]),
        ("cup on the table in monday", ["cup-1"]),
        ("cup on the table last", ["cup-1"]),
        ("cup on the table at 09:01", ["cup-1"]),
        ("cup on the table at 09:17", []),
        ("what is on the table", ["vase-1"]),
        ("table under the vase", ["dining-table-1"]),
        ("vase above the table", ["vase-1"]),
        ("chair near plant", []),
        ("chair near plant earlier", ["chair-1"]),
        ("plant near chair earlier", ["potted-plant-1"]),
        ("chair next to the table first", ["chair-1"]),
        ("chair near tv", ["chair-2"]),
        ("piano", []),
        ("chair near piano", []),
        ("chair-1", ["chair-1"]),
        ("where is the Chair-1?", ["chair-1"]),
        ("cup-1", []),
        ("cup-1 last", ["cup-1"]),
        ("cup on dining-table-1 earlier", ["cup-1"]),
        ("chair-1 near plant earlier", ["chair-1"]),
        ("chair-2 near plant earlier", []),
        ("chair-9", []),
        ("cup in the first traversal", ["cup-1"]),
        ("cup on the table in the first run", ["cup-1"]),
        ("cup in the last traversal", []),
        ("everything near the chair in the first traversal", ["dining-table-1", "cup-1", "tv-1", "potted-plant-1"]),
    ],
)  # fmt: skip
def test_matching_instances(ask: Ask, question: str, ids: list[str]) -> None:
    assert [instance.id for instance in ask(question).instances] == ids


def test_an_answer_says_where_when_and_on_what_evidence(ask: Ask) -> None:
    (cup,) = ask("cup on the table earlier").instances
    assert cup.position == (0.5, 0.0, 0.8)
    assert cup.presence == "absent"
    assert (cup.intervals[0].last_seen_ns, cup.intervals[0].gone_ns) == (m.ns(90), m.ns(1005))
    assert cup.evidence.observation_count == 3
    assert cup.evidence.keyframes_ns == (m.ns(1), m.ns(40), m.ns(90))
    (relation,) = cup.relations
    assert (relation.basis, relation.stored_as) == ("stored", "on(cup-1, dining-table-1)")
    assert (relation.since_ns, relation.until_ns) == (m.ns(1), m.ns(1005))


def test_an_earlier_place_is_given_for_an_earlier_time(ask: Ask) -> None:
    assert ask("chair near plant earlier").instances[0].position == (0.0, 1.0, 0.5)
    assert ask("chairs").instances[0].position == (-3.0, 3.0, 0.5)


def test_boxes_answer_where_no_relation_is_stored_and_the_answer_says_so(ask: Ask) -> None:
    found = ask("chair near tv")
    (relation,) = found.instances[0].relations
    assert (relation.basis, relation.object, relation.distance_m) == ("boxes", "tv-1", pytest.approx(0.7))
    assert "judged by their boxes" in found.message


def test_how_many_gives_a_count(ask: Ask) -> None:
    assert ask("how many chairs").count == 2
    assert ask("how many pianos").count == 0
    assert ask("chairs").count is None


def test_a_gone_instance_is_a_near_miss_with_bounds(ask: Ask) -> None:
    found = ask("where is the cup")
    assert [near_miss.id for near_miss in found.nearest] == ["cup-1"]
    assert "gone between 2026-01-05T09:01:30.0Z and 2026-01-05T09:16:45.0Z" in found.message


def test_an_instance_out_of_reach_is_a_near_miss_with_its_distance(ask: Ask) -> None:
    found = ask("chair on the tv")
    assert found.nearest[0].id == "chair-2"
    assert found.nearest[0].distance_m == pytest.approx(0.7)
    assert found.relation is not None
    assert found.relation.references == ("tv-1",)


@pytest.mark.parametrize(
    ("question", "message"),
    [
        ("piano", "There is no piano in the map."),
        ("chair near piano", "There is no piano in the map."),
        ("is there a piano", "No: there is no piano in the map."),
        ("is there a chair", "Yes: two chairs are in the map: chair-1 and chair-2."),
        ("how many pianos", "There is no piano in the map."),
        (
            "chair-9 near tv",
            (
                "There is no chair-9 in the map (chair-1: last seen 2026-01-05T09:18:10.0Z; "
                "chair-2: last seen 2026-01-05T09:01:30.0Z)."
            ),
        ),
        ("what is on the table", "vase-1 stands on dining-table-1."),
        ("two vases", "vase-1 stands on dining-table-1, at (-0.50, 0.00, 0.90) m."),
    ],
)
def test_messages(ask: Ask, question: str, message: str) -> None:
    assert ask(question).message == message


def test_an_uncertain_label_is_a_near_miss_and_a_misspelling_is_refused(ask: Ask, kitchen_map: Path) -> None:
    with pytest.raises(QueryError, match="do not know the word 'quix'"):
        ask("quix")
    found = ask("where is the vaze")
    assert [instance.id for instance in found.instances] == ["vase-1"]
    assert found.notes == ("'vaze' was read as 'vase'",)
    question = Question("other", Find(Things(Named("other", "other"))))
    with open_store(str(kitchen_map), read_only=True) as store, store.reader() as reader:
        assert "may be a other (10%)" in answer_question(question, reader).nearest[0].reason


def test_an_attribute_that_nobody_can_tell_is_neither_confirmed_nor_denied(ask: Ask) -> None:
    found = ask("red chair")
    assert found.instances == ()
    assert "Nobody can say of chair-1 and chair-2: too little of it was seen to tell its colour" in found.message
    assert ask("is the chair red").verdict == "unknown"


@pytest.mark.parametrize(("question", "lead"), [("anything on the tv", "N"), ("is there anything on the tv", "No: n")])
def test_an_empty_answer_without_a_noun_says_nothing(ask: Ask, question: str, lead: str) -> None:
    assert ask(question).message.startswith(f"{lead}othing is on a tv (")


def test_an_id_that_was_merged_names_what_it_is_part_of(tmp_path: Path) -> None:
    whole, part = m.instance(1, "cup", seen=(1, 9)), m.instance(2, "cup", seen=(1, 1))
    delta = MapDelta(
        keyframes=m.keyframes([1, 9]),
        instances=(whole, replace(part, merged_into=1)),
        states=(m.state(1, 0, (1, 9), label="cup"),),
    )
    path = m.make_memory(tmp_path / "map.db", ("monday", (0, 10), delta))
    with open_store(str(path), read_only=True) as store, store.reader() as reader:
        found = answer("cup-2", reader)
    assert [instance.id for instance in found.instances] == ["cup-1"]
    assert found.notes == ("cup-2 is part of cup-1 today",)


def test_a_time_of_day_says_its_day(ask: Ask) -> None:
    assert ask("cup at 09:01").notes == ("09:01 was taken as 2026-01-05T09:01:00.0Z",)
    assert ask("cup at 2026-01-05T09:01:00Z").notes == ()


@pytest.mark.parametrize("question", ["cup at 09:10", "table under the cup at 09:10"])
def test_a_time_within_an_unknown_gap_is_not_answered_as_certain(ask: Ask, question: str) -> None:
    found = ask(question)
    assert found.instances
    assert found.notes[-1] == (
        "cup-1 left between 2026-01-05T09:01:30.0Z and 2026-01-05T09:16:45.0Z; nobody can say for 09:10"
    )


def test_an_unknown_traversal_names_those_there_are(ask: Ask) -> None:
    with pytest.raises(QueryError, match="1 monday, 2 tuesday"):
        ask("chairs in traversal 9")


def test_what_was_lost_without_a_contradiction_is_never_called_gone(tmp_path: Path) -> None:
    delta = MapDelta(
        keyframes=m.keyframes([1]),
        instances=(m.instance(1, "cup", presence="absent", seen=(1, 1)),),
        states=(m.state(1, 0, (1, 1), label="cup"),),
    )
    path = m.make_memory(tmp_path / "map.db", ("monday", (0, 10), delta))
    with open_store(str(path), read_only=True) as store, store.reader() as reader:
        message = answer("cup", reader).message
    assert "not seen since" in message
    assert "gone" not in message


def test_an_empty_map_answers_too(tmp_path: Path) -> None:
    path = m.make_memory(tmp_path / "map.db", ("monday", (0, 10), MapDelta()))
    with open_store(str(path), read_only=True) as store, store.reader() as reader:
        assert answer("how many chairs near the tv earlier", reader).count == 0


def test_earlier_works_in_a_map_of_one_traversal(tmp_path: Path) -> None:
    delta = MapDelta(
        keyframes=m.keyframes([1, 9]),
        instances=(m.instance(1, "cup", seen=(1, 9)), m.instance(2, "book", seen=(1, 2), presence="absent")),
        states=(m.state(1, 0, (1, 9), label="cup"), m.state(2, 0, (1, 2), (1, 0, 0), gone=3, label="book")),
    )
    path = m.make_memory(tmp_path / "map.db", ("monday", (0, 10), delta))
    with open_store(str(path), read_only=True) as store, store.reader() as reader:
        assert [instance.id for instance in answer("everything earlier", reader).instances] == ["cup-1", "book-1"]


def test_labels_are_those_of_the_selected_time(tmp_path: Path) -> None:
    delta = MapDelta(
        keyframes=m.keyframes([1, 9]),
        instances=(m.instance(1, "bowl", seen=(1, 9)),),
        states=(m.state(1, 0, (1, 2), gone=3, label="cup"), m.state(1, 1, (8, 9), (2, 0, 0), label="cup")),
    )
    path = m.make_memory(tmp_path / "map.db", ("monday", (0, 10), delta))
    with open_store(str(path), read_only=True) as store, store.reader() as reader:
        assert [len(answer(text, reader).instances) for text in ("cup", "bowl", "cup first", "bowl first")] == [
            0,
            1,
            1,
            0,
        ]
