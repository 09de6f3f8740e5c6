"""Each construct of the subset gives in C what it gives in Python, wherever that is a value."""

import math
import textwrap
from random import Random

import pytest
from fmus.native.c_block import Both, loaded
from support.marks import seeds
from support.native_fmus import needs_gcc

pytestmark = needs_gcc

HEAD = '''
"""Blocks of the tests: `which` chooses one."""

import math
import math as mathematics
from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property, lru_cache
from math import ceil, cos, exp, floor, inf, log, pi, sin, sqrt
from math import pow as power
from types import MappingProxyType
from typing import Annotated, NamedTuple, TypeAlias

from block_variables import Group, Input, Output, Parameter, check

Pair: TypeAlias = tuple[float, float]
Row = tuple[float, float, float]

LIMIT = 1_000.5
COUNT = 7
NEGATIVE = -3
ON = True
ROW: Row = (0.5, -0.25, 1e300)
NESTED = ((1.0, 2.0), (3.0, -0.0))
FAR, NEAR = 10.0, 0.1


class Mode(IntEnum):
    OFF = 0
    SLOW = 2
    FAST = 5
    BACK = -1


SPEED = MappingProxyType({Mode.SLOW: 0.5, Mode.FAST: 4.0})
NUMBERED = {1: 0.125, 2: 8.0, -3: 1.0}


class Point(NamedTuple):
    x: float
    y: float
    double: float = 2.0

    @property
    def product(self) -> float:
        return self.x * self.y

    @property
    def ends(self) -> Pair:
        return self.x, self.double


class Body(NamedTuple):
    at: Point
    pair: Pair
    count: int
    on: bool


ORIGIN = Point(0.0, -0.0)
BODY = Body(Point(1.0, 2.0, 3.0), (4.0, 5.0), 6, True)


@dataclass(frozen=True)
class Inner(Group, name="inner"):
    gain: Annotated[float, Parameter("g")] = 2.0
    exponent: Annotated[float, Parameter("e")] = 0.5

    @property
    def both(self) -> float:
        return self.gain * self.exponent


@dataclass(frozen=True)
class Other(Group, name="other"):
    gain: Annotated[float, Parameter("g")] = 3.0
    far: Annotated[bool, Parameter("a word of old compilers")] = False


@dataclass(frozen=True)
class Params:
    which: Annotated[int, Parameter("which", low=0, high=10000)] = 0
    n: Annotated[int, Parameter("a number", low=-1000, high=1000)] = 3
    flag: Annotated[bool, Parameter("a flag")] = False
    mode: Annotated[Mode, Parameter("a mode")] = Mode.OFF
    weights: Annotated[Row, Parameter("some")] = (1.0, -2.0, 0.5)
    inner: Inner = Inner()
    other: Other = Other()

    def __post_init__(self) -> None:
        check(self)

    @cached_property
    def doubled(self) -> float:
        return 2.0 * self.inner.both


class Inputs(NamedTuple):
    a: Annotated[float, Input("a", nominal=1.0)] = 0.0
    b: Annotated[float, Input("b", nominal=1.0)] = 0.0
    c: Annotated[float, Input("c", nominal=1.0)] = 0.0


class State(NamedTuple):
    value: float


class Outputs(NamedTuple):
    value: Annotated[float, Output("value", nominal=1.0, depends_on=set())]


def initial_state(p: Params, u: Inputs) -> State:
    return State(0.0)


def outputs(p: Params, x: State, u: Inputs) -> Outputs:
    return Outputs(x.value)


def signed(a: float) -> float:
    return -a


@lru_cache(maxsize=4)
def both(a: float, b: float) -> Pair:
    return a + b, a - b


def clipped(x, low, high=1.0):
    return low if x < low else high if x > high else x


def weighed(pair):
    return pair[0] * pair[1]


def looped(n: int, a: float) -> float:
    for _ in range(n):
        a = a + 1.0
    return a
'''

