"""The loop itself, interpreted and compiled: moves, casts of every type, rates, statuses."""

import numpy as np
import pytest
from grasp_cosim.base.calls import Call
from grasp_cosim.master import loop
from grasp_cosim.master.engine import make_loop
from grasp_cosim.master.loop import CALL, COPY, LOAD, LOAD_LONG, SCALE, STEP, STORE
from grasp_cosim.master.plan import Plan
from support.marks import engines

TYPES = [
    "float32",
    "int8",
    "uint8",
    "int16",
    "uint16",
    "int32",
    "uint32",
    "int64",
    "uint64",
    "bool",
]

pytestmark = engines


def plan(values, operations, **parts):
    lists = {name: list(part) for name, part in parts.items()}
    return Plan(np.array(values, float), np.zeros(2), list(operations), **lists)


def run(made, engine, steps, operation=0):
    """What the loop returns, and the rows."""
    call = make_loop(made, engine)
    rows = np.full((steps, len(made.values)), np.nan)
    return call(rows, operation, 0, steps, 0, 1_000_000), rows


def test_a_copy_keeps_the_sign_of_zero_and_a_scale_computes(engine):
    connections = ((0, 1, 1.0, 0.0), (0, 2, 3.0, 0.1))
    made = plan(
        [-0.0, 5.0, 5.0], [(COPY, 0, 1, 1, 0), (SCALE, 1, 2, 1, 0)], connections=connections
    )
    result, rows = run(made, engine, 1)
    assert result == (1, 0, 0)
    assert rows[0].tobytes() == np.array([-0.0, -0.0, 3.0 * -0.0 + 0.1]).tobytes()


@pytest.mark.parametrize("name", TYPES)
def test_numbers_of_every_type_come_through(engine, name):
    dtype = np.dtype(name)
    ends = [0, 1]
    if dtype.kind in "iu":
        info = np.iinfo(dtype)
        ends = [max(info.min, 1 - 2**53), min(info.max, 2**53 - 1)]
    elif dtype.kind == "f":
        ends = [np.float32(0.1), np.float32(-3e38)]
    source, target = np.array(ends, dtype), np.zeros(2, dtype)
    long = LOAD_LONG if dtype.itemsize == 8 else LOAD
    made = plan(
        [0.0, 0.0], [(long, 0, 2, 1, 0), (STORE, 2, 4, 1, 0)],
        casts=((0, 0, 0), (0, 1, 1), (1, 0, 0), (1, 1, 1)), buffers=(source, target),
    )  # fmt: skip
    result, rows = run(made, engine, 1)
    assert result == (1, 0, 0)
    assert rows[0].tolist() == [float(x) for x in ends]
    assert target.tobytes() == source.tobytes()


def test_any_byte_but_zero_is_true(engine):
    """As a C compiler that does not know fmi3Boolean for a bool leaves it."""
    found = np.array([0, 1, 255], np.uint8).view(np.bool_)
    casts = tuple((0, i, i) for i in range(3))
    made = plan([7.0, 7.0, 7.0], [(LOAD, 0, 3, 1, 0)], casts=casts, buffers=(found,))
    assert run(made, engine, 1)[1].tolist() == [[0.0, 1.0, 1.0]]


@pytest.mark.parametrize(("name", "value"), [("int64", -(2**53)), ("uint64", 2**64 - 1)])
def test_an_integer_that_a_float_does_not_hold_is_refused(engine, name, value):
    made = plan(
        [7.0], [(LOAD_LONG, 0, 1, 1, 0)], casts=((0, 0, 0),), buffers=(np.array([value], name),)
    )
    assert run(made, engine, 1)[0] == (0, 0, loop.TOO_LONG)
    assert made.values[0] == 7.0


def test_a_slow_operation_runs_in_its_phase_with_its_own_time(engine):
    seen = []

    def call():
        seen.append((float(made.clock[0]), float(made.clock[1])))
        return 0

    made = plan([0.0], [(STEP, 0, 1, 3, 2)], calls=(Call(call),))
    run(made, engine, 7)
    assert seen == [(0.0, 2.0), (0.003, 5.0)]


def test_a_bad_status_says_where_and_the_run_can_go_on_behind_it(engine):
    statuses = iter([0, 1, 2, 0, 0])
    made = plan([0.0], [(CALL, 0, 1, 1, 0), (CALL, 1, 2, 1, 0)], calls=(
        Call(lambda: next(statuses)), Call(lambda: 0),
    ))  # fmt: skip
    assert run(made, engine, 4)[0] == (2, 0, 2)
    assert run(made, engine, 2, operation=1)[0] == (2, 0, 0)
