"""From stored bytes to message objects: ROS CDR and ROS 1 by `rosbags`, JSON and protobuf by their own libraries."""

from __future__ import annotations

import json
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

from rosbags.interfaces import Nodetype
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, TypesysError, get_types_from_idl, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from supermap_cli.errors import RecordingError
from supermap_cli.recordings.definitions import FALLBACK_DEFINITIONS
from supermap_cli.recordings.storage import Channel, RawMessage

_DEFAULTS = {"ros1": Stores.ROS1_NOETIC, "cdr": Stores.ROS2_JAZZY}
"""Which distribution's definitions serve where a recording holds none, by serialization."""

_IDL_SEPARATOR = "=" * 80 + "\n"
"""Between the definitions of a bundle (rosbag2's MCAP storage, encoding "ros2idl")."""


class Decoder:
    """Turns raw messages into objects with the message's fields as attributes.

    Definitions that came with the recording are used first; types without one fall back to Noetic's or Jazzy's.
    """

    def __init__(self, where: str) -> None:
        self.where = where
        self._functions: dict[tuple[str, str, str, bytes], Callable[[bytes | memoryview], Any]] = {}

    def decode(self, raw: RawMessage) -> Any:
        """The message object. Raises `RecordingError` naming topic and type if the bytes do not fit the definition."""
        channel = raw.channel
        try:
            key = (channel.serialization, channel.msgtype, channel.definition_format, channel.definition)
            function = self._functions.get(key)
            if function is None:
                function = self._functions[key] = _decoding_function(channel)
            return function(raw.data)
        except (
            SerdeError,
            TypesysError,
            KeyError,
            ValueError,
            AssertionError,
            TypeError,
        ) as error:
            raise RecordingError(
                f"a {channel.msgtype or 'message'} cannot be decoded: {error}",
                where=f"{self.where}, {channel.topic}",
                cure="record with the message definitions embedded, or leave the topic out by naming another",
            ) from error


def _decoding_function(channel: Channel) -> Callable[[bytes | memoryview], Any]:
    if channel.serialization == "json":
        return lambda data: json.loads(bytes(data), object_hook=lambda fields: SimpleNamespace(**fields))
    if channel.serialization == "protobuf":
        return _protobuf_function(channel)
    if channel.serialization not in {"cdr", "ros1"}:
        raise ValueError(f"unknown serialization {channel.serialization!r}")
    typestore = _typestore(channel)
    if channel.serialization == "ros1":
        return lambda data: typestore.deserialize_ros1(data, channel.msgtype)
    return lambda data: typestore.deserialize_cdr(data, channel.msgtype)


def _protobuf_function(channel: Channel) -> Callable[[bytes | memoryview], Any]:
    from google.protobuf import descriptor_pb2, descriptor_pool, message_factory  # noqa: PLC0415 - seldom needed
    from google.protobuf.message import DecodeError  # noqa: PLC0415 - seldom needed

    files = descriptor_pb2.FileDescriptorSet.FromString(channel.definition)
    pool = descriptor_pool.DescriptorPool()
    for descriptor in files.file:
        pool.Add(descriptor)
    message_class = message_factory.GetMessageClass(pool.FindMessageTypeByName(channel.msgtype))

    def decode(data: bytes | memoryview) -> Any:
        try:
            return message_class.FromString(bytes(data))
        except DecodeError as error:
            raise ValueError(str(error)) from error

    return decode


def _typestore(channel: Channel) -> Typestore:
    """The channel's type and all it is made of: by its own definitions, and the default's for what they lack."""
    embedded, default = _embedded_types(channel), get_typestore(_DEFAULTS[channel.serialization]).fielddefs
    package = channel.msgtype.partition("/")[0]
    fallback: dict[str, Any] = {}
    if channel.msgtype not in embedded and channel.msgtype not in default:
        for type_name, text in FALLBACK_DEFINITIONS.get(package, {}).items():
            fallback.update(get_types_from_msg(text, f"{package}/msg/{type_name}"))
    needed: dict[str, Any] = {}
    wanted = [channel.msgtype]
    while wanted:
        name = wanted.pop()
        source = next((types for types in (embedded, fallback, default) if name in types), None)
        if source is None:
            raise KeyError(f"no definition of {name}")
        if name not in needed:
            needed[name] = source[name]
            wanted += _types_of_fields(source[name])
    typestore = get_typestore(Stores.EMPTY)
    typestore.register(needed)
    return typestore


def _types_of_fields(definition: Any) -> list[str]:
    """The message types among the fields of one `fielddefs` entry, (constants, fields)."""
    names = []
    for _, (node, detail) in definition[1]:
        kind, name = (node, detail) if node in {Nodetype.BASE, Nodetype.NAME} else detail[0]
        if kind == Nodetype.NAME:
            names.append(str(name))
    return names


def _embedded_types(channel: Channel) -> Any:
    text = channel.definition.decode(errors="replace")
    if not text.strip():
        return {}
    if channel.definition_format != "ros2idl":
        return get_types_from_msg(text, channel.msgtype)
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