CASES = """
a + b * c - a / 3.0
a - (b - c) - (b + c) * (a * b)
(a / b) / c - a / (b / c) + a * (b / c)
-a ** 2.0 + (-a) ** b + a ** -b + a ** 2 + a ** 0.5
power(a, b) - math.pow(a, 2.0)
-(-a) + a - -b - - -a
p.n / 7 + 7 / p.n + p.n / p.n
float(p.n * p.n + p.n - 2) + float(-p.n) * a + float(-p.n * 0)
-(p.n * 1.0) + p.n * a
a * COUNT + NEGATIVE + LIMIT * FAR - NEAR
float(abs(p.n)) + abs(a) - abs(-b)
min(a, b) + max(a, b)
max(a, b, c, 0.0) - min(*p.weights, a)
max(p.weights) + min(p.weights) + max((a, b))
float(max(0, p.n))
min(max(a, -1.0), 1.0) * (b > 0.0)
sqrt(a) + exp(a) * cos(b) - sin(a) / cos(b) + log(a)
math.tan(a) + math.atan(a) + math.atan2(a, b)
math.asin(a) + math.acos(a)
math.sinh(a) + math.cosh(a) + math.tanh(a)
math.asinh(a) + math.acosh(a) + math.atanh(a)
math.expm1(a) + math.log2(b) + math.log10(b) + math.log1p(b)
math.fabs(a) + math.fmod(a, b) + math.copysign(a, b)
math.ldexp(a, p.n)
mathematics.pi * a + math.tau + math.e
float(floor(a)) + float(ceil(a)) * 0.5 + float(math.trunc(b)) + float(int(c))
float(floor(a)) * 0.5 + float(-ceil(a))
float(floor(a) - floor(b)) + floor(a) / 3
p.flag * a + (a > b) + float((a > b) + (b > c)) + float(int(p.flag) + 1)
1.0 if p.n else -1.0 if a else c
1.0 if a < b < c else 2.0 if a <= b + c <= c else 0.0
1.0 if a < sqrt(b) < c else 0.0
1.0 if a != b == c else 0.0
1.0 if (a < b) == (b < c) else 2.0 if (a < b) != p.flag else 0.0
1.0 if a < b and (b < c or p.flag) and not c < 0.0 else 0.0
1.0 / a if a != 0.0 else 0.0
sqrt(a) / b if a > 0.0 else log(b) / a if b > 0.0 else c
(a if p.flag else b) * c
p.weights[0] + p.weights[-1] * p.weights[1] + (a, b, c)[1]
NESTED[1][0] + NESTED[0][1] + NESTED[1][1] + (*p.weights[1:], a)[2]
p.weights[::-1][0] * a + p.weights[2:0:-1][1] * b + p.weights[::2][1]
(a if abs(a) < inf else 0.0) * (180.0 / pi) + (1.0 if b != b else b)
((a, b) * 3)[5] + ((0.5,) * 4)[3] + float(len(p.weights))
1.0 if any(w > a for w in p.weights) and not all(1.0 / w > a for w in (b, c)) else 0.0
1.0 if any(g.gain > a for g in (p.inner, p.other)) else 0.0
min(tuple(w * v for w, v in zip(p.weights, (a, b, c), strict=True)))
max(tuple(weighed(pair) for pair in zip(p.weights, ROW)))
max(tuple(s + r for s, r in zip(both(a, b), Point(a, b, c).ends)))
SPEED.get(p.mode, a) + NUMBERED.get(p.n, 1.0 / a)
1.0 if p.mode == Mode.FAST else 2.0 if p.mode > Mode.OFF else 0.0
p.mode * a + Mode.FAST + float(Mode.FAST * 3 - p.mode)
signed(0.0) * a + signed(1) * a + clipped(a, b, c) + clipped(x=a, low=-1.0)
both(a, b)[0] * both(b, a)[1]
Point(y=a, x=b).y + Point(a, b).double + Point(*p.weights[:2]).product
Point(a, b)._replace(x=c).product + BODY._replace(pair=(a, b), on=p.flag).pair[0]
BODY.at.y + BODY.pair[1] + BODY.count * a + ORIGIN.product
p.doubled + p.inner.both + p.inner.gain ** p.inner.exponent
inf if a > 0.0 else -inf
a if a < inf else 1e300 * 1e10
5e-324 * a + 1.7976931348623157e308 * b
1_000.000_1 * a + 1e-3 + .5 + 2. + 1E5
2.0 * cos(pi / 5.0) + sin(1e22) + exp(1.0)
looped(int(3.5 + abs(a)) if abs(a) < 9.0 else 2, b)
"""

