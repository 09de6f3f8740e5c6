"""What a run was asked to do, as plain data."""

import json
from dataclasses import replace

from grasp_cosim.system.parts import Condition, Connection, Event, Fault, Port
from grasp_cosim.system.settings import settings


def test_the_settings_of_the_grasp(grasp):
    found = settings(grasp)
    assert found["scheme"] == "sequential"
    assert (found["step"], found["stop"]) == (1e-4, 3.0)
    assert found["components"]["plant"] == {
        "fmu": "GripperPlant.fmu",
        "values": {"object_width": 0.07, "initial_object_position": 0.03},
        "step": None,
        "isolation": "none",
        "rename": {},
        "units": {},
    }
    assert found["connections"][0] == {
        "from": "plant.gap[1]",
        "to": "sensor_1.gap",
        "factor": None,
        "offset": None,
    }
    assert len(found["connections"]) == 10
    assert found["events"] == found["faults"] == []


def test_what_is_special_in_a_system(grasp):
    plant, *others = grasp.components
    gap = grasp.connections[0]
    system = replace(
        grasp,
        components=(replace(plant, step_ns=200_000, isolation="process"), *others),
        connections=(Connection(gap.source, gap.target, 2.0, -0.5), *grasp.connections[1:]),
        events=(
            Event({Port("sensor_1", "reflectance"): 0.5}, at_ns=500_000_000),
            Event(
                {Port("sensor_2", "reflectance"): 0.25},
                when=Condition(Port("plant", "gap[1]"), "<", 0.01),
            ),
        ),
        faults=(
            Fault(Port("controller", "intensity[1]"), "bias", {"value": 0.1}, 100_000, 300_000),
            Fault(Port("controller", "intensity[2]"), "stuck", {}),
        ),
    )
    found = json.loads(json.dumps(settings(system)))
    assert found["components"]["plant"]["step"] == 2e-4
    assert found["components"]["plant"]["isolation"] == "process"
    assert (found["connections"][0]["factor"], found["connections"][0]["offset"]) == (2.0, -0.5)
    assert found["events"] == [
        {"at": 0.5, "set": {"sensor_1.reflectance": 0.5}},
        {"when": "plant.gap[1] < 0.01", "set": {"sensor_2.reflectance": 0.25}},
    ]
    assert found["faults"] == [
        {
            "connection": "controller.intensity[1]",
            "kind": "bias",
            "value": 0.1,
            "from": 1e-4,
            "until": 3e-4,
        },
        {"connection": "controller.intensity[2]", "kind": "stuck", "from": 0.0},
    ]
