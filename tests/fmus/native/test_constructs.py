"""Each construct of the subset gives in C what it gives in Python: numbers, and exceptions."""

import ast
import math
import textwrap
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from random import Random
from typing import Any

import pytest
from fmus.native.c_block import CBlock, PythonBlock, library, same
from grasp_fmus.block_build import _run
from grasp_fmus.native.old.translation import translated
from hypothesis import given
from hypothesis import strategies as st
from support.examples import examples

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
"""Two."""

Row = tuple[float, float, float]

LIMIT = 1_000.5
"""Of nothing."""
COUNT = 7
NEGATIVE = -3
ON = True
ROW: Row = (0.5, -0.25, 1e300)
NESTED = ((1.0, 2.0), (3.0, -0.0))
FAR, NEAR = 10.0, 0.1
TABLE = ((0.0, 1.0), (0.5, 3.0), (2.0, -1.0), (4.0, 0.25))


class Mode(IntEnum):
    """With a value below zero."""

    OFF = 0
    SLOW = 2
    FAST = 5
    BACK = -1


SPEED = MappingProxyType({Mode.SLOW: 0.5, Mode.FAST: 4.0})
NUMBERED = {1: 0.125, 2: 8.0, -3: 1.0}


class Point(NamedTuple):
    """With a method, and a default."""

    x: float
    y: float
    double: float = 2.0

    def length(self, scale: float = 1.0) -> float:
        return sqrt(self.x * self.x + self.y * self.y) * scale

    @property
    def product(self) -> float:
        return self.x * self.y


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


DEFAULT = Inner(gain=0.75)


@dataclass(frozen=True)
class Params:
    SCALE = -2.5

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


def helper(a: float, b: float = 0.5, *, scale: float = 2.0) -> float:
    return (a + b) * scale


def signed(a: float) -> float:
    return -a


@lru_cache(maxsize=4)
def both(a: float, b: float) -> Pair:
    return a + b, a - b


def clipped(x, low, high):
    return low if x < low else high if x > high else x


def v_of(p: Params, factor: float = Params.SCALE) -> float:
    return total(p.weights) * factor


def total(w: Row) -> float:
    """Its int becomes a float."""
    found: float = 0
    for x in w:
        found += x
    return found


def weighed(pair):
    return pair[0] * pair[1]


def looped(n: int, a: float) -> float:
    """After a fault n may be huge."""
    for _ in range(n):
        a = a + 1.0
    return a


def remark(a: float, b: float) -> float:
    # a is named in a remark only, as is b there
    return 2.0 * b  # a


def demand(a: float) -> None:
    """Nothing but a check."""
    if a > 100.0:
        raise ValueError(f"a = {a!r}: must be up to {100.0:g}")
