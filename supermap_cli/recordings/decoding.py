"""From stored bytes to message objects: ROS CDR and ROS 1 by `rosbags`, JSON and protobuf by their own libraries.

This is the boundary at which bytes that anybody may have written become values: what cannot be one is a `MessageError`
of one line, and `Decoder.read` leaves that message out, counts it and names the first.
"""

from __future__ import annotations

import binascii
import json
import re
import struct
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from functools import lru_cache
from types import SimpleNamespace
from typing import Any, TypeVar

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, TypesysError, get_types_from_idl, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from supermap_cli.errors import RecordingError
from supermap_cli.recordings.definitions import FALLBACK_DEFINITIONS, OLDER_DEFINITIONS
from supermap_cli.recordings.limits import Limits
from supermap_cli.recordings.notes import Notes
from supermap_cli.recordings.storage import Channel, RawMessage

_DEFAULTS = {"ros1": Stores.ROS1_NOETIC, "cdr": Stores.ROS2_JAZZY}
"""Which distribution's definitions serve where a recording holds none, by serialization."""

_IDL_SEPARATOR = "=" * 80 + "\n"
"""Between the definitions of a bundle (rosbag2's MCAP storage, encoding "ros2idl")."""

_LARGEST_DEFINITION = 1 << 20
"""Bytes of a message definition that are parsed: the largest of the ROS distributions have 30 kB."""

_KEPT_TYPES = 128
"""Message types that stay compiled for the next recording: 10 ms each; a robot has some twenty."""

_BULKY = re.compile(r"Image|Cloud|CustomMsg|YoloResult")
"""Types whose messages hold images or clouds; those of others turn into many small objects, ten times their size."""

FAULTS = (
    *(SerdeError, TypesysError, struct.error, binascii.Error, UnicodeError),
    *(ValueError, TypeError, LookupError, AttributeError, ArithmeticError, AssertionError, SyntaxError),
    *(BufferError, EOFError, MemoryError, RecursionError),
)
"""What decoders raise, and readers of messages whose fields are not what their type promises."""

Value = TypeVar("Value")


def any_numbers() -> AbstractContextManager[None]:
    """Where numbers of any size come out of bytes: what is too large becomes infinite or NaN, which readers check for,
    and numpy does not warn of it.
    """
    return np.errstate(over="ignore", invalid="ignore", divide="ignore")


class MessageError(RecordingError):
    """One message cannot be read; others of its topic may be sound."""


_TypeKey = tuple[str, str, str, bytes]
"""Serialization, type, and format and text of the definition: what one decoding function serves."""


class Decoder:
    """Turns raw messages into objects with the message's fields as attributes.

    Definitions that came with the recording are used first; types without one fall back to Noetic's or Jazzy's.
    `start_ns` is the log time from which the times in notes count.
    """

    def __init__(self, where: str, notes: Notes | None = None, limits: Limits | None = None, start_ns: int = 0) -> None:
        self.where = where
        self.limits = limits or Limits()
        self._notes = notes or Notes()
        self._start_ns = start_ns
        self._functions: dict[_TypeKey, Callable[[bytes | memoryview], Any]] = {}
        self._unknown: dict[_TypeKey, str] = {}
        self._left_out: dict[Channel, set[int]] = {}
        self._first: dict[Channel, str] = {}

    def decode(self, raw: RawMessage) -> Any:
        """The message object. Raises `MessageError` naming topic, type and time if the bytes do not fit it."""
        function = self._function(raw.channel)
        if len(raw.data) > self.limits.structure_bytes and not _BULKY.search(raw.channel.msgtype):
            limit = f"the limit structure_bytes allows {self.limits.structure_bytes}"
            raise self.fault(raw, ValueError(f"{len(raw.data)} bytes, {limit}"))
        try:
            return function(raw.data)
        except FAULTS as error:
            raise self.fault(raw, error) from error

    def read(self, raw: RawMessage, reader: Callable[[Any, int], Value]) -> Value | None:
        """What `reader` makes of the decoded message and its log time; `None` with a note where that cannot be done."""
        try:
            return self.read_strictly(raw, reader)
        except RecordingError as error:
            self.leave_out(raw, error)
            return None

    def read_strictly(self, raw: RawMessage, reader: Callable[[Any, int], Value]) -> Value:
        """What `reader` makes of the decoded message and its log time. Raises `RecordingError`."""
        message = self.decode(raw)
        try:
            with any_numbers():
                return reader(message, raw.log_ns)
        except FAULTS as error:
            raise self.fault(raw, error) from error

    def leave_out(self, raw: RawMessage, error: Exception) -> None:
        """Count a message that is left out, once however often it is read, and note the first of its topic."""
        channel = raw.channel
        what = error.what if isinstance(error, RecordingError) else _text(error)
        times = self._left_out.setdefault(channel, set())
        times.add(raw.log_ns)
        first = self._first.setdefault(channel, f"{self._place(raw)}: {what}")
        self._notes.note(f"messages {channel.topic} {channel.msgtype}", f"{first}; {len(times)} message(s) left out")

    def each(
        self, messages: Iterable[RawMessage], reader: Callable[[Any, int], Value]
    ) -> Iterator[tuple[RawMessage, Value]]:
        """(message, what `reader` makes of it) of all that can be read; the others are left out with a note."""
        for raw in messages:
            value = self.read(raw, reader)
            if value is not None:
                yield raw, value

    def stamped(
        self, messages: Iterable[RawMessage], stamp_of: Callable[[RawMessage, Decoder], int]
    ) -> Iterator[tuple[int, RawMessage]]:
        """(stamp, message) of all messages that have a stamp; the others are left out with a note."""
        for raw in messages:
            try:
                stamp_ns = stamp_of(raw, self)
            except RecordingError as error:
                self.leave_out(raw, error)
                continue
            yield stamp_ns, raw

    def _function(self, channel: Channel) -> Callable[[bytes | memoryview], Any]:
        """How messages of a channel are decoded. Raises `RecordingError` where none of them can be."""
        key = _type_key(channel)
        function = self._functions.get(key)
        if function is None and key not in self._unknown:
            try:
                function = self._functions[key] = _decoding_function(channel, self.limits)
            except FAULTS as error:
                self._unknown[key] = _text(error)
        if function is None:
            raise RecordingError(
                f"messages of the type {channel.msgtype or 'unknown'!r} cannot be decoded: {self._unknown[key]}",
                where=f"{self.where}, {channel.topic}",
                cure="record with the message definitions embedded (MCAP does), or leave the topic out by naming "
                "another",
            )
        return function

    def fault(self, raw: RawMessage, error: Exception) -> MessageError:
        """The error of one message, named by topic, type and time."""
        return MessageError(
            f"a {raw.channel.msgtype or 'message'} cannot be decoded: {_text(error)}",
            where=self._place(raw),
            cure="record with the message definitions embedded, or leave the topic out by naming another",
        )

    def _place(self, raw: RawMessage) -> str:
        return f"{self.where}, {raw.channel.topic} at {(raw.log_ns - self._start_ns) / 1e9:.3f} s"


