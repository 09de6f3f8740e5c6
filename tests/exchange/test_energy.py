"""The energy of a sampled exchange: the exact drift of a mass on a sampled spring."""

from copy import copy
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
import pytest
from grasp_controller import series
from grasp_cosim.exchange.energy import Bond, ExchangeEnergy, bonds
from grasp_cosim.interface.interface import MOST_ELEMENTS
from grasp_cosim.interface.read import read_interface
from grasp_cosim.system import parts
from grasp_cosim.system.parts import Port
from gripper_plant import rigid
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from proximity_sensor import optics
from support.direct import closed_loop
from support.marks import examples

Array = npt.NDArray[np.float64]

MASS, STIFFNESS, STEP, STEPS = 0.5, 98.0, 2e-3, 2000
"""kg, N/m, s: the finger and the controller's spring, with a step that creates much energy."""

HELD, FORCE, POSITION, SEEN = (
    Port("mass", "force"),
    Port("spring", "force"),
    Port("mass", "position"),
    Port("spring", "position"),
)
COLUMN = {FORCE: 0, POSITION: 1, HELD: 2, SEEN: 3}
BOND = Bond("mass", None, HELD, FORCE, POSITION, SEEN, 1, 1.0)


@dataclass(frozen=True)
class Run:
    """Rows of values as COLUMN has them, and the velocity of the mass."""

    rows: Array
    velocity: Array

    @property
    def drift(self):
        """J; kinetic energy and that of the spring, against the start."""
        energy = 0.5 * MASS * self.velocity**2 + 0.5 * STIFFNESS * self.rows[:, COLUMN[SEEN]] ** 2
        return energy - energy[0]


def _moved(x, v, force, time):
    """Position and velocity of the mass after a time under a constant force: exact."""
    return x + v * time + 0.5 * force / MASS * time**2, v + force / MASS * time


def _sequential(step=STEP, steps=STEPS):
    """First the mass, then the spring at the place where the mass is then."""
    x, v = 0.01, 0.0
    rows, velocity = [(-STIFFNESS * x, x, -STIFFNESS * x, x)], [v]
    for _ in range(steps):
        held = rows[-1][0]
        x, v = _moved(x, v, held, step)
        rows.append((-STIFFNESS * x, x, held, x))
        velocity.append(v)
    return Run(np.array(rows), np.array(velocity))


def _jacobi():
    """Both with the values of the last communication point."""
    x, v = 0.01, 0.0
    rows, velocity = [(-STIFFNESS * x, x, -STIFFNESS * x, x)], [v]
    for _ in range(STEPS):
        held, seen = rows[-1][:2]
        x, v = _moved(x, v, held, STEP)
        rows.append((-STIFFNESS * seen, x, held, seen))
        velocity.append(v)
    return Run(np.array(rows), np.array(velocity))


def _slow_spring(period):
    """The spring sees a position at the start of its step, and answers at the end."""
    x, v = 0.01, 0.0
    rows, velocity = [(-STIFFNESS * x, x, -STIFFNESS * x, x)], [v]
    for k in range(STEPS):
        held, before, _, seen = rows[-1]
        x, v = _moved(x, v, held, STEP)
        seen = before if k % period == 0 else seen
        force = -STIFFNESS * seen if (k + 1) % period == 0 else held
        rows.append((force, x, held, seen))
        velocity.append(v)
    return Run(np.array(rows), np.array(velocity))


def _slow_mass(period):
    """The mass goes once in so many steps, under the force at the start of its own step."""
    x, v = 0.01, 0.0
    rows, velocity = [(-STIFFNESS * x, x, -STIFFNESS * x, x)], [v]
    for k in range(STEPS):
        force, _, held, _ = rows[-1]
        held = force if k % period == 0 else held
        if (k + 1) % period == 0:
            x, v = _moved(x, v, held, period * STEP)
        rows.append((-STIFFNESS * x, x, held, x))
        velocity.append(v)
    return Run(np.array(rows), np.array(velocity))


def _energy(rows, bond=BOND):
    return ExchangeEnergy([bond], COLUMN)(rows)[:, 0]


@pytest.mark.parametrize("run", [_sequential(), _jacobi(), _slow_mass(2)])
def test_it_is_the_drift_of_the_total_energy(run):
    total = 0.5 * STIFFNESS * run.rows[0, 1] ** 2
    assert run.drift[-1] > 1.0 * total
    assert _energy(run.rows) == pytest.approx(run.drift, rel=1e-12, abs=1e-12 * total)


@pytest.mark.parametrize("period", [2, 4])
def test_a_slow_source_answers_for_its_own_steps(period):
    """In between, the spring has seen a position that it has no force for yet."""
    run = _slow_spring(period)
    energy = _energy(run.rows, replace(BOND, period=period))
    done = slice(None, None, period)
    assert energy[done] == pytest.approx(run.drift[done], rel=1e-11, abs=1e-14)


def test_a_sampled_spring_creates_energy_as_its_eigenvalues_say():
    """The state is multiplied by a matrix of determinant 1 + k h^2 / (2 m) in each step."""
    run = _sequential()
    total = 0.5 * STIFFNESS * run.rows[0, 1] ** 2
    growth = (1.0 + 0.5 * STIFFNESS * STEP**2 / MASS) ** STEPS
    assert _energy(run.rows)[-1] == pytest.approx(total * (growth - 1.0), rel=0.03)