'''

CASES = """
a + b * c - a / 3.0
1e400 if a > b else a + 1e-400
(p.inner if p.flag else DEFAULT).both * a
tuple(weighed(pair) for pair in zip(p.weights, ROW))[1]
tuple(pair for pair in enumerate(p.weights))[2][1] + a
float(any(pair[0] > pair[1] * a for pair in zip(p.weights, ROW)))
a if p.n and p.flag or b else c
float(not (p.n and 1.0 / a > b))
ROW[int(a)]
(-1e300 - abs(a)) ** (2.5 + abs(b)) if a > 0.0 else b
remark(a, b)
looped(int(1e15 * max(0.0, 1.0 - 1.0 / a)) if a == 0.0 else 3, b)
a - (b - c)
a - (b + c) * (a * b)
(a / b) / c
a / (b / c)
a * (b / c)
-a ** 2.0
(-a) ** b
a ** -b
a ** 2
a ** 0.5 + b ** 0.5
pow(a, b)
power(a, b)
math.pow(a, 2.0)
-(-a)
+a - -b
- - -a
a // b
a % b
a // 0.1 + b % 0.1
float(p.n // 7) + float(p.n % 7) * a
float(p.n // -7) + float(p.n % -7)
float(p.n // 0)
float(7 % p.n)
p.n / 7
p.n / p.n
7 / p.n + a
float(p.n * p.n + p.n - 2)
float(-p.n) * a
float(-p.n * 0)
-(p.n * 1.0)
float(p.n ** 3)
float((p.n * 1000000000) * 1000)
p.n * a
a * COUNT + NEGATIVE
a + LIMIT * FAR - NEAR
float(abs(p.n))
abs(a) - abs(-b)
min(a, b)
max(a, b)
min(a, b, c)
max(a, b, c, 0.0)
max(p.weights) + min(p.weights)
min(*p.weights, a)
max((a, b)) + min(0.0, c)
max(0, a) * b
max(0, a) + 0.0
float(max(0, p.n))
max(p.n, a) * 2.0
sqrt(a) + sqrt(b)
exp(a) * cos(b)
exp(a) + exp(b)
sin(a) / cos(b)
1.0 / a + sqrt(b)
sqrt(a) + 1.0 / b
log(a) - 1.0 / b - sqrt(c)
math.tan(a)
math.asin(a) + math.acos(a)
math.atan(a)
math.atan2(a, b)
math.sinh(a)
math.cosh(a)
math.tanh(a)
math.asinh(a)
math.acosh(a)
math.atanh(a)
math.expm1(a)
math.exp(-a)
math.log(a)
math.log(a, b)
math.log(p.n)
math.log2(a)
math.log10(a)
math.log1p(a)
math.fabs(a)
math.fmod(a, b)
math.copysign(a, b)
math.ldexp(a, p.n)
math.degrees(a) + math.radians(b)
mathematics.pi * a + math.tau + math.e
1.0 if math.isnan(a) else 2.0
1.0 if math.isinf(a) or math.isfinite(b) else 2.0
1.0 if not math.isfinite(a * b) else a
float(floor(a))
float(ceil(a))
float(math.trunc(a))
float(int(a))
float(round(a))
float(floor(a)) * 0.5 + float(-ceil(a))
float(floor(a) - floor(b))
float(round(a) + 1)
float(round(a + 0.5) * 3)
float(int(p.flag) + 1)
float(p.flag)
p.flag * a
p.flag + a
(a > b) + a
float((a > b) + (b > c))
1.0 if bool(a) else -1.0
1.0 if p.n else -1.0
1.0 if a else -1.0
1.0 if not p.mode else -1.0
1.0 if a < b < c else 0.0
1.0 if a <= b + c <= c else 0.0
1.0 if a < sqrt(b) < c else 0.0
1.0 if a < sqrt(b) < 1.0 / c < a else 0.0
1.0 if a != b == c else 0.0
1.0 if (a < b) == (b < c) else 0.0
1.0 if (a < b) != p.flag else 0.0
1.0 if a < b and b < c or p.flag else 0.0
1.0 if a < b and (b < c or p.flag) and not c < 0.0 else 0.0
1.0 if a > 0.0 and 1.0 / a > b else 0.0
1.0 if a == 0.0 or sqrt(b) / a > 1.0 / c else 0.0
1.0 / a if a != 0.0 else 0.0
sqrt(a) / b if a > 0.0 else log(b) / a if b > 0.0 else c
(a if p.flag else b) * c
a if a > b else b if b > c else c
0 * a if p.flag else a
(0 if a > 0.0 else b) * c
(1 if a > 0.0 else 0) * c
p.weights[0] + p.weights[-1] * p.weights[1]
p.weights[p.n]
(a, b, c)[1]
ROW[p.n] * a
NESTED[1][0] + NESTED[0][1] + NESTED[1][1]
NESTED[p.n][0]
(*p.weights[1:], a)[2]
((a, b) + (c,))[2]
((a, b) * 3)[5]
(a,) [0] + ((0.5,) * 4)[3]
float(len(p.weights)) + float(len((a, b)))
1.0 if any(w > a for w in p.weights) else 0.0
1.0 if all(w > a for w in p.weights) else 0.0
1.0 if all(1.0 / w > a for w in (b, c)) else 0.0
1.0 if any((a > 0.0, b > 0.0)) else 0.0
1.0 if any(g.gain > a for g in (p.inner, p.other)) else 0.0
1.0 if any(w * i > a for i, w in enumerate(p.weights)) else 0.0
tuple(w * a for w in p.weights)[1]
tuple(w * v for w, v in zip(p.weights, (a, b, c)))[2]
1.0 if a in (1.0, 0.5, b) else 0.0
1.0 if p.n not in (1, 2) else 0.0
1.0 if p.mode in SPEED else 0.0
1.0 if p.mode not in SPEED else 0.0
SPEED.get(p.mode, a)
SPEED[p.mode]
NUMBERED[p.n]
NUMBERED.get(p.n, 1.0 / a)
1.0 if p.mode == Mode.FAST else 0.0
1.0 if p.mode is Mode.FAST or p.mode is not Mode.BACK else 0.0
1.0 if p.mode > Mode.OFF else 0.0
1.0 if (not p.flag) == (a > b) else 0.0
float(p.mode)
p.mode * a + Mode.FAST
float(Mode.FAST * 3 - p.mode)
math.sqrt(p.mode)
float(p.mode.value + 1)
float(int(p.mode) * 2)
helper(a)
helper(a, b)
helper(b=a, a=b, scale=c)
helper(*p.weights[:2], scale=a)
helper(1.0 / a, sqrt(b), scale=log(c))
helper(scale=1.0 / a, a=sqrt(b))
helper(1, a)
signed(0.0) * a
signed(1) * a
both(a, b)[0] * both(b, a)[1]
Point(a, b).x + Point(a, b).double
Point(y=a, x=b).y
Point(1.0 / a, y=sqrt(b)).length()
Point(a, b).length(c)
Point(a, b)._replace(x=c).product
Point(a, b)._replace(x=1.0 / c, y=sqrt(a)).y
Point(*p.weights[:2]).product
BODY.at.y + BODY.pair[1] + BODY.count * a
BODY._replace(pair=(a, b), on=p.flag).pair[0]
ORIGIN.product * a
p.doubled + p.inner.both
p.inner.gain ** p.inner.exponent
inf if a > 0.0 else -inf
p.SCALE * a - p.SCALE - Params.SCALE
DEFAULT.gain * a + DEFAULT.both
clipped(a, 0, 1) * b
clipped(p.n, -2, 2) * b
clipped(a, -b, 1.0 / c)
v_of(p) + v_of(p, 2.0)
(1 if a > 0.0 else -1) * b
min(max(a, -1.0), 1.0) * (b > 0.0)
(a > 0.0) - (a < 0.0) + b
a if a < inf else 1e300 * 1e10
1.0 if ON else 0.0
5e-324 * a + 1.7976931348623157e308 * b
1_000.000_1 * a + 1e-3 + .5 + 2. + 1E5
0.1 + 0.2 + a
2.0 * cos(pi / 5.0) + sin(1e22) + exp(1.0)
"""

BODIES = """
x = a
y = x
x, y = y + 1.0, x
x, y = y, x
return x * 2.0 + y
---
found = a
for pair in zip(p.weights, ROW):
    found += max(pair) / (pair[0] - pair[1] * b)
return found
---
found = a
for pair in enumerate(p.weights):
    found += pair[0] * pair[1]
return found
---
group = DEFAULT
if p.flag:
    group = p.inner
return group.both * a
---
x, y = z, w = (a / b, c)
return x + y - z * w
---
if b > a:
    raise ValueError(f"{a:.0g} {p.n}: the c of this text is no variable")
return b
---
(x, y), z = (a, b), c
x, (y, z) = z, (x, y)
return x + 2.0 * y + 4.0 * z
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
    x = 4.0
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
total = 0.0
for i in range(2, 11, 3):
    for j in range(i, 0, -1):
        total = total * 0.5 + i - j * a
return total + i
---
total = a
for i in range(p.n, p.n + 3):
    i = i * 2
    total += i / 7
return total
---
n = p.n
count = 0
for _ in range(n):
    n = n - 1
    count += 1
return float(count * 100 + n)
---
total = 0.0
for w in p.weights:
    total += w * a
for i, w in enumerate(p.weights):
    total += i * w
for w, v in zip(p.weights, (a, b, c)):
    total -= w / v
for x, y in NESTED:
    total += x * y
return total
---
w = p.weights
total = 0.0
for x in w:
    w = (x, x, x)
    total += w[0] * x
return total
---
total = 1.0
for _ in range(COUNT):
    total = total / a
    a = a - 1.0
return total
---
demand(a)
demand(b)
return a
---
if a > 1.0:
    raise ArithmeticError(f"a = {a!r} V: too much, {b:g} or {c:.3g}; {p.n} {p.flag} of {p.n:d}%")
if b > 1.0:
    raise ArithmeticError("b: " "too much, \\"really\\" \\\\ ??/ °C {no}")
if c > 1.0:
    raise ZeroDivisionError("c")
if a < -1.0:
    raise ValueError(f"{p.mode.name} {p.mode.name.lower()}: {a}, {{}} {-p.n!r} {p.n:g} {a:.17g}")
if b < -1.0:
    raise RuntimeError
return 0.0
---
name = p.mode.name
if a > 0.0:
    raise ValueError(f"{name} {floor(a)} {1.0 / b:g} {sqrt(c)}")
return 1.0
---
number = a
for _ in range(5):
    half = floor(0.5 * number)
    if number != 2.0 * half:
        b = b + 1.0
    number = half
return b
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
nothing = clipped(a, b, c) + total(p.weights)
unused = 1.0 / a
_ = sqrt(b)
_, kept = 1.0 / c, b
return kept
---
for _ in range(3):
    last = a
    if last > b:
        break
    a = a + 1.0
return last
---
body = BODY
for _ in range(2):
    body = body._replace(at=Point(a, b), count=body.count + 1)
return body.at.product * body.count
---
g = p.inner
h = g.gain
x: Pair = (a, b)
y: float
y = h
pass
return x[0] * y + g.both
---
return a  # the end
b = 1.0
---
for (x_0, y_0), (x_1, y_1) in zip(TABLE, TABLE[1:]):
    if x_0 <= a < x_1:
        return y_0 + (y_1 - y_0) * (a - x_0) / (x_1 - x_0)
return TABLE[0][1] if a < TABLE[0][0] else TABLE[-1][1]
---
for i in range(len(TABLE) - 1):
    if TABLE[i][0] <= a < TABLE[i + 1][0]:
        return TABLE[i][1] * i
return TABLE[p.n][1]
---
best = -inf
where = 0
for i, (x, y) in enumerate(TABLE):
    value = x * a + y * b
    if value > best:
        best, where = value, i
return best + where
---
x = 0.0
for i in range(3):
    for j in range(i):
        for k in range(j, 5):
            if k > 3:
                break
            x += a * i + j * b - k
        else_ = x
        x = else_ * 0.5
return x
---
flag = p.flag
for w in p.weights:
    flag = flag or w > a
    flag = flag and not w > b
return 1.0 if flag else 2.0
---
a, b = b, a / b
a, b, c = c, a, b
(a, b), c = (c, a), b
return a + 2.0 * b + 3.0 * c
---
def_ = Point(a, b)
x, y, z = def_
w = (x, y)
(x, y), z = w, z + 1.0
return x - y * z + w[0]
---
if a > 0.0:
    if b > 0.0:
        x = 1.0 / c
    else:
        raise ArithmeticError("b")
else:
    x = sqrt(b)
return x
---
x = -0.0 if a > 0.0 else 0.0
n = -0
y = n * x
m = p.n * 0
return 1.0 / (m - 1) + x + y
---
x = (a, 1.0 / b)
return sqrt(x[0]) if x[1] > 0.0 else (1.0 / c, x[0])[1]
"""


def source() -> tuple[str, list[str]]:
    """The module of all cases, and what they are called."""
    bodies = [f"return {case}" for case in CASES.strip().splitlines()]
    bodies += [body.strip("\n") for body in BODIES.strip("\n").split("---\n")]
    text, names = HEAD.lstrip("\n"), []
    for i, body in enumerate(bodies):
        text += f"\n\ndef case_{i}(p: Params, a: float, b: float, c: float) -> float:\n"
        text += textwrap.indent(body, "    ")
        names.append(body.replace("\n", "; ")[:60])
    text += "\n\ndef step(p: Params, x: State, u: Inputs, h: float) -> State:\n"
    for i in range(len(bodies)):
        text += f"    if p.which == {i}:\n        return State(case_{i}(p, u.a, u.b, u.c) + 0)\n"
    return text + "    return x\n", names


SOURCE, NAMES = source()


Both = tuple[CBlock, PythonBlock]


@contextmanager
def compiled(folder: Path, level: str) -> Iterator[Both]:
    file = folder / "constructs.py"
    file.write_text(SOURCE, "utf-8")
    with _run(file, ast.parse(SOURCE)) as block:
        files = translated("Constructs", block, file)
        yield CBlock(library(files, folder / "c", "gcc", level)), PythonBlock(block)


@pytest.fixture(scope="module")
def blocks(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Both]:
    with compiled(tmp_path_factory.mktemp("constructs"), "-O0") as both:
        yield both


@pytest.fixture(scope="module")
def optimised(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Both]:
    with compiled(tmp_path_factory.mktemp("constructs"), "-O2") as both:
        yield both


EXTREME = [0.0, -0.0, 0.5, 1.0, -1.0, 2.0, -2.0, 3.0, -8.0, 5e-324, -5e-324, 1e-300, 1e300, -1e300]
EXTREME += [710.0, -1e9, 2.0**53, 1e16, 1e22, math.inf, -math.inf, math.nan, 2.5, -2.5, 0.1]
numbers = st.one_of(st.sampled_from(EXTREME), st.floats(), st.floats(-4.0, 4.0))


@pytest.mark.slow
@pytest.mark.parametrize("mode", range(-1, 6))
def test_a_number_that_is_no_member_is_refused(blocks: Both, mode: int) -> None:
    in_c, in_python = blocks
    v = [float(mode) if x.name == "mode" else s for x, s in zip(*_named(in_python), strict=True)]
    assert same(in_c.check(v), in_python.check(v))


def _named(block: PythonBlock) -> tuple[list[Any], list[float]]:
    return block.variables, block.starts


def _agree(
    blocks: Both,
    which: int,
    reals: Sequence[float],
    n: int,
    flag: bool,
    mode: int,
) -> None:
    in_c, in_python = blocks
    given_ = dict(zip("abc", reals, strict=True))
    given_ |= {"which": which, "n": n, "flag": flag, "mode": mode}
    v = [
        1.0 * given_.get(x.name, s)  # each an object, as from a host: `in` finds the same NaN
        for x, s in zip(in_python.variables, in_python.starts, strict=True)
    ]
    found, expected = in_c.step(v, [0.0], 1.0), in_python.step(v, [0.0], 1.0)
    if isinstance(found, tuple) and found[2] == "whole number beyond 2^53":
        return  # Python goes on with more digits than a double has
    assert same(found, expected), (NAMES[which], given_, found, expected)


def test_each_construct_gives_the_bits_and_the_faults_of_python(blocks: Both) -> None:
    """All in one test, as they are compiled together."""
    for which in range(len(NAMES)):
        random = Random(which)
        for _ in range(30):
            small = [random.uniform(-4.0, 4.0) for _ in range(3)]
            reals = [random.choice([x, random.choice(EXTREME)]) for x in small]
            n, flag = random.randint(-20, 20), random.random() < 0.5
            _agree(blocks, which, reals, n, flag, random.choice([0, 2, 5, -1]))


@pytest.mark.slow
@examples(2_000)
@given(
    st.integers(0, len(NAMES) - 1),
    st.tuples(numbers, numbers, numbers),
    st.integers(-1000, 1000),
    st.booleans(),
    st.sampled_from([0, 2, 5, -1]),
)
def test_constructs_agree_with_python_on_all_numbers(
    optimised: Both,
    which: int,
    reals: tuple[float, float, float],
    n: int,
    flag: bool,
    mode: int,
) -> None:
    _agree(optimised, which, reals, n, flag, mode)
