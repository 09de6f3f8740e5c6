"""Messages to values of variables, and back."""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from importlib import import_module
from typing import Any, TypeAlias

from grasp_cosim import InputError
from grasp_cosim.base.errors import nearest
from grasp_cosim.interface.units import IDENTITY

from .topics import JOINT_STATE, JOINT_TRAJECTORY, Entry, Topic

Values: TypeAlias = dict[str, float | int | bool]
"""Values by variable, in the units of the model."""

Encode: TypeAlias = Callable[[Mapping[str, float]], Any]
Decode: TypeAlias = Callable[[Any], Values]

_TYPE = re.compile(r"(\w+)/msg/(\w+)")
_STEP = re.compile(r"([A-Za-z]\w*)(?:\[(\d+)\])?")
_ELEMENTS = re.compile(r"(?:sequence<([\w/]+)(?:, \d+)?>|([\w/]+)\[\d+\])")
_INTEGERS = re.compile(r"u?int(8|16|32|64)|octet")


def message_class(place: str, name: str) -> type:
    """The class of a type of messages, like std_msgs/msg/Float64.

    Raises:
        InputError: There is no such type, or its package is not installed.
    """
    match = _TYPE.fullmatch(name)
    try:
        return getattr(import_module(f"{match[1]}.msg"), match[2])  # type: ignore[index, no-any-return]
    except (ImportError, AttributeError, TypeError) as error:
        raise InputError(
            f"{place}.type = {name!r}: no such type is installed; must be one like "
            "std_msgs/msg/Float64MultiArray"
        ) from error


def encoder(place: str, topic: Topic, period_ns: int) -> tuple[type, Encode]:
    """The class of the messages of a topic, and what makes a message of values.

    Raises:
        InputError: There is no such type, or it has no such field of numbers.
    """
    cls = message_class(place, topic.type)
    if topic.type == JOINT_TRAJECTORY:
        return cls, partial(_trajectory, topic, cls, period_ns)
    if topic.type == JOINT_STATE:
        return cls, partial(_joint_state, topic, cls)
    paths = {f: _path(f"{place}.{f}", cls, f, entries) for f, entries in topic.fields.items()}
    return cls, partial(_message, topic, cls, paths)


def decoder(place: str, topic: Topic) -> tuple[type, Decode]:
    """The class of the messages of a topic, and what makes values of a message.

    That raises an InputError for a message that lacks a joint, has another number of values, or has
    one that is not a number.
    """
    cls = message_class(place, topic.type)
    if topic.type == JOINT_STATE:
        return cls, partial(_of_joint_state, topic)
    paths = {f: _path(f"{place}.{f}", cls, f, entries) for f, entries in topic.fields.items()}
    return cls, partial(_of_message, topic, paths)


Path: TypeAlias = tuple[tuple[str, int | None, type | None], ...]
"""Steps to a field: its name, its index in an array, and the class that is missing there."""


def _path(place: str, cls: type, text: str, entries: Entry | Sequence[Entry]) -> Path:
    """The way to a field of a message; InputError where there is none, or it is of another type."""
    path: list[tuple[str, int | None, type | None]] = []
    kind = ""
    current: type | None = cls
    for part in text.split("."):
        match = _STEP.fullmatch(part)
        types: dict[str, str] = current.get_fields_and_field_types() if current else {}  # type: ignore[attr-defined]
        if match is None or match[1] not in types:
            raise InputError(f"{place}: no such field; {nearest(part, types)}")
        kind = types[match[1]]
        if match[2] is not None:
            kind = _element_type(kind)
        current = message_class(place, kind.replace("/", "/msg/")) if "/" in kind else None
        path.append((match[1], None if match[2] is None else int(match[2]), current))
    scalar = kind if isinstance(entries, Entry) else _element_type(kind)
    if scalar not in ("double", "float", "boolean") and not _INTEGERS.fullmatch(scalar):
        wanted = "a number" if isinstance(entries, Entry) else "an array of numbers"
        raise InputError(f"{place}: is {kind}; must be {wanted}")
    return tuple(path)


def _element_type(kind: str) -> str:
    """The type of the elements of an array; empty for what is none."""
    match = _ELEMENTS.fullmatch(kind)
    return (match[1] or match[2]) if match else ""


def _number_of(entry: Entry, values: Mapping[str, float]) -> float:
    """The number in the message for a variable."""
    value = values[entry.name]
    return value if entry.change is IDENTITY else entry.change.back(value)


