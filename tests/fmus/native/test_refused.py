"""What is not in the subset is refused in one line, with file, line, and what to write instead."""

import textwrap

import pytest
from fmus.native.c_block import loaded
from fmus.native.test_constructs import HEAD
from grasp_cosim.fmu_export.native.blocks import translated
from grasp_cosim.fmu_export.native.text import UntranslatableError

MORE = """

def recursive(a: float) -> float:
    return recursive(a - 1.0) if a > 0.0 else 0.0


def variadic(*args: float) -> float:
    return args[0]


def unfit(a: float) -> float:
    if a > 0.0:
        return a


def either(a: float) -> float:
    if a > 0.0:
        return a
    return a, a


TEXTS = ("a", "b")


def case(p: Params, a: float, b: float, c: float) -> float:
"""
STEP = """

def step(p: Params, x: State, u: Inputs, h: float) -> State:
    return State(case(p, u.a, u.b, u.c))
"""

EXPRESSIONS = {
    "sum(p.weights)": "sum: its rounding depends on the version of Python; write a + b, or a loop",
    "math.fsum(p.weights)": "write a + b, or a loop",
    "math.hypot(a, b)": "write sqrt(x * x + y * y)",
    "math.gamma(a)": "math.gamma: is not in the subset; valid are numbers, tuples, if, for, ",
    "math.radians(a)": "write x * (pi / 180.0)",
    "round(a)": "write floor(x + 0.5)",
    "a // b": "write floor(a / b)",
    "a % b": "write fmod(a, b)",
    "sorted(p.weights)[0]": "use min and max",
    "tuple(range(3))[0]": "but for a loop: for ... in range(n)",
    "any(a > k for k, _ in enumerate(p.weights)) * a": "write for ... in zip((0, 1), items)",
    "min({w for w in p.weights})": "use tuple(... for ...)",
    "(lambda x: x)(a)": "use a function of the module",
    "[a, b][0]": "a list is not in the subset; use a tuple",
    "[w for w in p.weights][0]": "use tuple(... for ...)",
    "{1: a}[1]": "use a MappingProxyType of the module",
    "max(w for w in p.weights)": "a generator is only for any, all and tuple",
    "tuple(w for w in p.weights if w > a)[0]": "one for, and no if",
    "(y := a) + y": "assign before",
    "a if p.flag else (a, b)": "is float or tuple[float, float]: must be one of them",
    "-(0 if p.flag else a)": "is int or float: must be one of them",
    "float((a, b) < (b, c))": "must be a number",
    "float(p.n & 1)": "is not in the subset",
    "float(~p.n)": "bits are not in the subset",
    "float(p.n ** p.n)": "of two ints; write float(...)",
    "a + 9007199254740993": "must be at most 2**53",
    "p.weights[p.n]": "an index must be a constant; to go through a tuple write for x in items",
    "p.weights[3]": "there are 3 items",
    "a[0]": "a is float: must be a tuple",
    "p.nothing": "Params has no nothing",
    "Point(a, b).nothing": "Point has no nothing",
    "nothing(a)": "nothing: there is no such name",
    "Point(1, b).x": "is int or float",
    "Point(a).x": "missing a required argument: 'y'",
    "TEXTS[0]": "is not in the subset",
    "f'{a}'": "a text is not in the subset, but for that of ValueError in __post_init__",
    "recursive(a)": "recursive: calls itself; use a loop",
    "variadic(a, b)": "*args, **kwargs",
    "unfit(a)": "unfit: must return a value on every way",
    "either(a)": "is float or tuple[float, float]",
    "a is b": "write ==",
    "a if a in (b, c) else 0.0": "write x == a or x == b",
    "None": "must be a number; math.nan is one",
}
BODIES = {
    "while a > 0.0:\n    a = a - 1.0\nreturn a": (1, "use for ... in range(n) with break"),
    "try:\n    return 1.0 / a\nexcept ZeroDivisionError:\n    return 0.0": (1, "try is not in"),
    "assert a > 0.0\nreturn a": (1, "raise ValueError in __post_init__"),
    "print(a)\nreturn a": (1, "make it an output, which is recorded"),
    "for k in range(0, 4, 2):\n    a = a + k\nreturn a": (1, "write 2 * k in the loop"),
    "global COUNT\nreturn a": (1, "belongs into State"),
    "def inner() -> float:\n    return a\nreturn inner()": (1, "put it into the module"),
    "from math import sin\nreturn a": (1, "put it at the top of the module"),
    "match p.n:\n    case 1:\n        return a\nreturn b": (1, "use if and elif"),
    "a, *rest = p.weights\nreturn a": (1, "there are 3 items"),
    "x, y = p.weights\nreturn x": (1, "there are 3 items"),
    "p.n = 2\nreturn a": (1, "must be a variable"),
    "x = a\nx = (a, b)\nreturn a + x[0]": (2, "use another name"),
    "x = 0\nx = a\nreturn x": (2, "write 0.0 for 0"),
    "if a > 0.0:\n    x = 1.0\nreturn x": (3, "x may have no value here"),
    "for i in range(p.n):\n    x = a\nreturn x": (3, "x may have no value here"),
    "for _ in range(3):\n    if a > b:\n        break\n    x = a\nreturn x": (5, "x may have no"),
    "for i in range(3):\n    a = b\nreturn a * i": (3, "i may have no value here"),
    "i = 1.0\nfor i in range(3):\n    a = b\nreturn a * i": (2, "i: is a variable already"),
    "for i in range(3):\n    i = i + 1\nreturn a": (1, "must not be changed in its loop"),
    "for i in range(3):\n    pass\nelse:\n    b = a\nreturn b": (1, "has no else"),
    "for w in p.weights:\n    break\nreturn a": (1, "only for a loop over range(n)"),
    "for w in (a, b):\n    a = w\nreturn a": (1, "must not be changed in its loop"),
    "a + b\nreturn a": (1, "has no effect; leave it out"),
    "raise ValueError('x')": (1, "raise is only for __post_init__"),
}
CASES = {f"return {e}": (1, said) for e, said in EXPRESSIONS.items()} | BODIES


@pytest.mark.parametrize("body", CASES)
def test_it_is_refused_with_its_line_and_what_to_write_instead(body, tmp_path):
    line, said = CASES[body]
    head = HEAD.lstrip("\n") + MORE
    source = head + textwrap.indent(body, "    ") + "\n" + STEP
    file = tmp_path / "refused.py"
    with loaded(file, source) as block, pytest.raises(UntranslatableError) as refused:
        translated("Refused", block, file)
    place, number, reason = str(refused.value).split(": ", 2)
    in_case = int(number.removeprefix("line ")) - head.count("\n")
    assert place == str(file)
    assert in_case == line or in_case <= 0, number
    assert "\n" not in reason
    assert said in reason
