"""Blocks that users write: any state, any names, any imports that a block may have."""

import ast
from pathlib import Path

import pytest
from fmus.native.c_block import CBlock, PythonBlock, library, same
from grasp_fmus.block_build import _run
from grasp_fmus.native.old.translation import translated

BASE = '''"""Doc "with" */ odd ??/ chars \\\\ \\
and a line."""
{future}
from dataclasses import dataclass
from typing import Annotated, NamedTuple
from math import floor
from block_variables import Input, Output, Parameter, check
{head}
'''
PARAMS = '''
@dataclass(frozen=True)
class Params:
    """*/ end"""
    k: Annotated[float, Parameter("gain */ ??/ é")] = 2.0
    n: Annotated[int, Parameter("n", low=0, high=9)] = 2
    w: Annotated[tuple[int, int], Parameter("w", low=0, high=9)] = (1, 2)
    on: Annotated[tuple[bool, bool], Parameter("on")] = (True, False)
'''
INPUTS = """
class Inputs(NamedTuple):
    a: Annotated[float, Input("a", nominal=1.0)] = 0.5
    f: Annotated[bool, Input("f")] = True
"""
OUTPUTS = """
class Outputs(NamedTuple):
    y: Annotated[float, Output("y", nominal=1.0, depends_on=set())]
    z: Annotated[tuple[bool, bool], Output("z", depends_on=set())]
"""
BLOCKS = {
    "plain": (
        "",
        "",
        PARAMS
        + INPUTS
        + """
class State(NamedTuple):
    n: int
    b: bool
    t: tuple[int, bool, float]
    u: tuple[tuple[float, float], tuple[float, float]]
"""
        + OUTPUTS
        + """
def initial_state(p, u): return State(p.n, u.f, (0, True, 0.0), ((0.0, 1.0), (2.0, u.a)))
def step(p, x, u, h):
    n, b, (i, c, v), ((q, r), s) = x
    n += 1
    if n > 5 and u.f:
        n = 0
        b = not b
    return State(n, b, (i + 2 * n, c and b, v + h * p.k * u.a), (s, (r, q + i)))
def outputs(p, x, u):
    return Outputs(x.n * 2 + x.t[0], (x.b, x.t[1] or p.on[1]))
""",
    ),
    "future": (
        "from __future__ import annotations",
        "",
        PARAMS
        + INPUTS
        + """
class State(NamedTuple):
    v: float
"""
        + OUTPUTS
        + """
def initial_state(p: Params, u: Inputs) -> State: return State(0.0)
def step(p: Params, x: State, u: Inputs, h: float) -> State:
    return State(x.v + h * u.a * p.w[1])
def outputs(p: Params, x: State, u: Inputs) -> Outputs:
    return Outputs(x.v, (True, x.v > 1))
""",
    ),
    "tuplestate": (
        "",
        "State = tuple[float, int]",
        PARAMS
        + INPUTS
        + OUTPUTS
        + """
def initial_state(p, u): return 0.0, 0
def step(p, x, u, h): return x[0] + h, x[1] + 1
def outputs(p, x, u): return Outputs(x[0] * x[1], p.on)
""",
    ),
    "empty": (
        "",
        "",
        PARAMS.replace(
            """    k: Annotated[float, Parameter("gain */ ??/ é")] = 2.0
    n: Annotated[int, Parameter("n", low=0, high=9)] = 2
    w: Annotated[tuple[int, int], Parameter("w", low=0, high=9)] = (1, 2)
    on: Annotated[tuple[bool, bool], Parameter("on")] = (True, False)
""",
            "",
        )
        + """
class Inputs(NamedTuple):
    pass
class State(NamedTuple):
    pass
"""
        + OUTPUTS
        + """
def initial_state(p, u): return State()
def step(p, x, u, h): return x
def outputs(p, x, u): return Outputs(1.0, (True, False))
""",
    ),
    "scalar": (
        "",
        "State = float",
        PARAMS
        + INPUTS
        + OUTPUTS
        + """
def initial_state(p, u): return u.a
def step(p, x, u, h):
    x = x + h
    return x
def outputs(p, x, u): return Outputs(x, (u.f, not u.f))
""",
    ),
    "block": (
        "",
        """from gripper_plant import friction, contact
from gripper_plant.friction import Pair as P2
from proximity_sensor import optics as seeing
LONGEST_STEP = 100
""",
        PARAMS
        + INPUTS
        + """
class State(NamedTuple):
    m: friction.Motion
"""
        + OUTPUTS
        + """
def initial_state(p, u): return State((0.0, 0.0))
def step(p, x, u, h): return State(friction.move(*x.m, 1.0, u.a, friction.NONE, h))
def outputs(p, x, u):
    return Outputs(contact.time_to_contact(x.m[0], x.m[1], -1.0), (x.m[0] > 0.0, False))
""",
    ),
    "string": (
        "",
        "",
        PARAMS
        + INPUTS
        + """
class State(NamedTuple):
    N_STATE: float
    M_1_PI: float
    DBL_MAX: bool
class variables(NamedTuple):
    step: float
    int: float
    p: float
"""
        + OUTPUTS
        + """
def block_step(v): return v
def step_(v, fault, Fault): return v * fault * Fault
def initial_state(p, u): return State(0.0, 1.0, True)
def step(p, x, u, h):
    string_block_step = variables(1.0, 2.0, 3.0)
    string_step_ = step_(1.0, 2.0, 3.0)
    v = block_step(string_block_step.int) + string_step_ + x.N_STATE
    return State(v, x.M_1_PI + h, not x.DBL_MAX)
def outputs(p, x, u): return Outputs(x.N_STATE, (x.M_1_PI > 0.0, x.DBL_MAX))
""",
    ),
}


@pytest.mark.parametrize("name", BLOCKS)
def test_a_block_gives_the_bits_of_python(name: str, tmp_path: Path) -> None:
    future, imports, body = BLOCKS[name]
    text = BASE.format(future=future, head=imports) + body
    file = tmp_path / f"{name}.py"
    file.write_text(text, "utf-8")
    with _run(file, ast.parse(text)) as block:
        python = PythonBlock(block)
        in_c = CBlock(library(translated(name.title(), block, file), tmp_path / "c"))
        v, x = python.starts, python.initial_state(python.starts)
        assert same(in_c.initial_state(v), x)
        for _ in range(20):
            assert isinstance(x, list)
            after = python.step(v, x, 1e-2)
            assert same(in_c.step(v, x, 1e-2), after)
            assert isinstance(after, list)
            x = after
            assert same(in_c.outputs(v, x), python.outputs(v, x))
