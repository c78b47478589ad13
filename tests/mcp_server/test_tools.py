"""The tools through the SDK's own client, within this process."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import anyio
import pytest
from jsonschema import Draft202012Validator
from mcp import types
from mcp.client.client import Client

from supermap_cli.language.typed_json import typed_question_schema
from supermap_cli.mcp_server.server import make_server
from supermap_cli.memory import open_store
from supermap_cli.memory_api import Memory
from supermap_cli.types.memory import MapDelta
from supermap_schema.json_schemas import load_schema
from support import driven_room, kitchen
from support import memories as m

LIMIT_S = 60


@pytest.fixture(scope="module")
def kitchen_db(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return kitchen.make_kitchen(tmp_path_factory.mktemp("mcp") / "kitchen.db")


@pytest.fixture(scope="module")
def memory(kitchen_db: Path) -> Iterator[Memory]:
    with Memory(str(kitchen_db)) as opened:
        yield opened


def session(memory: Memory, *calls: tuple[str, dict[str, Any]]) -> list[Any]:
    """The results of calls in one session."""

    async def run() -> list[Any]:
        with anyio.fail_after(LIMIT_S):
            async with Client(make_server(memory)) as client:
                return [await client.call_tool(name, arguments) for name, arguments in calls]

    return anyio.run(run)


def called(memory: Memory, name: str, **arguments: Any) -> Any:
    (result,) = session(memory, (name, arguments))
    assert not result.is_error, result.content
    return result.structured_content


def refused(memory: Memory, name: str, **arguments: Any) -> str:
    (result,) = session(memory, (name, arguments))
    assert result.is_error
    return str(result.content[0].text)


def test_every_tool_is_described_read_only_and_typed(memory: Memory) -> None:
    async def tools() -> list[Any]:
        async with Client(make_server(memory)) as client:
            return list((await client.list_tools()).tools)

    listed = anyio.run(tools)
    assert {tool.name for tool in listed} == {
        *("query", "ask_typed", "list_objects", "show", "history", "diff", "changes_since", "relations_around"),
        *("places_not_seen_since", "navigate", "goal_near", "crop", "keyframe"),
    }
    for tool in listed:
        Draft202012Validator.check_schema(tool.input_schema)
        assert tool.description
        assert tool.annotations
        assert tool.annotations.read_only_hint
        described = tool.input_schema["properties"].values()
        assert all("description" in each or "$ref" in each or each.get("title") for each in described)


def without(document: dict[str, Any], *names: str) -> dict[str, Any]:
    return {name: value for name, value in document.items() if name not in names}


def test_an_answer_is_that_of_the_command_line_with_what_an_agent_needs(memory: Memory) -> None:
    found = called(memory, "query", question="vase on the table")
    answer = without(found, "last_looked_at", "memory")
    Draft202012Validator(load_schema("answer")).validate(answer)
    assert answer["message"] == memory.query("vase on the table").message
    assert found["memory"]["seen_until_ns"] == m.ns(1090)
    assert found["last_looked_at"]["vase-1"]["traversal"] == "tuesday"


def test_a_typed_question_has_the_answer_of_its_words(memory: Memory) -> None:
    typed = {"kind": "Count", "things": {"kind": "Things", "noun": {"kind": "Named", "name": "chair"}}}
    in_words = called(memory, "query", question="how many chairs")
    assert called(memory, "ask_typed", question={"body": typed})["message"] == in_words["message"]
    assert called(memory, "ask_typed", question=typed)["count"] == in_words["count"]


def test_the_schema_of_typed_questions_is_that_of_the_resource(memory: Memory) -> None:
    async def read() -> tuple[Any, Any]:
        async with Client(make_server(memory)) as client:
            tools = {tool.name: tool for tool in (await client.list_tools()).tools}
            resource = await client.read_resource("supermap://schemas/typed_question")
            return tools["ask_typed"].input_schema, resource.contents[0]

    schema, resource = anyio.run(read)
    assert isinstance(resource, types.TextResourceContents)
    assert json.loads(resource.text) == json.loads(json.dumps(typed_question_schema()))
    assert schema["properties"]["question"]["properties"]["body"] == typed_question_schema()["properties"]["body"]
    assert set(typed_question_schema()["$defs"]) <= set(schema["$defs"])


@pytest.mark.parametrize(
    ("name", "arguments", "said"),
    [
        ("query", {"question": "flibber"}, "flibber"),
        ("query", {"question": "chair", "at": "thursday"}, "there are"),
        ("query", {"question": "chair", "limit": 0}, "limit"),
        ("ask_typed", {"question": {"body": {"kind": "Count"}}}, "needs 'things'"),
        ("show", {"id": "chair-99"}, "no object"),
        ("crop", {"id": "chair-1"}, "no picture"),
        ("keyframe", {"stamp_ns": 5}, "evidence.keyframes_ns"),
        ("goal_near", {"x": 1e300, "y": 0}, "x"),
        ("navigate", {"instruction": "sing"}, ""),
    ],
)
def test_an_error_is_a_tool_error_that_says_what_to_do(
    memory: Memory, name: str, arguments: dict[str, Any], said: str
) -> None:
    assert said in refused(memory, name, **arguments)


def test_what_has_gone_and_what_nobody_knows_is_told(memory: Memory) -> None:
    gone = called(memory, "query", question="where is the cup")
    assert not gone["instances"]
    assert gone["nearest"][0]["presence"] == "absent"
    then = called(memory, "list_objects", at="monday")
    assert {each["id"] for each in then["instances"]} >= {"cup-1", "chair-1"}
    changed = called(memory, "changes_since", since="monday")
    assert {"cup-1", "chair-1", "vase-1"} <= {change["id"] for change in changed["changes"]}


def test_places_that_nobody_has_looked_at(memory: Memory) -> None:
    found = called(memory, "places_not_seen_since", since="now")
    assert found["places"]
    assert all(place["last_seen_ns"] <= found["since_ns"] for place in found["places"])
    seen_on_tuesday = {place["id"] for place in called(memory, "places_not_seen_since", since="monday")["places"]}
    assert "vase-1" not in seen_on_tuesday


def test_listed_things_are_limited_and_the_rest_counted(memory: Memory) -> None:
    few = called(memory, "list_objects", limit=2)
    assert len(few["instances"]) == 2
    assert few["more"] == len(memory.objects()) - 2
    assert called(memory, "diff", limit=1)["more"] > 0


def test_navigation_and_pictures_of_a_rendered_room(tmp_path: Path) -> None:
    with Memory(str(driven_room.write_map(tmp_path / "room.db"))) as memory:
        route, pose, ambiguous = session(
            memory,
            ("navigate", {"instruction": "go to the ball, then to the cup"}),
            ("goal_near", {"x": 0.0, "y": 0.0}),
            ("navigate", {"instruction": "go to the chair"}),
        )
    assert [waypoint["status"] for waypoint in route.structured_content["waypoints"]] == ["ready", "gone"]
    assert "cup-1" in route.structured_content["last_looked_at"]
    assert pose.structured_content["distance_m"] < 1.5  # the table stands there
    assert len(ambiguous.structured_content["waypoints"][0]["candidates"]) == 2


def test_what_a_build_writes_meanwhile_is_in_the_next_answer(tmp_path: Path) -> None:
    db = m.make_memory(tmp_path / "growing.db", ("first", (0, 10), MapDelta(keyframes=m.keyframes([1, 2]))))
    with Memory(str(db)) as memory:
        before = called(memory, "query", question="how many things are there")
        with open_store(str(db)) as store:
            traversal = store.begin_traversal(m.start("second", (20, 30)))
            delta = MapDelta(
                keyframes=m.keyframes([21, 22]),
                instances=(m.instance(1, "chair", seen=(21, 22), observations=2),),
                observations=(m.observation(1, 21), m.observation(1, 22)),
                states=(m.state(1, 0, (21, 22)),),
                visits=(m.visit(1, 2, 2, 0, (21, 22)),),
            )
            store.commit(traversal, delta)
            during = called(memory, "query", question="how many things are there")  # the writer holds its lock
            store.finish_traversal(traversal, {})
    assert (before["count"], during["count"]) == (0, 1)
    assert during["memory"]["being_built"]
