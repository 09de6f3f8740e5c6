"""The energy of a sampled exchange, as both loops add it up: the exact drift of a mass on a sampled
spring.
"""

import itertools
from array import array
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
import pytest
from grasp_cosim.exchange.energy import Bond
from grasp_cosim.master.drives import Drive
from grasp_cosim.master.engine import make_loop
from grasp_cosim.master.exchanges import begin, table_of
from grasp_cosim.master.loop import DRIVE, EXCHANGE
from grasp_cosim.master.plan import Plan
from grasp_cosim.system.parts import Port
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from support.marks import engines, examples, needs_compiler

pytestmark = needs_compiler

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


def _energies(rows, engine, found=(BOND,), transforms=(), cuts=()):
    """The energies of bonds in each row, as a loop adds them up in steps between the cuts."""
    table = table_of(found, COLUMN, dict(transforms))
    values = np.zeros(len(COLUMN) + len(found))
    values[: len(COLUMN)] = rows[0]
    begin(table, values)
    energies = [values[len(COLUMN) :].copy()]
    times = array("q", range(len(rows)))
    drives = [Drive(i, times, array("d", rows[1:, i]), linear=False) for i in COLUMN.values()]
    operations = [(DRIVE, 0, len(drives), 1, 0), (EXCHANGE, 0, len(found), 1, 0)]
    plan = Plan(values, np.zeros(3), operations, drives=drives, exchanges=table)
    loop = make_loop(plan, engine)
    ends = [0, *sorted(cuts), len(rows) - 1]
    for start, stop in itertools.pairwise(ends):
        piece = np.empty((max(stop - start, 1), len(values)))
        assert loop(piece, 0, start, stop, 0, 1, 1) == (stop, 0, 0)
        energies += [*piece[: stop - start, len(COLUMN) :]]
    return np.array(energies)


@engines
@pytest.mark.parametrize("run", [_run(), _run(late=1), _run(mass=2)])
def test_it_is_the_drift_of_the_total_energy(run, engine):
    total = 0.5 * STIFFNESS * run.rows[0, 1] ** 2
    assert run.drift[-1] > 1.0 * total
    energy = _energies(run.rows, engine)[:, 0]
    assert energy == pytest.approx(run.drift, rel=1e-12, abs=1e-12 * total)


@engines
@pytest.mark.parametrize("period", [2, 4])
def test_a_slow_source_answers_for_its_own_steps(period, engine):
    """In between, the spring has seen a position that it has no force for yet."""
    run = _run(spring=period)
    energy = _energies(run.rows, engine, [replace(BOND, period=period)])[:, 0]
    done = slice(None, None, period)
    assert energy[done] == pytest.approx(run.drift[done], rel=1e-11, abs=1e-14)


@engines
def test_values_that_are_not_finite_are_passed_on_without_a_warning(engine):
    rows = _run().rows[:4].copy()
    rows[2:, 1] = np.inf
    energy = _energies(rows, engine)[:, 0]
    assert np.isfinite(energy).tolist() == [True, True, False, False]


@engines
def test_units_of_the_source_are_those_of_the_connections(engine):
    """A spring in mm from another origin and kN, connections that convert, and a mass in cm."""
    run = _run()
    rows = run.rows * [1e-3, 100.0, 1.0, 1e3] + [0.0, 0.0, 0.0, 40.0]
    transforms = {HELD: (1e3, 0.0), SEEN: (10.0, 40.0)}
    energies = _energies(rows, engine, [replace(BOND, scale=0.01)], transforms)
    assert energies[:, 0] == pytest.approx(run.drift, rel=1e-9, abs=1e-14)


@examples()
@given(
    rows=arrays.arrays(np.float64, (23, 4), elements=st.floats(-1e6, 1e6)),
    cuts=st.lists(st.integers(0, 22), max_size=6),
    period=st.integers(1, 5),
)
def test_both_loops_give_the_same_bits_in_any_pieces(rows, cuts, period):
    both = [replace(BOND, period=period), replace(BOND, received=None)]
    whole = _energies(rows, "python", both)
    assert _energies(rows, "compiled", both, cuts=cuts).tobytes() == whole.tobytes()


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


@engines
@pytest.mark.parametrize("period", [1, 2, 3, 7])
@pytest.mark.parametrize("transforms", [{}, {HELD: (3.0, -0.5), SEEN: (10.0, 0.25)}])
def test_it_follows_the_formula(period, transforms, engine):
    rows = np.random.default_rng(period).standard_normal((40, 4))
    bond = replace(BOND, period=period, scale=1e-3)
    expected = _by_the_formula(rows, bond, transforms)
    energy = _energies(rows, engine, [bond], transforms)[:, 0]
    assert energy == pytest.approx(expected, rel=1e-12, abs=1e-15)
