"""Typed questions as JSON, and back: what a program asks that has understood the words itself.

Every value of `language.questions` and `language.times` is an object with its class as `kind` and its fields by name;
what has its default may be left out: ``{"kind": "Count", "things": {"kind": "Things", "noun": {"kind": "Anything"}}}``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import MISSING, Field, fields, is_dataclass
from functools import cache
from types import NoneType, UnionType
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

from supermap_cli.errors import QueryError
from supermap_cli.language import questions, times
from supermap_cli.language.questions import Body, Question
from supermap_cli.language.times import Time

KIND = "kind"
_MOST_NESTED = 40
"""Objects within objects, at most: more than any sentence makes."""
_CURE = "the tool's schema, or `supermap query --explain`, shows typed questions"
_NOT_WRITTEN = frozenset({"written"})
"""A field that need not be given for a noun: how it was typed. Without it, the noun's name."""


@cache
def _classes() -> dict[str, type[Any]]:
    """The classes that a typed question is made of, by name."""
    found = {
        name: value
        for module in (questions, times)
        for name, value in vars(module).items()
        if isinstance(value, type) and is_dataclass(value) and value is not Question
    }
    return dict(sorted(found.items()))


def _types(kind: type[Any]) -> dict[str, Any]:
    """The types of a class's fields, by name."""
    names = vars(questions) | vars(times)
    return get_type_hints(kind, names, names)


def question_from_json(document: object) -> Question:
    """The question of ``{"body": ..., "time": ...}``, or of a body alone. Raises `QueryError`, naming the place, for
    what is none.
    """
    if isinstance(document, Mapping) and "body" in document:
        unknown = sorted(set(map(str, document)) - {"body", "time"})
        if unknown:
            raise _wrong("question", f"there is no field {unknown[0]!r}")
        time = document.get("time")
        body = _read(document["body"], Body, "body")
        return Question("typed question", body, None if time is None else _read(time, Time, "time"))
    return Question("typed question", _read(document, Body, "body"))


def named_in(value: object, kind: type[Any], field: str) -> frozenset[str]:
    """All values of a text field of a class in a typed question: the relations, the uses that it names."""
    if isinstance(value, tuple):
        return frozenset(name for item in value for name in named_in(item, kind, field))
    if not is_dataclass(value) or isinstance(value, type):
        return frozenset()
    own = {getattr(value, field)} if isinstance(value, kind) else set()
    inner = (named_in(getattr(value, each.name), kind, field) for each in fields(value))
    return frozenset(own.union(*inner))


def question_to_json(question: Question) -> dict[str, Any]:
    """The JSON of a question: its body and, where it has one, its time."""
    document = {"body": _written(question.body)}
    return document if question.time is None else {**document, "time": _written(question.time)}


def _written(value: object) -> Any:
    if is_dataclass(value) and not isinstance(value, type):
        given = {own.name: getattr(value, own.name) for own in fields(value)}
        changed = {own.name: given[own.name] for own in fields(value) if given[own.name] != _default(own)}
        return {KIND: type(value).__name__, **{name: _written(content) for name, content in changed.items()}}
    return [_written(item) for item in value] if isinstance(value, tuple) else value


def _default(own: Field[Any]) -> object:
    return own.default


def _read(value: object, expected: Any, where: str) -> Any:
    if where.count(".") > _MOST_NESTED:
        raise _wrong(where[:80], "nested too deeply")
    origin, arguments = get_origin(expected), get_args(expected)
    if origin in {Union, UnionType}:
        return _read_union(value, arguments, where)
    if origin is Literal:
        if value not in arguments:
            raise _wrong(where, f"{_short(value)} is none of {', '.join(map(str, arguments))}")
        return value
    if origin is tuple:
        if not isinstance(value, list | tuple):
            raise _wrong(where, f"a list is needed, not {_short(value)}")
        return tuple(_read(item, arguments[0], f"{where}.{at}") for at, item in enumerate(value))
    if is_dataclass(expected):
        return _read_object(value, (expected,), where)
    return _plain(value, expected, where)


