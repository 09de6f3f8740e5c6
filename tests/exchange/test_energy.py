"""The energy of a sampled exchange: the exact drift of a mass on a sampled spring."""

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
import pytest
from grasp_cosim.exchange.energy import Bond, ExchangeEnergy, bonds
from grasp_cosim.system.parts import Port
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
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


def _run(spring=1, mass=1, late=0):
    """A mass on a sampled spring, which either steps once in so many base steps.

    The mass moves under the force at the start of its own step, exactly. The spring sees a position
    at the start of its step, and answers at its end; of one base step it sees the end, unless it is
    late, as in Jacobi's scheme.
    """
    x, v = 0.01, 0.0
    rows, velocity = [(-STIFFNESS * x, x, -STIFFNESS * x, x)], [v]
    for k in range(STEPS):
        force, before, held, seen = rows[-1]
        held = force if k % mass == 0 else held
        if (k + 1) % mass == 0:
            time = mass * STEP
            x, v = x + v * time + 0.5 * held / MASS * time**2, v + held / MASS * time
        if k % spring == 0:
            seen = before if late or spring > 1 else x
        if (k + 1) % spring == 0:
            force = -STIFFNESS * seen
        rows.append((force, x, held, seen))
        velocity.append(v)
    return Run(np.array(rows), np.array(velocity))


def _energy(rows, bond=BOND):
    return ExchangeEnergy([bond], COLUMN)(rows)[:, 0]


@pytest.mark.parametrize("run", [_run(), _run(late=1), _run(mass=2)])
def test_it_is_the_drift_of_the_total_energy(run):
    total = 0.5 * STIFFNESS * run.rows[0, 1] ** 2
    assert run.drift[-1] > 1.0 * total
    assert _energy(run.rows) == pytest.approx(run.drift, rel=1e-12, abs=1e-12 * total)


@pytest.mark.parametrize("period", [2, 4])
def test_a_slow_source_answers_for_its_own_steps(period):
    """In between, the spring has seen a position that it has no force for yet."""
    run = _run(spring=period)
    energy = _energy(run.rows, replace(BOND, period=period))
    done = slice(None, None, period)
    assert energy[done] == pytest.approx(run.drift[done], rel=1e-11, abs=1e-14)


def test_values_that_are_not_finite_are_passed_on_without_a_warning():
    rows = _run().rows[:4].copy()
    rows[2:, 1] = np.inf
    assert np.isfinite(_energy(rows)).tolist() == [True, True, False, False]


def test_units_of_the_source_are_those_of_the_connections():
    """A spring in mm from another origin and kN, connections that convert, and a mass in cm."""
    run = _run()
    rows = run.rows * [1e-3, 100.0, 1.0, 1e3] + [0.0, 0.0, 0.0, 40.0]
    energies = ExchangeEnergy(
        [replace(BOND, scale=0.01)], COLUMN, {HELD: (1e3, 0.0), SEEN: (10.0, 40.0)}
    )(rows)
    assert energies[:, 0] == pytest.approx(run.drift, rel=1e-9, abs=1e-14)


@examples()
@given(
    rows=arrays.arrays(np.float64, (23, 4), elements=st.floats(-1e6, 1e6)),
    cuts=st.lists(st.integers(0, 23), max_size=6),
    period=st.integers(1, 5),
)
def test_blocks_of_any_size_give_the_same_bits(rows, cuts, period):
    both = [replace(BOND, period=period), replace(BOND, received=None)]
    whole = ExchangeEnergy(both, COLUMN)(rows)
    energy = ExchangeEnergy(both, COLUMN)
    parts = [energy(part.copy()) for part in np.split(rows, sorted(cuts))]
    assert np.concatenate(parts).tobytes() == whole.tobytes()


def _by_the_formula(rows, bond, transforms):
    """The energies of the module's first lines, one row after the other."""
    of_force, of_seen = (transforms.get(port, (1.0, 0.0)) for port in (HELD, SEEN))
    force = rows[:, COLUMN[FORCE]] * of_force[0] + of_force[1]
    seen = (rows[:, COLUMN[SEEN]] - of_seen[1]) / of_seen[0]
    position, held = rows[:, COLUMN[POSITION]], rows[:, COLUMN[HELD]]
    energies, answered = [0.0], 0
    for k in range(1, len(rows)):
        change = held[k] * (position[k] - position[k - 1])
        if k % bond.period == 0:
            change -= 0.5 * (force[k] + force[answered]) * (seen[k] - seen[answered])
            answered = k
        energies.append(energies[-1] + bond.scale * change)
    return np.array(energies)


@pytest.mark.parametrize("period", [1, 2, 3, 7])
@pytest.mark.parametrize("block", [1, 4, 5, 40])
@pytest.mark.parametrize("transforms", [{}, {HELD: (3.0, -0.5), SEEN: (10.0, 0.25)}])
def test_blocks_of_any_size_follow_the_formula(period, block, transforms):
    """Also where the ends of the source's steps are anywhere in a block, and after a way back."""
    rows = np.random.default_rng(period).standard_normal((40, 4))
    bond = replace(BOND, period=period, scale=1e-3)
    energy = ExchangeEnergy([bond], COLUMN, transforms)
    expected = _by_the_formula(rows, bond, transforms)
    start = energy.saved()
    for _ in range(2):
        blocks = [energy(rows[first : first + block])[:, 0] for first in range(0, 40, block)]
        assert np.concatenate(blocks) == pytest.approx(expected, rel=1e-12, abs=1e-15)
        energy.restore(start)
    middle = energy(rows[:block]), energy.saved()
    energy(rows[::-1])
    energy.restore(middle[1])
    after = energy(rows[block : 2 * block])[:, 0]
    assert after == pytest.approx(expected[block : 2 * block], rel=1e-12, abs=1e-15)


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
    ports = (p for b in found for p in (b.force, b.source, b.position, b.received))
    signals = ExchangeEnergy(found, dict.fromkeys(ports, 0)).signals
    assert [(s.name, s.unit, s.kind) for s in signals] == [
        ("plant.exchange_energy[1]", "J", "Real"),
        ("plant.exchange_energy[2]", "J", "Real"),
    ]
    assert "plant.force[1]" in signals[0].description


def test_the_source_keeps_its_own_step(grasp):
    slow = replace(grasp.component("controller", "test"), step_ns=4 * grasp.step_ns)
    components = tuple(slow if c.name == slow.name else c for c in grasp.components)
    system = replace(grasp, components=components)
    assert [b.period for b in bonds(system)] == [4, 4]