def _value_of(entry: Entry, number: float) -> float | int | bool:
    """The value of a variable for the number in a message; InputError where it is none.

    Infinity is a sensor's for nothing in its range, REP 117: the largest number of that sign.
    """
    if entry.kind == "Boolean":
        return bool(number)
    if math.isnan(number):
        raise InputError(f"{entry.name}: is nan; must be a number")
    if entry.kind == "Integer":
        return round(number)
    value = number if entry.change is IDENTITY else entry.change(number)
    return max(-sys.float_info.max, min(value, sys.float_info.max))


def _joint_state(topic: Topic, cls: type, values: Mapping[str, float]) -> Any:
    message = cls(name=topic.joints)
    for field, entries in topic.fields.items():
        setattr(message, field, [_number_of(e, values) for e in _listed(entries)])
    return message


def _of_joint_state(topic: Topic, message: Any) -> Values:
    """The values of the joints of a topic, wherever they are in the message."""
    places = {name: place for place, name in enumerate(message.name)}
    values: Values = {}
    for field, entries in topic.fields.items():
        numbers = getattr(message, field)
        for joint, entry in zip(topic.joints, _listed(entries), strict=True):
            place = places.get(joint)
            if place is None:
                raise InputError(f"no joint {joint!r}; {nearest(joint, places)}")
            if place >= len(numbers):
                raise InputError(f"{field} has {len(numbers)} values; must have one for {joint}")
            values[entry.name] = _value_of(entry, numbers[place])
    return values


def _trajectory(topic: Topic, cls: type, period_ns: int, values: Mapping[str, float]) -> Any:
    """A trajectory of one point, to be reached within a period from now."""
    point = import_module("trajectory_msgs.msg").JointTrajectoryPoint()
    for field, entries in topic.fields.items():
        setattr(point, field, [_number_of(e, values) for e in _listed(entries)])
    point.time_from_start.sec, point.time_from_start.nanosec = divmod(period_ns, 10**9)
    return cls(joint_names=topic.joints, points=[point])


def _message(
    topic: Topic, cls: type, paths: Mapping[str, Path], values: Mapping[str, float]
) -> Any:
    """A message of any type, with its fields set."""
    message = cls()
    for field, entries in topic.fields.items():
        *way, (name, index, _) = paths[field]
        owner = _owner(message, way, make=True)
        content: Any
        if isinstance(entries, Entry):
            content = _number_of(entries, values)
        else:
            content = [_number_of(entry, values) for entry in entries]
        kind = owner.get_fields_and_field_types()[name]
        if index is None:
            setattr(owner, name, _as(kind, content))
            continue
        array = getattr(owner, name)
        missing = index + 1 - len(array)
        if missing > 0:
            array.extend([_as(_element_type(kind), 0.0)] * missing)
        array[index] = _as(_element_type(kind), content)
    return message


def _as(kind: str, content: Any) -> Any:
    """A number, or a list of them, as a field of a type takes it."""
    if isinstance(content, list):
        return [_as(_element_type(kind), number) for number in content]
    if kind == "boolean":
        return bool(content)
    return round(content) if _INTEGERS.fullmatch(kind) else float(content)


def _of_message(topic: Topic, paths: Mapping[str, Path], message: Any) -> Values:
    """The values in the fields of a message of any type."""
    values: Values = {}
    for field, entries in topic.fields.items():
        *way, (name, index, _) = paths[field]
        content = getattr(_owner(message, way), name)
        if index is not None:
            if index >= len(content):
                raise InputError(f"{name} has {len(content)} values; must have {index + 1} or more")
            content = content[index]
        if isinstance(entries, Entry):
            values[entries.name] = _value_of(entries, content)
            continue
        if len(content) != len(entries):
            raise InputError(f"{field} has {len(content)} values; must have {len(entries)}")
        for entry, number in zip(entries, content, strict=True):
            values[entry.name] = _value_of(entry, number)
    return values


def _owner(
    message: Any, way: Sequence[tuple[str, int | None, type | None]], make: bool = False
) -> Any:
    """What is at the end of a way; with make elements of arrays that are missing are made."""
    for name, index, cls in way:
        message = getattr(message, name)
        if index is None:
            continue
        if make and cls:
            message.extend(cls() for _ in range(index + 1 - len(message)))
        elif index >= len(message):
            raise InputError(f"{name} has {len(message)} elements; must have {index + 1} or more")
        message = message[index]
    return message


def _listed(entries: Entry | tuple[Entry, ...]) -> tuple[Entry, ...]:
    return (entries,) if isinstance(entries, Entry) else entries
