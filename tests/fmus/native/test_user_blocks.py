"""Blocks that users write: any state, any names, annotations or not, checks of their own."""

from random import Random

import pytest
from fmus.native.c_block import Both, loaded
from support.native_fmus import needs_gcc

pytestmark = needs_gcc

HEAD = '''"""Doc "with" */ odd ??/ chars \\\\ \\
and a line."""
{future}
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, NamedTuple
from block_variables import Group, Input, Output, Parameter, check
{imports}
class Inputs(NamedTuple):
    a: Annotated[float, Input("a", nominal=1.0)] = 0.5
    f: Annotated[bool, Input("f")] = True
class Outputs(NamedTuple):
    y: Annotated[float, Output("y", nominal=1.0, depends_on=set())]
    z: Annotated[tuple[bool, bool], Output("z", depends_on=set())]
'''
PARAMS = '''
@dataclass(frozen=True)
class Other(Group, name="other"):
    gain: Annotated[float, Parameter("K", unit="N/m", low=0.5)] = 2.0
    @cached_property
    def twice(self): return 2.0 * self.gain
@dataclass(frozen=True)
class Params:
    """*/ end"""
    k: Annotated[float, Parameter("gain */ ??/ é")] = 2.0
    n: Annotated[int, Parameter("n", low=0, high=9)] = 2
    w: Annotated[tuple[int, int], Parameter("w", low=0, high=9)] = (1, 2)
    on: Annotated[tuple[bool, bool], Parameter("on")] = (True, False)
    other: Other = Other()
    def __post_init__(self) -> None:
        check(self)
        if self.w[0] > self.w[1]:
            # in order
            raise ValueError(f"w[1] = {self.w[0]}: 100 %, {self.k!r} or {self.other.twice:.3g}")
    @cached_property
    def total(self): return self.other.twice * self.w[0] + self.n
'''
BLOCKS = {
    "plain": (
        "",
        """
class State(NamedTuple):
    n: int
    b: bool
    t: tuple[int, bool, float]
    u: tuple[tuple[float, float], tuple[float, float]]
def initial_state(p, u): return State(p.n, u.f, (0, True, 0.0), ((0.0, 1.0), (2.0, u.a)))
def step(p, x, u, h):
    n, b, (i, c, v), ((q, r), s) = x
    n += 1
    if n > 5 and u.f:
        n = 0
        b = not b
    return State(n, b, (i + 2 * n, c and b, v + h * p.k * u.a), (s, (r, q + i * p.total)))
def outputs(p, x, u): return Outputs(x.n * 2.0 + x.t[0], (x.b, x.t[1] or p.on[1]))
""",
    ),
    "future": (
        "State = tuple[float, int]",
        """
def initial_state(p: Params, u: Inputs) -> State: return 0.0, 0
def step(p: Params, x: State, u: Inputs, h: float) -> State: return x[0] + h, x[1] + 1
def outputs(p: Params, x: State, u: Inputs) -> Outputs: return Outputs(x[0] * x[1], p.on)
""",
    ),
    "scalar": (
        "State = float",
        """
def initial_state(p, u): return u.a
def step(p, x, u, h):
    x = x + h
    return x
def outputs(p, x, u): return Outputs(x, (u.f, not u.f))
""",
    ),
    "block": (
        """from gripper_plant import friction, contact
from gripper_plant.friction import Pair as P2
""",
        """
class State(NamedTuple):
    m: friction.Motion
def initial_state(p, u): return State((0.0, 0.0))
def step(p, x, u, h): return State(friction.move(*x.m, 1.0, u.a, friction.NONE, h))
def outputs(p, x, u):
    return Outputs(contact.time_to_contact(x.m[0], x.m[1], -1.0), (x.m[0] > 0.0, False))
""",
    ),
    "string": (
        "",
        """
class State(NamedTuple):
    int: float
    double: float
    why: bool
class variables(NamedTuple):
    step: float
    values: float
    p: float
def block_step(v): return v
def step_(v, exp, sqrt): return v * exp * sqrt
def initial_state(p, u): return State(0.0, 1.0, True)
def step(p, x, u, h):
    string_v = variables(1.0, 2.0, 3.0)
    string_step_ = step_(1.0, 2.0, 3.0)
    v = block_step(string_v.values) + string_step_ + x.int
    return State(v, x.double + h, not x.why)
def outputs(p, x, u): return Outputs(x.int, (x.double > 0.0, x.why))
""",
    ),
}


@pytest.mark.parametrize("name", BLOCKS)
def test_a_block_gives_the_bits_of_python(name, tmp_path):
    imports, body = BLOCKS[name]
    future = "from __future__ import annotations" if name == "future" else ""
    source = HEAD.format(future=future, imports=imports) + PARAMS + body
    with loaded(tmp_path / f"{name}.py", source) as block:
        both = Both(name, block, tmp_path / "c", options=["-O0"])
        assert sum(both.random_run(Random(seed), 8) for seed in range(8)) > 20
        text = (tmp_path / "c" / "block.h").read_text()
        assert '"other.gain", " N/m", KIND_REAL, PARAMETER, 1, 1, 0.5, INFINITY, 2.0}' in text
        values = both.starts()
        assert both.check(values) == ""
        values[[v.name for v in both.variables].index("w[1]")] = 3
        assert both.check(values) == "w[1] = 3.0: 100 %, 2.0 or 4"
