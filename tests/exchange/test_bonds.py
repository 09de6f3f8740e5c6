"""Which inputs and outputs exchange energy, in which units: a finger and a spring in Python."""

import numpy as np
import pytest
from grasp_cosim import System, simulate
from grasp_cosim.exchange.energy import Bond, bonds
from grasp_cosim.system.parts import Port

EXPERIMENT = {"step": 0.01, "stop": 0.05}


def block(inputs, outputs, returned=()):
    """Python code with these inputs and outputs, which returns the same values at each point."""
    starts = {name: (0.0, unit) for name, unit in inputs.items()}
    names = {"inputs": starts, "outputs": outputs, "step": lambda self, t, inputs: dict(returned)}
    return type("Block", (), names)


def system_of(finger, spring, *connections, **more):
    components = {"finger": finger, "spring": spring}
    return System(components=components, connections=connections, experiment=EXPERIMENT, **more)


PUSH, LOOK = "spring.push -> finger.force", "finger.position -> spring.seen"
FINGER = block({"force": "N"}, {"position": "m"})
SPRING = block({"seen": "m"}, {"push": "N"})


def test_a_plain_force_and_position_are_a_bond_without_a_number():
    (bond,) = bonds(system_of(FINGER, SPRING, PUSH, LOOK))
    assert bond == Bond(
        "finger",
        None,
        Port("finger", "force"),
        Port("spring", "push"),
        Port("finger", "position"),
        Port("spring", "seen"),
        1,
        1.0,
    )
    assert bond.signal.name == "finger.exchange_energy"


def test_a_source_that_does_not_see_the_position_has_none_seen():
    spring = block({"seen": "m", "other": "m"}, {"push": "N", "where": "m"})
    (bond,) = bonds(system_of(FINGER, spring, PUSH, "spring.where -> spring.seen"))
    assert bond.received is None
    (bond,) = bonds(system_of(FINGER, spring, PUSH, "finger.position -> spring.other"))
    assert bond.received == Port("spring", "other")


@pytest.mark.parametrize(
    ("force", "position", "joule"), [("kN", "mm", 1.0), ("N", "mm", 1e-3), ("mN", "km", 1.0)]
)
def test_the_scale_is_the_energy_of_one_unit_each(force, position, joule):
    finger = block({"force": force}, {"position": position})
    (bond,) = bonds(system_of(finger, SPRING, PUSH, LOOK))
    assert bond.scale == pytest.approx(joule, rel=1e-15)


@pytest.mark.parametrize(
    ("inputs", "outputs"),
    [
        ({"force": "m"}, {"position": "m"}),
        ({"force": "N"}, {"position": "N"}),
        ({"force": None}, {"position": "m"}),
        ({"force": "N"}, {"position": 0.0}),
        ({"force": "N"}, {"place": "m"}),
        ({"force": "N", "position": "m"}, {"place": "m"}),
        ({"force": "N"}, {"position": "m", "exchange_energy": "J"}),
        ({"reinforce": "N"}, {"position": "m"}),
        ({"forces": "N"}, {"position": "m"}),
    ],
)
def test_what_is_no_force_with_a_position_is_no_bond(inputs, outputs):
    entered = next(iter(inputs))
    unit = inputs[entered]
    spring = block({"seen": "m"}, {"push": 0.0 if unit is None else unit})
    system = system_of(block(inputs, outputs), spring, f"spring.push -> finger.{entered}")
    assert bonds(system) == ()


def test_a_force_that_nothing_is_connected_to_is_no_bond():
    assert bonds(system_of(FINGER, SPRING, LOOK)) == ()


def test_each_force_goes_with_the_position_of_its_number():
    finger = block({"force[1]": "N", "force[12]": "N", "force[3]": "N"}, {"position[12]": "m"})
    system = system_of(finger, SPRING, *(f"spring.push -> finger.force[{i}]" for i in (1, 12, 3)))
    assert [(b.index, b.position.variable) for b in bonds(system)] == [(12, "position[12]")]


def test_a_run_records_it_in_joule():
    """Under the force of a step before, 1 N too small, it moves 3 mm a step: 1.5 mJ are lost."""

    class Moving:
        inputs = {"force": (0.0, "N")}  # noqa: RUF012
        outputs = {"position": "mm"}  # noqa: RUF012

        def step(self, t, inputs):
            return {"position": 300.0 * t}

    class Rising:
        outputs = {"push": "kN"}  # noqa: RUF012

        def step(self, t, inputs):
            return {"push": 0.1 * t}

    result = simulate(
        system_of(Moving, Rising, PUSH).with_settings({"experiment.scheme": "jacobi"})
    )
    assert result.units["finger.exchange_energy"] == "J"
    expected = -1.5e-3 * np.arange(6)
    assert result["finger.exchange_energy"] == pytest.approx(expected, rel=1e-12, abs=1e-15)


def test_the_grasp_has_a_bond_per_finger(grasp):
    found = bonds(grasp)
    assert found == tuple(
        Bond(
            "plant",
            j,
            Port("plant", f"force[{j}]"),
            Port("controller", f"force[{j}]"),
            Port("plant", f"position[{j}]"),
            Port("controller", f"position[{j}]"),
            1,
            1.0,
        )
        for j in (1, 2)
    )
    assert [(b.signal.name, b.signal.unit, b.signal.kind) for b in found] == [
        ("plant.exchange_energy[1]", "J", "Real"),
        ("plant.exchange_energy[2]", "J", "Real"),
    ]
