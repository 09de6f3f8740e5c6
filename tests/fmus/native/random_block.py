"""Blocks by chance, of all that the translator takes; what they calculate stays small."""

HEAD = '''"""By chance."""

import math
from dataclasses import dataclass
from functools import cached_property
from math import atan2, copysign, cos, exp, floor, fmod, log, sin, sqrt, tanh
from typing import Annotated, NamedTuple

from block_variables import Input, Output, Parameter, check

Row = tuple[float, float, float]
TIMES = 4
SCALE = 0.75
GRID = (0.25, -1.5, 2.0)


class Spot(NamedTuple):
    at: float
    row: Row
    low: bool = False

    @property
    def reach(self) -> float:
        return self.at - self.row[1]


@dataclass(frozen=True)
class Params:
    k: Annotated[float, Parameter("k", low=-10.0, high=10.0)] = 0.5
    n: Annotated[int, Parameter("n", low=0, high=6)] = 3
    on: Annotated[bool, Parameter("on")] = True
    w: Annotated[Row, Parameter("w", low=-5.0, high=5.0)] = (1.0, -0.5, 0.25)

    def __post_init__(self) -> None:
        check(self)
        if self.on and self.k * self.w[0] > 20.0:
            raise ValueError(f"k = {self.k!r}: too large with w[1] = {self.w[0]:g}")

    @cached_property
    def kept(self) -> Row:
        return tuple(self.k * w for w in self.w)


class Inputs(NamedTuple):
    a: Annotated[float, Input("a", nominal=1.0)] = 0.5
    r: Annotated[Row, Input("r", nominal=1.0)] = (0.1, 0.2, -0.3)
    f: Annotated[bool, Input("f")] = False


class State(NamedTuple):
    x: float
    spot: Spot
    count: int
    was: bool


class Outputs(NamedTuple):
    y: Annotated[float, Output("y", nominal=1.0, depends_on={"a"})]
    z: Annotated[Row, Output("z", nominal=1.0, depends_on=set())]
    b: Annotated[bool, Output("b", depends_on=set())]


def initial_state(p: Params, u: Inputs) -> State:
    return State(u.a, Spot(p.k, u.r), p.n, u.f)
'''
TAIL = """

def step(p: Params, x: State, u: Inputs, h: float) -> State:
    y = tanh({last}(p, x.spot, x.x, u.a))
    row = tuple(tanh(q) for q in mixed(p, x, u))
    spot = x.spot._replace(at=tanh(x.spot.at + h * u.r[0]), row=row)
    spot = spot._replace(low=y < x.x) if x.was else spot
    return State(y, spot, x.count + 1 if u.f else 0, y > u.a or x.was and not u.f)


def outputs(p: Params, x: State, u: Inputs) -> Outputs:
    q, r, s = mixed(p, x, u)
    return Outputs({first}(p, x.spot, x.x, u.a), (r, s, q), x.was)


def mixed(p: Params, x: State, u: Inputs) -> Row:
    return tuple({first}(p, x.spot, one, other) for one, other in zip(x.spot.row, u.r))
"""
READ = ("a", "b", "p.k", "s.at", "s.reach", "p.w[1]", "s.row[-1]", "p.kept[0]", "SCALE", "GRID[2]")
OF_ONE = (
    "tanh({})",
    "sin({})",
    "cos({})",
    "exp(-abs({}))",
    "sqrt(abs({}))",
    "log(abs({}) + 1.5)",
)
OF_ONE += (
    "float(floor({}))",
    "abs({})",
    "-{}",
    "(-{})",
    "math.atan({})",
    "({} + 0.5)",
    "({}) ** 2",
)
OF_TWO = (
    "({} + {})",
    "({} - {})",
    "{} * {}",
    "{} / (abs({}) + 0.5)",
    "min({}, {})",
    "max({}, {})",
)
OF_TWO += (
    "copysign({}, {})",
    "fmod({}, abs({}) + 0.3)",
    "atan2({}, {})",
    "(abs({}) + 0.1) ** tanh({})",
)
OF_TWO += ("max({}, {}, *p.w)", "({}, {})[1]")


