"""A system without a component: what stays, what is left out, and that it runs as before."""

import numpy as np
import pytest
from grasp_cosim import InputError, System, simulate


class Ramp:
    outputs = {"y": (0.0, "m")}  # noqa: RUF012

    def step(self, t, inputs):
        return {"y": 2.0 * t}


class Follower:
    inputs = {"u": (0.0, "m"), "on": False}  # noqa: RUF012
    outputs = {"copy": (0.0, "m")}  # noqa: RUF012

    def step(self, t, inputs):
        return {"copy": inputs["u"]}


@pytest.fixture
def system():
    return System(
        components={"ramp": Ramp, "a": {"fmu": Follower, "values": {"on": True}}, "b": Follower},
        connections=["ramp.y -> a.u", "a.copy -> b.u"],
        experiment={"step": 0.1, "stop": 1.0},
        events=[
            {"at": 0.5, "set": {"a.on": False}},
            {"when": "ramp.y > 1", "set": {"b.on": True}},
        ],
        faults=[
            {"connection": "a.u", "kind": "stuck", "value": 1.0, "from": 0.2},
            {"connection": "b.u", "kind": "stuck", "value": 1.0, "from": 0.2},
        ],
        limits=[{"when": "ramp.y > 5", "then": "abort"}, {"when": "b.copy > 5", "then": "abort"}],
        roles={"source": "ramp", "sink": "b"},
        presets={"p": {"a.on": False, "b.on": True}},
        record={"signals": ["ramp.*", "b.copy"]},
    )


def test_what_names_it_is_left_out_and_the_rest_stays(system):
    rest = system.without("ramp")
    assert [*rest.by_name] == ["a", "b"]
    assert [str(c) for c in rest.connections] == ["a.copy -> b.u"]
    assert [event.at_ns for event in rest.events] == [500_000_000]
    assert [str(fault.target) for fault in rest.faults] == ["b.u"]
    assert [str(limit.when.port) for limit in rest.limits] == ["b.copy"]
    assert rest.roles == {"sink": "b"}
    assert rest.record.signals == ("b.copy",)
    assert rest.presets == system.presets
    assert [note for note in rest.notes if "left out" in note] == [
        "record: 'ramp.*' matches no signal any more: it is left out",
        "events[1] is about ramp: it is left out",
        "faults[0] is about ramp: it is left out",
        "limits[0] is about ramp: it is left out",
    ]


def test_presets_lose_its_values(system):
    assert system.without("a").presets == {"p": {"b.on": True}}


def test_an_input_that_lost_its_source_can_be_set(system):
    with simulate.session(system.without("a")) as session:
        assert session["b.u"] == 0.0
        session.set("b.u", 3.0)
        session.step()
        assert session["b.copy"] == 3.0


def test_the_start_value_of_the_input_stays(system):
    rest = system.without("ramp").with_values({"a.u": 0.5}).without("b")
    assert rest.by_name["a"].values == {"on": True, "u": 0.5}


@pytest.mark.parametrize(
    ("name", "reason"),
    [("ramps", "no component 'ramps'; did you mean ramp"), ("only", "has no other component")],
)
def test_what_cannot_be_taken_out_is_refused(system, name, reason):
    one = System("one", components={"only": Ramp}, experiment={"step": 0.1, "stop": 1.0})
    with pytest.raises(InputError) as caught:
        (one if name == "only" else system).without(name)
    assert reason in str(caught.value)


def test_the_plant_takes_the_forces_of_a_controller_outside(grasp):
    """Sequential: the controller's values of a communication point are those of the next step."""
    run = simulate(grasp, step=1e-3, stop=0.3)
    names = [f"force[{i}]" for i in (1, 2)]
    with simulate.session(grasp.without("controller"), step=1e-3, stop=0.3) as session:
        for row in range(len(run.time) - 1):
            for name in names:
                session.set(f"plant.{name}", float(run[f"controller.{name}"][row]))
            session.step()
        result = session.result()
    np.testing.assert_array_equal(result["sensor_1.intensity"], run["sensor_1.intensity"])
