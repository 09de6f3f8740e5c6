"""Values in messages, and messages that do not fit. The types of ROS are stood in for."""

import math
import sys
from types import ModuleType, SimpleNamespace

import pytest
from grasp_cosim import InputError
from grasp_cosim.interface.units import IDENTITY, Conversion
from grasp_cosim_ros.messages import decoder, encoder
from grasp_cosim_ros.topics import Entry, Topic


def message_type(**fields):
    """A type with fields of types, as rosidl makes them, and what each starts with."""

    class Message(SimpleNamespace):
        def __init__(self, **values):
            starts = {name: start() for name, (_, start) in fields.items()}
            super().__init__(**{**starts, **values})

        @classmethod
        def get_fields_and_field_types(cls):
            return {name: kind for name, (kind, _) in fields.items()}

    return Message


@pytest.fixture(autouse=True)
def _types(monkeypatch):
    vector = message_type(x=("double", float), y=("double", float))
    types = {
        "Float64MultiArray": message_type(data=("sequence<double>", list)),
        "Bool": message_type(data=("boolean", bool)),
        "Text": message_type(data=("string", str)),
        "Vector": vector,
        "Wrench": message_type(force=("toy_msgs/Vector", vector)),
        "Cloud": message_type(points=("sequence<toy_msgs/Vector>", list)),
        "Count": message_type(data=("uint8", int), rows=("sequence<int32>", list)),
    }
    joints = message_type(
        name=("sequence<string>", list),
        position=("sequence<double>", list),
        velocity=("sequence<double>", list),
    )
    point = message_type(
        positions=("sequence<double>", list),
        time_from_start=("x", lambda: SimpleNamespace(sec=0, nanosec=0)),
    )
    packages = {
        "toy_msgs": types,
        "sensor_msgs": {"JointState": joints},
        "trajectory_msgs": {
            "JointTrajectoryPoint": point,
            "JointTrajectory": message_type(joint_names=("x", list), points=("x", list)),
        },
    }
    for package, content in packages.items():
        module = ModuleType(f"{package}.msg")
        vars(module).update(content)
        monkeypatch.setitem(sys.modules, package, ModuleType(package))
        monkeypatch.setitem(sys.modules, f"{package}.msg", module)


def entry(name, kind="Real", change=IDENTITY):
    return Entry(name, change, kind)


def topic(kind, joints=(), **fields):
    return Topic("t", kind, fields, joints)


@pytest.mark.parametrize(
    ("of", "values"),
    [
        (topic("toy_msgs/msg/Float64MultiArray", data=(entry("a"), entry("b"))), (1.5, -2.0)),
        (topic("toy_msgs/msg/Float64MultiArray", **{"data[2]": entry("a")}), (0.25,)),
        (topic("toy_msgs/msg/Bool", data=entry("a", "Boolean")), (1.0,)),
        (topic("toy_msgs/msg/Wrench", **{"force.y": entry("a")}), (3.0,)),
        (topic("toy_msgs/msg/Cloud", **{"points[1].x": entry("a")}), (4.0,)),
        (topic("toy_msgs/msg/Count", data=entry("a", "Integer")), (5.0,)),
        (topic("toy_msgs/msg/Count", rows=(entry("a", "Integer"), entry("b"))), (5.0, 6.0)),
        (
            topic("sensor_msgs/msg/JointState", ("l", "r"), position=(entry("a"), entry("b"))),
            (1, 2),
        ),
        (topic("toy_msgs/msg/Vector", x=entry("a", change=Conversion(-2.0, 0.5))), (8.5,)),
    ],
)
def test_a_value_comes_back_as_it_was_told(of, values):
    told = {e.name: value for e, value in zip(of.entries, values, strict=True)}
    _, encode = encoder("p", of, 10**6)
    _, decode = decoder("p", of)
    assert decode(encode(told)) == told