def _read_union(value: object, arguments: tuple[Any, ...], where: str) -> Any:
    if value is None and NoneType in arguments:
        return None
    classes = tuple(argument for argument in arguments if is_dataclass(argument))
    if classes:
        return _read_object(value, classes, where)
    (only,) = (argument for argument in arguments if argument is not NoneType)
    return _read(value, only, where)


def _plain(value: object, expected: Any, where: str) -> Any:
    """A text, number or truth value."""
    if expected is float and isinstance(value, int) and not isinstance(value, bool):
        return float(value)
    if type(value) is not expected:
        raise _wrong(where, f"{expected.__name__} is needed, not {_short(value)}")
    if isinstance(value, float) and not abs(value) < 1e12:
        raise _wrong(where, "a finite number is needed")
    return value


def _read_object(value: object, allowed: tuple[Any, ...], where: str) -> Any:
    if not isinstance(value, Mapping):
        raise _wrong(where, f"an object is needed, not {_short(value)}")
    names = [kind.__name__ for kind in allowed]
    named = value.get(KIND, names[0] if len(names) == 1 else None)
    if named not in names:
        raise _wrong(where, f"`{KIND}` is {_short(named)}, but must be one of {', '.join(names)}")
    kind = _classes()[str(named)]
    types = _types(kind)
    own = {field.name: field for field in fields(kind)}
    given = {str(name): content for name, content in value.items() if name != KIND}
    if unknown := sorted(given.keys() - own.keys()):
        raise _wrong(where, f"{named} has no field {unknown[0]!r}; it has {', '.join(own) or 'none'}")
    if "written" in own and "written" not in given and isinstance(given.get("name"), str):
        given["written"] = given["name"]
    missing = [name for name, field in own.items() if name not in given and field.default is MISSING]
    if missing:
        raise _wrong(where, f"{named} needs {missing[0]!r}")
    return kind(**{name: _read(content, types[name], f"{where}.{name}") for name, content in given.items()})


def _wrong(where: str, why: str) -> QueryError:
    return QueryError(f"no typed question: {why}", where=where, cure=_CURE)


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 40 else f"{text[:37]}..."


def typed_question_schema() -> dict[str, Any]:
    """The JSON Schema (draft 2020-12) of what `question_from_json` reads."""
    parts = {name: _class_schema(kind) for name, kind in _classes().items()}
    time = {"anyOf": [_schema(Time), {"type": "null"}]}
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "Typed question",
        "type": "object",
        "properties": {"body": _schema(Body), "time": time},
        "required": ["body"],
        "additionalProperties": False,
        "$defs": parts,
    }


def _class_schema(kind: type[Any]) -> dict[str, Any]:
    own = fields(kind)
    types = _types(kind)
    needed = [each.name for each in own if each.default is MISSING and each.name not in _NOT_WRITTEN]
    return {
        "description": " ".join((kind.__doc__ or "").split()),
        "type": "object",
        "properties": {KIND: {"const": kind.__name__}, **{each.name: _schema(types[each.name]) for each in own}},
        "required": [KIND, *needed],
        "additionalProperties": False,
    }


def _schema(expected: Any) -> dict[str, Any]:
    origin, arguments = get_origin(expected), get_args(expected)
    if origin in {Union, UnionType}:
        return {"anyOf": [_schema(argument) for argument in arguments]}
    if origin is Literal:
        return {"enum": list(arguments)}
    if origin is tuple:
        return {"type": "array", "items": _schema(arguments[0])}
    if is_dataclass(expected):
        assert isinstance(expected, type)  # noqa: S101 - annotations are classes
        return {"$ref": f"#/$defs/{expected.__name__}"}
    return {"type": {str: "string", int: "integer", float: "number", bool: "boolean", NoneType: "null"}[expected]}