def _text(error: Exception) -> str:
    """An error's text, not longer than a line; its kind where it has none."""
    text = " ".join(str(error).split())[:200]
    if isinstance(error, KeyError | IndexError | AttributeError | struct.error | AssertionError | MemoryError):
        return f"it does not fit its definition ({text or type(error).__name__})"
    return text or type(error).__name__


def _type_key(channel: Channel) -> _TypeKey:
    return channel.serialization, channel.msgtype, channel.definition_format, channel.definition


def _decoding_function(channel: Channel, limits: Limits) -> Callable[[bytes | memoryview], Any]:
    if channel.serialization == "json":
        return lambda data: _parse_json(bytes(data), limits)
    if channel.serialization == "protobuf":
        return _protobuf_function(channel)
    if channel.serialization not in {"cdr", "ros1"}:
        raise ValueError(f"unknown serialization {channel.serialization!r}")
    package = channel.msgtype.partition("/")[0]
    layouts = [FALLBACK_DEFINITIONS.get(package, {})]
    if not channel.definition.strip():
        layouts += OLDER_DEFINITIONS.get(package, ())
    functions = [_ros_function(channel, layout, limits) for layout in layouts]
    return functions[0] if len(functions) == 1 else _by_the_bytes(functions)


def _ros_function(channel: Channel, fallback: Mapping[str, str], limits: Limits) -> Callable[[bytes | memoryview], Any]:
    typestore = _typestore(_type_key(channel), tuple(fallback.items()), limits)
    if channel.serialization == "ros1":
        return lambda data: typestore.deserialize_ros1(data, channel.msgtype)
    return lambda data: typestore.deserialize_cdr(data, channel.msgtype)


def _by_the_bytes(functions: Sequence[Callable[[bytes | memoryview], Any]]) -> Callable[[bytes | memoryview], Any]:
    """The first of several layouts that fits a message to its last byte and gives likely detections; what
    fitted last is tried first.
    """
    order = list(functions)

    def decode(data: bytes | memoryview) -> Any:
        fault: Exception = ValueError("no known layout of its type fits")
        for function in tuple(order):
            try:
                message = function(data)
            except FAULTS as error:
                fault = error
                continue
            if _is_plausible(message):
                order.remove(function)
                order.insert(0, function)
                return message
        raise ValueError(f"none of {len(order)} layouts of its type fits ({_text(fault)})")

    return decode


def _is_plausible(message: Any) -> bool:
    """Whether all scores are probabilities and all labels text: a number read as text has zeros in it, or is empty."""
    for result in (result for detection in message.detections for result in detection.results):
        hypothesis = getattr(result, "hypothesis", result)
        label = getattr(hypothesis, "class_id", None) or getattr(hypothesis, "id", "")
        if not 0 <= float(hypothesis.score) <= 1 or label == "" or "\0" in str(label):
            return False
    return True