def test_the_number_in_a_message_is_what_factor_and_offset_make_it():
    of = topic("toy_msgs/msg/Vector", x=entry("a", change=Conversion(-2.0, 0.5)))
    _, encode = encoder("p", of, 1)
    assert encode({"a": 8.5}).x == -4.0


def test_joints_are_found_by_name():
    of = topic("sensor_msgs/msg/JointState", ("l", "r"), position=(entry("a"), entry("b")))
    cls, decode = decoder("p", of)
    assert decode(cls(name=["arm", "r", "l"], position=[9.0, 2.0, 1.0])) == {"a": 1.0, "b": 2.0}


def test_a_trajectory_has_one_point_a_period_ahead():
    of = topic("trajectory_msgs/msg/JointTrajectory", ("wrist",), positions=(entry("a"),))
    _, encode = encoder("p", of, 1_500_000_000)
    message = encode({"a": 0.25})
    (point,) = message.points
    assert (message.joint_names, point.positions) == (("wrist",), [0.25])
    assert (point.time_from_start.sec, point.time_from_start.nanosec) == (1, 500_000_000)


@pytest.mark.parametrize(
    ("of", "message", "reason"),
    [
        (
            topic("sensor_msgs/msg/JointState", ("l",), position=(entry("a"),)),
            {"name": ["r"], "position": [0.0]},
            "no joint 'l'; valid: r",
        ),
        (
            topic("sensor_msgs/msg/JointState", ("l",), velocity=(entry("a"),)),
            {"name": ["l"], "position": [0.0]},
            "velocity has 0 values; must have one for l",
        ),
        (
            topic("toy_msgs/msg/Float64MultiArray", data=(entry("a"), entry("b"))),
            {"data": [1.0]},
            "data has 1 values; must have 2",
        ),
        (
            topic("toy_msgs/msg/Float64MultiArray", **{"data[2]": entry("a")}),
            {"data": [1.0]},
            "data has 1 values; must have 3 or more",
        ),
        (topic("toy_msgs/msg/Cloud", **{"points[1].x": entry("a")}), {}, "points has 0 elements"),
        (topic("toy_msgs/msg/Vector", x=entry("a")), {"x": math.nan}, "a: is nan; must be"),
    ],
)
def test_a_message_that_does_not_fit_is_refused(of, message, reason):
    cls, decode = decoder("p", of)
    with pytest.raises(InputError) as caught:
        decode(cls(**message))
    assert reason in str(caught.value)


@pytest.mark.parametrize(("number", "value"), [(math.inf, 1.0), (-math.inf, -1.0)])
def test_nothing_in_range_is_the_largest_number(number, value):
    cls, decode = decoder("p", topic("toy_msgs/msg/Vector", x=entry("a")))
    assert decode(cls(x=number)) == {"a": value * sys.float_info.max}


@pytest.mark.parametrize(
    ("kind", "field", "reason"),
    [
        ("toy_msgs/msg/Nothing", "data", "p.type = 'toy_msgs/msg/Nothing': no such type"),
        ("no_msgs/msg/Float64", "data", "no such type is installed"),
        ("Float64", "data", "no such type is installed"),
        ("toy_msgs/msg/Vector", "z", "p.z: no such field; valid: x, y"),
        ("toy_msgs/msg/Text", "data", "p.data: is string; must be a number"),
        ("toy_msgs/msg/Float64MultiArray", "data", "is sequence<double>; must be a number"),
        ("toy_msgs/msg/Wrench", "force", "is toy_msgs/Vector; must be a number"),
        ("toy_msgs/msg/Vector", "x.y", "no such field"),
        ("toy_msgs/msg/Vector", "x[0]", "must be a number"),
    ],
)
def test_a_field_that_does_not_exist_is_refused(kind, field, reason):
    for make in (lambda t: encoder("p", t, 1), lambda t: decoder("p", t)):
        with pytest.raises(InputError) as caught:
            make(topic(kind, **{field: entry("a")}))
        assert reason in str(caught.value)