class Writer:
    """Writes one function; `reals` are the variables that have a value."""

    def __init__(self, random, earlier):
        self.random, self.earlier = random, earlier
        self.reals, self.lines, self.loops = [*READ], [""], 0

    def real(self, depth=3):
        r = self.random
        kind = r.random()
        if depth == 0 or kind < 0.15:
            return r.choice([*self.reals, f"{r.uniform(-3.0, 3.0):.3f}", repr(r.gauss(0.0, 1.0))])
        if kind < 0.4:
            return r.choice(OF_ONE).format(self.real(depth - 1))
        if kind < 0.85:
            return r.choice(OF_TWO).format(self.real(depth - 1), self.real(depth - 1))
        if kind < 0.93 and self.earlier:
            return f"{r.choice(self.earlier)}(p, s, {self.real(depth - 1)}, {self.real(0)})"
        return f"({self.real(depth - 1)} if {self.test()} else {self.real(depth - 1)})"

    def test(self, depth=2):
        r = self.random
        if depth and r.random() < 0.3:
            return f"({self.test(depth - 1)} {r.choice(['and', 'or'])} {self.test(depth - 1)})"
        some = ("{} < {}", "{} >= {}", "not {} > {}", "{} != {}", "0.0 < {} <= {}")
        if r.random() < 0.2:
            return r.choice(["p.on", "s.low", "any(w > a for w in p.w)", "p.n > 2"])
        return r.choice(some).format(self.real(1), self.real(1))

    def say(self, indent, line):
        self.lines.append(f"{'    ' * indent}{line}")

    def block(self, indent, looping=False):
        before = [*self.reals]
        for _ in range(self.random.randint(1, 3)):
            self.statement(indent)
        if looping and self.random.random() < 0.5:
            self.say(indent, f"if {self.test(1)}:")
            self.say(indent + 1, self.random.choice(["break", "continue"]))
        self.reals = before

    def statement(self, indent):
        r = self.random
        own = [v for v in self.reals if v[0] == "v" or v in "ab"]
        new = f"v{len(self.lines)}"
        kind = r.randrange(9 if indent < 3 else 5)
        if kind < 2:
            self.say(indent, f"{new} = {self.real()}")
            self.reals.append(new)
        elif kind == 2:
            self.say(indent, f"{r.choice(own)} {r.choice(['+', '-', '*'])}= {self.real(1)}")
        elif kind == 3 and len(own) > 1:
            one, other = r.sample(own, 2)
            self.say(indent, f"{one}, {other} = {other}, {self.real(2)}")
        elif kind == 4:
            self.say(indent, f"{new}_0, (_, {new}) = {self.real(1)}, (a, {self.real(1)})")
            self.reals += [new, f"{new}_0"]
        elif kind == 5:
            self.say(indent, f"if {self.test()}:")
            self.block(indent + 1)
            self.say(indent + 1, f"{new} = {self.real()}")
            self.say(indent, f"elif {self.test()}:")
            self.say(indent + 1, r.choice([f"return {self.real()}", f"{new} = {self.real(1)}"]))
            self.say(indent, "else:")
            self.say(indent + 1, f"{new} = {self.real(1)}")
            self.reals.append(new)
        elif kind == 6:
            self.say(indent, f"for _ in range({r.choice(['3', 'TIMES', 'p.n'])}):")
            self.block(indent + 1, looping=True)
        elif kind == 7:
            self.say(indent, f"for i{indent} in range(1, {r.choice(['4', 'p.n + 1'])}):")
            self.say(indent + 1, f"{r.choice(own)} += {self.real(1)} / i{indent}")
        else:
            self.say(indent, f"{new} = 0.0")
            self.say(indent, f"for q, (g, _) in zip(p.w, ((a, b), (b, a), ({self.real(1)}, a))):")
            self.say(indent + 1, f"{new} += q * g")
            self.reals.append(new)


def random_block(random):
    """The source of a block."""
    text, names = HEAD, list[str]()
    for i in range(random.randint(2, 4)):
        writer = Writer(random, names)
        writer.say(0, f"def f{i}(p: Params, s: Spot, a: float, b: float) -> float:")
        for _ in range(random.randint(2, 6)):
            writer.statement(1)
        writer.say(1, f"return {writer.real()}")
        text += "\n" + "\n".join(writer.lines) + "\n"
        names = [*names, f"f{i}"]
    return text + TAIL.format(first=names[0], last=names[-1])