def _parse_json(data: bytes, limits: Limits) -> Any:
    """The object, its fields as attributes. Raises `ValueError` beyond the limit of nesting."""
    octets = np.frombuffer(data, np.uint8)
    brackets = octets[(octets | 0x20 == 0x7B) | (octets | 0x20 == 0x7D)]
    if len(brackets) > limits.nesting and np.cumsum((brackets & 2).astype(np.int64) - 1).max() > limits.nesting:
        raise ValueError(f"nested deeper than the limit nesting allows, {limits.nesting}")
    return json.loads(data, object_hook=lambda fields: SimpleNamespace(**fields))


def _protobuf_function(channel: Channel) -> Callable[[bytes | memoryview], Any]:
    from google.protobuf import descriptor_pb2, descriptor_pool, message_factory  # noqa: PLC0415 - seldom needed
    from google.protobuf.message import DecodeError  # noqa: PLC0415 - seldom needed

    try:
        files = descriptor_pb2.FileDescriptorSet.FromString(channel.definition)
        pool = descriptor_pool.DescriptorPool()
        for descriptor in files.file:
            pool.Add(descriptor)
        message_class = message_factory.GetMessageClass(pool.FindMessageTypeByName(channel.msgtype))
    except DecodeError as error:
        raise ValueError(f"a damaged definition: {error}") from error

    def decode(data: bytes | memoryview) -> Any:
        try:
            return message_class.FromString(bytes(data))
        except DecodeError as error:
            raise ValueError(str(error)) from error

    return decode


@lru_cache(_KEPT_TYPES)
def _typestore(key: _TypeKey, definitions: tuple[tuple[str, str], ...], limits: Limits) -> Typestore:
    """A channel's type and all it is made of: by its own definitions, and the default's for what they lack."""
    serialization, msgtype, definition_format, definition = key
    embedded = _embedded_types(msgtype, definition_format, definition)
    default = get_typestore(_DEFAULTS[serialization]).fielddefs
    package = msgtype.partition("/")[0]
    fallback: dict[str, Any] = {}
    if msgtype not in embedded and msgtype not in default:
        for type_name, text in definitions:
            fallback.update(get_types_from_msg(text, f"{package}/msg/{type_name}"))
    needed: dict[str, Any] = {}
    wanted = [msgtype]
    while wanted:
        name = wanted.pop()
        source = next((types for types in (embedded, fallback, default) if name in types), None)
        if source is None:
            raise ValueError(f"no definition of {name}")
        if name not in needed:
            needed[name] = source[name]
            wanted += _types_of_fields(source[name], limits)
    _check_nesting(msgtype, needed, limits)
    typestore = get_typestore(Stores.EMPTY)
    typestore.register(needed)
    return typestore


def _types_of_fields(definition: Any, limits: Limits) -> list[str]:
    """The message types among the fields of one `fielddefs` entry, (constants, fields)."""
    names = []
    for _, (node, detail) in definition[1]:
        kind, name = (node, detail) if node in {Nodetype.BASE, Nodetype.NAME} else detail[0]
        if node == Nodetype.ARRAY and detail[1] > limits.list_items:
            raise ValueError(f"an array of {detail[1]} items, the limit list_items allows {limits.list_items}")
        if kind == Nodetype.NAME:
            names.append(str(name))
    return names


def _check_nesting(msgtype: str, types: dict[str, Any], limits: Limits) -> None:
    """Raise `ValueError` where messages hold messages deeper than the limit, as one that holds itself does."""
    level = {msgtype}
    for _ in range(limits.nesting):
        level = {name for each in level for name in _types_of_fields(types[each], limits)}
        if not level:
            return
    raise ValueError(f"a type whose messages are nested deeper than the limit nesting allows, {limits.nesting}")


def _embedded_types(msgtype: str, definition_format: str, definition: bytes) -> Any:
    text = definition.decode(errors="replace")
    if not text.strip():
        return {}
    if len(definition) > _LARGEST_DEFINITION:
        raise ValueError(f"a message definition of {len(definition)} bytes")
    if definition_format != "ros2idl":
        return get_types_from_msg(text, msgtype)
    if not text.startswith(f"{_IDL_SEPARATOR}IDL: "):
        return get_types_from_idl(text)
    types: dict[str, Any] = {}
    for part in text.split(_IDL_SEPARATOR)[1:]:
        types.update(get_types_from_idl(part.partition("\n")[2]))
    return types


def message_fields(message: Any, *names: str) -> Any:
    """The first of several spellings of one field (ROS 1 and ROS 2 differ in capitals)."""
    for name in names:
        if hasattr(message, name):
            return getattr(message, name)
    raise KeyError(f"no field {names[0]!r}")