BODIES = """
x = a
y = x
x, y = y + 1.0, x
a, b, c = c, x, y
(a, b), c = (c, a), b
return a + 2.0 * b + 3.0 * c + x * y
---
x, y = z, w = (a / b, c)
(x, y), z = (y, x), z
return x + y - z * w
---
x = y = a / b
x += 1.0
y *= x
y -= 0.5
y /= x
y **= 2.0
return y
---
if a > b:
    x = 1.0
elif 1.0 / b > c:
    x = 2.0
elif b > c:
    x = 3.0
    y = x
    x = y + 1.0
else:
    # a comment
    x = 4.0  # and one more
return x
---
total = 0.0
for i in range(p.n):
    if i == 3:
        continue
    if i > 7:
        break
    total += a * i + 1.0
return total
---
n = p.n
count = 0
for _ in range(n):
    n = n - 1
    count += 1
return float(count * 100 + n)
---
total = 1.0
for _ in range(COUNT):
    last = total / a
    if last > 1e6:
        break
    total, a = last, a - 1.0
return total + last
---
x = 0.0
for i in range(3):
    for j in range(i, 4):
        for k in range(2):
            if k > j:
                break
            x += a * i + j * b - k
        else_ = x
        x = else_ * 0.5
return x
---
total = a
for x, (y, _) in zip(p.weights, ((a, b), (b, c), (c, a))):
    total = total * x + y
for x in p.weights:
    total -= x
return total
---
total = a
for k, x in zip((0, 1, 2), p.weights):
    total += k * x
return total
---
def_, int_, I, y1, unix, near, far, div, gamma, register, fault, free, exp_1 = (a,) * 13
double, auto, case_, py_max, sqrt_, isnan, NULL, main, printf = (b,) * 9
return I + y1 + unix + near + far + div + gamma + register + fault + free + exp_1 + def_ + int_ + (
    double * auto + case_ + py_max + sqrt_ + isnan + NULL + main + printf
)
---
θ = a
Δx = b
return θ * Δx
---
body = BODY
for _ in range(2):
    body = body._replace(at=Point(a, b), count=body.count + 1)
g = p.inner
x: Pair = (body.at.product, body.count * g.gain)
pass
return x[0] * x[1] + g.both
---
point = Point(a, b)
x, y, _ = point
point = Point(y, x)
return point.x - 2.0 * point.y
---
x = -0.0 if a > 0.0 else 0.0
n = -0
m = p.n * 0
return 1.0 / (m - 1) + x + n * x
---
for i in range(p.n):
    if i > 3:
        return a * i
return b
"""


def source():
    """The module of all cases, and what they are called."""
    bodies = [f"return {case}" for case in CASES.strip().splitlines()]
    bodies += [body.strip("\n") for body in BODIES.strip("\n").split("---\n")]
    text, names = HEAD.lstrip("\n"), []
    for i, body in enumerate(bodies):
        text += f"\n\ndef case_{i}(p: Params, a: float, b: float, c: float) -> float:\n"
        text += textwrap.indent(body, "    ")
        names.append(body)
    text += "\n\ndef step(p: Params, x: State, u: Inputs, h: float) -> State:\n"
    for i in range(len(bodies)):
        text += f"    if p.which == {i}:\n        return State(float(case_{i}(p, *u)))\n"
    return text + "    return x\n", names


SOURCE, NAMES = source()

EXTREME = [0.0, -0.0, 0.5, 1.0, -1.0, 2.0, -2.0, 3.0, -8.0, 5e-324, -5e-324, 1e-300, 1e300, -1e300]
EXTREME += [710.0, -1e9, 2.0**53, 1e16, 1e22, math.inf, -math.inf, math.nan, 2.5, -2.5, 0.1]


@pytest.mark.parametrize(
    ("option", "tries"),
    [("-O0", range(2)), pytest.param("-O2", seeds(1000), marks=pytest.mark.slow)],
)
def test_each_construct_gives_the_bits_of_python(tmp_path, option, tries):
    """All in one test, as they are compiled together."""
    with loaded(tmp_path / "constructs.py", SOURCE) as block:
        both = Both("constructs", block, tmp_path / "c", options=[option])
        places = {v.name: i for i, v in enumerate(both.variables)}
        for which, name in enumerate(NAMES):
            agreed = 0
            for seed in tries:
                random = Random(seed)
                given = {
                    n: random.choice([random.uniform(-4.0, 4.0), random.choice(EXTREME)])
                    for n in "abc"
                }
                given |= {"which": which, "n": random.randint(-20, 20)}
                given |= {"flag": random.random() < 0.5, "mode": random.choice([0, 2, 5, -1])}
                values = both.starts()
                for n, value in given.items():
                    values[places[n]] = value
                try:
                    agreed += both.run(values, [({}, 1.0)])
                except AssertionError as error:
                    raise AssertionError(name, given) from error
            assert agreed > len(tries), name
