"""The file of topics: which variable of a model is in which field of which message.

Values in messages are in SI units, as REP 103 has them; those of a model are in its own.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, NamedTuple, cast

import yaml
from grasp_cosim import InputError, System
from grasp_cosim.base.checks import as_table, check_keys, choice, number, text, whole
from grasp_cosim.base.errors import nearest, reason
from grasp_cosim.interface.units import IDENTITY, Conversion
from grasp_cosim.interface.variables import Variable
from grasp_cosim.system.parts import Port, as_port
from grasp_cosim.system.scenario import settable_ports
from grasp_cosim.system.structure import parameter_in_si

JOINT_STATE, JOINT_TRAJECTORY = "sensor_msgs/msg/JointState", "trajectory_msgs/msg/JointTrajectory"

OF_JOINTS: Mapping[str, tuple[str, ...]] = {
    JOINT_STATE: ("position", "velocity", "effort"),
    JOINT_TRAJECTORY: ("positions", "velocities", "accelerations", "effort"),
}
"""The fields of the messages whose values belong to joints; of a trajectory those of a point."""

Reliability = Literal["reliable", "best_effort"]
OWN_KEYS = ("type", "joints", "reliability", "depth")


class Entry(NamedTuple):
    """A variable in a message: the variable is `change` of the number in the message."""

    name: str
    change: Conversion
    kind: str


@dataclass(frozen=True, slots=True)
class Topic:
    """A topic and what is in its messages: by field a variable, or a list of them."""

    name: str
    type: str
    fields: Mapping[str, Entry | tuple[Entry, ...]]
    joints: tuple[str, ...] = ()
    reliability: Reliability = "reliable"
    depth: int = 10

    @property
    def entries(self) -> Iterator[Entry]:
        """All variables of the topic."""
        for field in self.fields.values():
            yield from [field] if isinstance(field, Entry) else field


@dataclass(frozen=True, slots=True)
class Topics:
    """What messages set in a model, what they contain of it, and the safe values of either."""

    subscribe: tuple[Topic, ...]
    publish: tuple[Topic, ...]
    failsafe: Mapping[str, float]
    """Values in SI units by variable."""

    @property
    def inputs(self) -> dict[str, Entry]:
        """The variables that messages set, by name."""
        return {entry.name: entry for topic in self.subscribe for entry in topic.entries}

    @property
    def outputs(self) -> dict[str, Entry]:
        """The variables that messages contain, by name."""
        return {entry.name: entry for topic in self.publish for entry in topic.entries}


def read_topics(path: Path, system: System) -> Topics:
    """Read a file of topics and compare it with a system.

    Args:
        path: The file, YAML.
        system: The system whose variables it names, like "plant.force[1]".

    Returns:
        The topics.

    Raises:
        InputError: The file is not there or not as it must be, names a variable that does not
            exist, or sets one that has another source.
    """
    try:
        content = yaml.safe_load(path.read_text("utf-8"))
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise InputError(f"{path}: {' '.join(reason(error).split())}") from error
    table = as_table(str(path), content)
    check_keys(str(path), table, ("subscribe", "publish", "failsafe"))
    reader = _Reader(system)
    subscribe, publish = (
        tuple(
            reader.topic(f"{path}: {side}.{name}", str(name), entry, is_input)
            for name, entry in as_table(f"{path}: {side}", table.get(side) or {}).items()
        )
        for side, is_input in (("subscribe", True), ("publish", False))
    )
    failsafe = {
        str(name): number(f"{path}: failsafe.{name}", value)
        for name, value in as_table(f"{path}: failsafe", table.get("failsafe") or {}).items()
    }
    topics = Topics(subscribe, publish, failsafe)
    _check(path, topics)
    return topics


def _check(path: Path, topics: Topics) -> None:
    """InputError if there is no topic, a variable is set twice, or a safe value is of none."""
    if not topics.publish and not topics.subscribe:
        raise InputError(f"{path}: has no topic; must have some below publish or subscribe")
    seen: set[str] = set()
    for topic in topics.subscribe:
        for entry in topic.entries:
            if entry.name in seen:
                raise InputError(f"{path}: {entry.name} is in two fields; must be set by one")
            seen.add(entry.name)
    exchanged = [*topics.inputs, *topics.outputs]
    for name in topics.failsafe:
        if name not in exchanged:
            raise InputError(f"{path}: failsafe.{name}: is in no topic; {nearest(name, exchanged)}")


@dataclass(frozen=True, slots=True)
class _Reader:
    system: System

    def topic(self, place: str, name: str, content: Any, is_input: bool) -> Topic:
        """One topic of the file."""
        table = as_table(place, content)
        kind = text(f"{place}.type", table.get("type"), "like std_msgs/msg/Float64MultiArray")
        fields = {key: value for key, value in table.items() if key not in OWN_KEYS}
        if not fields:
            raise InputError(f"{place}: has no variable; must have one, like  data: plant.gap[1]")
        joints = table.get("joints", [])
        if kind in OF_JOINTS:
            check_keys(place, fields, OF_JOINTS[kind])
            if not (isinstance(joints, list) and joints and all(map(_is_name, joints))):
                raise InputError(f"{place}.joints = {joints!r}: must be a list of names of joints")
        elif "joints" in table:
            raise InputError(f"{place}.joints: {kind} has none; must be left out")
        if is_input and kind == JOINT_TRAJECTORY:
            raise InputError(f"{place}: {kind} is for publishing; must be {JOINT_STATE}")
        read = {
            str(field): self._field(f"{place}.{field}", value, is_input)
            for field, value in fields.items()
        }
        for field, entries in read.items():
            if kind in OF_JOINTS and (isinstance(entries, Entry) or len(entries) != len(joints)):
                raise InputError(
                    f"{place}.{field}: must be a list of {len(joints)}, one for each joint"
                )
        reliability = choice(
            f"{place}.reliability",
            table.get("reliability", "reliable"),
            ("reliable", "best_effort"),
        )
        depth = whole(
            f"{place}.depth", table.get("depth", 10), 1, 1000, must="a whole number from 1 to 1000"
        )
        return Topic(name, kind, read, tuple(joints), cast(Reliability, reliability), depth)

    def _field(self, place: str, value: Any, is_input: bool) -> Entry | tuple[Entry, ...]:
        if isinstance(value, list):
            return tuple(
                self._entry(f"{place}[{i}]", item, is_input) for i, item in enumerate(value)
            )
        return self._entry(place, value, is_input)

    def _entry(self, place: str, value: Any, is_input: bool) -> Entry:
        """A variable by its name, or by a table with a factor and an offset.

        variable = factor * number in the message + offset, in SI units.
        """
        table = value if isinstance(value, dict) else {"variable": value}
        check_keys(place, table, ("variable", "factor", "offset"))
        name = text(place, table.get("variable"), "the name of a variable, like plant.gap[1]")
        factor = number(f"{place}.factor", table.get("factor", 1.0))
        offset = number(f"{place}.offset", table.get("offset", 0.0))
        if factor == 0.0:
            raise InputError(f"{place}.factor = 0: must not be 0")
        port = as_port(place, name)
        variable = self._variable(place, port, is_input)
        is_real = variable.kind == "Real"
        to_si = parameter_in_si(self.system, place, port) if is_real else IDENTITY
        own = Conversion(factor / to_si.factor, (offset - to_si.offset) / to_si.factor)
        return Entry(name, IDENTITY if own == IDENTITY else own, variable.kind)

    def _variable(self, place: str, port: Port, is_input: bool) -> Variable:
        """The variable of a port; InputError where there is none that can be set or read."""
        component = self.system.component(port.component, place)
        if is_input:
            settable = {
                p: v for p, v in self.system.once(settable_ports).items() if v.kind != "String"
            }
            if port not in settable:
                raise InputError(
                    f"{place}: {port}: no input without a source, and no tunable parameter; "
                    f"{nearest(port, settable)}"
                )
            return settable[port]
        readable = {v.name: v for v in component.interface.variables if v.is_number}
        if port.variable not in readable:
            names = [f"{port.component}.{name}" for name in readable]
            raise InputError(f"{place}: {port}: no such number; {nearest(port, names)}")
        return readable[port.variable]


def _is_name(value: object) -> bool:
    return isinstance(value, str) and value != ""