def test_each_step_leaks_half_the_stiffness_times_the_squared_motion():
    rows = _sequential().rows
    leak = 0.5 * STIFFNESS * np.diff(rows[:, 1]) ** 2
    assert np.diff(_energy(rows)) == pytest.approx(leak, rel=1e-6, abs=1e-15)


def test_it_falls_with_the_step():
    coarse, fine = (_energy(_sequential(h, round(0.1 / h)).rows)[-1] for h in (2e-4, 1e-4))
    assert coarse / fine == pytest.approx(2.0, rel=0.02)


def test_the_first_row_is_zero():
    assert _energy(_sequential().rows[:1]).tolist() == [0.0]


def test_values_that_are_not_finite_are_passed_on_without_a_warning():
    rows = _sequential().rows[:4].copy()
    rows[2:, 1] = np.inf
    assert np.isfinite(_energy(rows)).tolist() == [True, True, False, False]


def test_units_of_the_source_are_those_of_the_connections():
    """A spring in mm from another origin and kN, connections that convert, and a mass in cm."""
    run = _sequential()
    rows = run.rows * [1e-3, 100.0, 1.0, 1e3] + [0.0, 0.0, 0.0, 40.0]
    energies = ExchangeEnergy(
        [replace(BOND, scale=0.01)], COLUMN, {HELD: (1e3, 0.0), SEEN: (10.0, 40.0)}
    )(rows)
    assert energies[:, 0] == pytest.approx(run.drift, rel=1e-9, abs=1e-14)


def test_a_connection_with_a_factor_of_zero_shows_the_source_no_motion():
    rows = _sequential().rows
    (energy,) = ExchangeEnergy([BOND], COLUMN, {SEEN: (0.0, 0.0)})(rows).T
    assert energy[-1] == pytest.approx(float(np.sum(rows[1:, 2] * np.diff(rows[:, 1]))))


@examples()
@given(
    rows=arrays.arrays(np.float64, (23, 4), elements=st.floats(-1e6, 1e6)),
    cuts=st.lists(st.integers(0, 23), max_size=6),
    period=st.integers(1, 5),
)
def test_blocks_of_any_size_give_the_same_bits(rows, cuts, period):
    both = [replace(BOND, period=period), replace(BOND, seen=None)]
    whole = ExchangeEnergy(both, COLUMN)(rows)
    energy = ExchangeEnergy(both, COLUMN)
    parts = [energy(part.copy()) for part in np.split(rows, sorted(cuts))]
    assert np.concatenate(parts).tobytes() == whole.tobytes()


@pytest.mark.parametrize("j", [1, 2])
def test_on_the_way_to_contact_it_is_kinetic_energy_less_what_the_controller_gave(j):
    """The fingers, moved by their blocks: free of contact, they keep all the work they get."""
    sensor = optics.Params()
    signals = closed_loop(
        rigid.Params(), (sensor, sensor), series.Params(), 1e-3, 3000, until_contact=True
    )
    free = ~signals[f"plant.contact[{j}]"]
    force, x, v = (
        signals[name][free]
        for name in (f"controller.force[{j}]", f"plant.position[{j}]", f"plant.velocity[{j}]")
    )
    held = np.concatenate([force[:1], force[:-1]])
    kinetic = 0.5 * rigid.Params().finger_mass[j - 1] * v**2
    given = np.concatenate([[0.0], np.cumsum(0.5 * (force[1:] + force[:-1]) * np.diff(x))])
    energy = _energy(np.column_stack([force, x, held, x]))
    assert abs(energy).max() > 1e-6
    assert energy == pytest.approx(kinetic - given, abs=1e-12)


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
    signals = ExchangeEnergy(found, {p: 0 for b in found for p in _ports(b)}).signals
    assert [(s.name, s.unit, s.kind) for s in signals] == [
        ("plant.exchange_energy[1]", "J", "Real"),
        ("plant.exchange_energy[2]", "J", "Real"),
    ]
    assert "plant.force[1]" in signals[0].description


def _ports(bond):
    return [p for p in (bond.force, bond.source, bond.position, bond.seen) if p]


def _with_component(system, changed):
    return tuple(changed if c.name == changed.name else c for c in system.components)


def test_the_source_keeps_its_own_step(grasp):
    slow = replace(grasp.component("controller", "test"), step_ns=4 * grasp.step_ns)
    system = replace(grasp, components=_with_component(grasp, slow))
    assert [b.period for b in bonds(system)] == [4, 4]


def unread(system):
    """The system as it was checked, but whose components read their FMUs anew."""
    other = copy(system)
    object.__setattr__(other, "components", tuple(replace(c) for c in system.components))
    return other


@pytest.mark.parametrize("name", ["force[1]", "position[1]"])
def test_an_array_makes_no_bond(name, grasp, monkeypatch):
    """As FMI 3.0 has them, and too large to be taken apart: it is not recorded."""

    def declared(path):
        found = read_interface(path)
        large = (MOST_ELEMENTS + 1,)
        variables = tuple(
            replace(v, shape=large, sizes=(None,)) if v.name == name else v for v in found.variables
        )
        return replace(found, variables=variables)

    monkeypatch.setattr(parts, "read_interface", declared)
    assert [b.index for b in bonds(unread(grasp))] == [2]
