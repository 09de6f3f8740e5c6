"""The grasp as another tool may pack it: nested, its units not those of the FMUs, values on top."""

import numpy as np
from grasp_cosim import System, simulate
from ssp.hand_made import (
    archive,
    bind,
    component,
    connect,
    linear,
    parameter_set,
    structure,
    system,
)

STOP = '<ssd:DefaultExperiment stopTime="2.5"/>'


def sensors():
    """A system of both sensors; gaps come in mm, and one of the sensors is told twice the gap."""
    elements = "".join(
        component(f"s{j}", "input gap Real; output intensity Real", source=SENSOR) for j in (1, 2)
    )
    connections = "".join(
        connect(f"gap{j}", f"s{j}/gap", linear(2.0) if j == 2 else "")
        + connect(f"s{j}/intensity", f"xi{j}")
        for j in (1, 2)
    )
    connectors = "; ".join(f"input gap{j} Real mm; output xi{j} Real" for j in (1, 2))
    darker = bind(parameter_set("s1.reflectance Real 0.86", units=""))
    return system("sensors", elements, connections, connectors, darker)


SENSOR = "resources/ProximitySensor.fmu"


def nested():
    """The whole grasp; the controller comes first, against the flow."""
    two = (1, 2)
    controller = component(
        "controller",
        "; ".join(
            f"input position[{j}] Real; input velocity[{j}]; input intensity[{j}]; "
            f"output force[{j}]"
            for j in two
        ),
        source="resources/GraspController.fmu",
    )
    plant = component(
        "plant",
        "; ".join(
            f"input force[{j}]; output position[{j}]; output velocity[{j}]; output gap[{j}] Real m"
            for j in two
        ),
        source="resources/GripperPlant.fmu",
    )
    connections = "".join(
        connect(f"plant/{name}[{j}]", f"controller/{name}[{j}]")
        for name in ("position", "velocity")
        for j in two
    )
    for j in two:
        connections += connect(f"sensors/gap{j}", f"plant/gap[{j}]")  # end before start
        connections += connect(f"sensors/xi{j}", f"controller/intensity[{j}]")
        connections += connect(f"controller/force[{j}]", f"plant/force[{j}]")
    place = bind(parameter_set("plant.initial_object_position Real 20.0 mm"))
    return structure(system("top", controller + plant + sensors(), connections, "", place), STOP)


def test_it_runs_as_the_flat_system_does(grasp, fmus, tmp_path):
    files = {f"resources/{f.name}": f.read_bytes() for f in fmus.glob("*.fmu")}
    loaded = System.load(archive(tmp_path, nested(), {}, files), step=1e-3)
    assert [c.name for c in loaded.components] == [
        "controller",
        "plant",
        "sensors_s1",
        "sensors_s2",
    ]

    # The same by hand: in the same order, with the sum of conversion and transformation.
    by_name = {c.name: c for c in grasp.components}
    order = ("controller", "plant", "sensor_1", "sensor_2")
    connections = tuple(
        type(w)(w.source, w.target, 2.0 if w.target.component == "sensor_2" else None)
        for w in grasp.connections
    )
    flat = System(
        "flat",
        tuple(by_name[n] for n in order),
        connections,
        1_000_000,
        2_500_000_000,
        "sequential",
    ).with_values({"plant.initial_object_position": 0.02, "sensor_1.reflectance": 0.86})

    ours, theirs = simulate(flat), simulate(loaded)
    for j in (1, 2):
        for name in (f"plant.gap[{j}]", f"plant.contact_force[{j}]", f"controller.force[{j}]"):
            np.testing.assert_allclose(theirs[name], ours[name], rtol=0.0, atol=1e-9)
        assert theirs[f"plant.contact[{j}]"].tolist() == ours[f"plant.contact[{j}]"].tolist()
        assert ours[f"plant.contact[{j}]"].any()
