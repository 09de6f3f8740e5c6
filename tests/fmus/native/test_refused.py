"""What is not in the subset is refused in one line, with file, line, reason and what is valid."""

import ast
import textwrap
from pathlib import Path

import pytest
from fmus.native.test_constructs import HEAD
from grasp_fmus.block_build import _run
from grasp_fmus.native.old.translation import UntranslatableError, translated

STEP = """

def step(p: Params, x: State, u: Inputs, h: float) -> State:
    return State(case(p, u.a, u.b, u.c))
"""

EXPRESSIONS = {
    "sum(p.weights)": "sum: its rounding depends",
    "math.fsum(p.weights)": "math.fsum",
    "math.hypot(a, b)": "write sqrt(x * x + y * y)",
    "math.dist((a, b), (c, a))": "write sqrt(x * x + y * y)",
    "math.gamma(a)": "math.gamma: is not in the subset",
    "math.prod(p.weights)": "math.prod: is not in the subset",
    "divmod(a, b)[0]": "write a // b and a % b",
    "round(a, 2)": "must have 1 argument",
    "float('1.5')": "a str, must be a number",
    "float(str(a))": "str: is not in the subset",
    "sorted(p.weights)[0]": "sorted: is not in the subset",
    "(lambda x: x)(a)": "lambda is not in the subset",
    "[a, b][0]": "a list is not in the subset; use a tuple",
    "{1: a}[1]": "a dict is not in the subset",
    "[w for w in p.weights][0]": "a list is not in the subset",
    "max(w for w in p.weights)": "only for any, all and tuple",
    "(y := a) + y": "assign before",
    "a if p.flag else (a, b)": "must be of one type",
    "a if p.flag else None": "None",
    "a or b": "write a if ... else b",
    "float((a, b) < (b, c))": "compares a tuple[float, float]",
    "float(a is b)": "use ==",
    "float(p.n & 1)": "use arithmetic",
    "float(~p.n)": "use arithmetic",
    "float(p.n << 2)": "use arithmetic",
    "float(p.n ** p.n)": "may be an int or a float",
    "-(0 if p.flag else a)": "write 0.0 for 0",
    "(0 if p.flag else a) + p.n": "write 0.0 for 0",
    "p.weights[a]": "the index must be an int",
    "p.weights[3]": "there are 3 items",
    "p.weights[-4]": "there are 3 items",
    "p.weights[p.n:][0]": "must have constant bounds",
    "(p.n, Point(a, b))[p.n]": "must have a constant index",
    "a[0]": "a float has no items",
    "p.nothing": "Params has no such field",
    "Point(a, b).nothing": "Point has no such field",
    "nothing": "nothing: is not defined",
    "math.nothing": "math.nothing: is not defined",
    "nothing(a)": "nothing: is not defined",
    "a(b)": "is no function",
    "a.real": "a float has no such field",
    "Point(1, b).x": "Point.x is int: must be float, as declared; x may be an int or a float",
    "Point(p.flag, b).x": "Point.x is bool: must be float",
    "Point(a).x": "needs y",
    "Point(a, b, c, a).x": "has the fields x, y, double",
    "Point(a, z=b).x": "has the fields x, y, double",
    "Point(a, b)._replace(z=a).x": "has no field z",
    "Inner(a, b).gain": "Inner: is not in the subset",
    "helper(a, b, c)": "does not take these arguments",
    "helper()": "needs a",
    "helper(*(a, b), **{})": "** in a call is not in the subset",
    "variadic(a, b)": "*args and **kwargs are not in the subset",
    "recursive(a)": "recursive: calls itself; use a loop",
    "wrapped(a)": "must be one of property",
    "local(a)": "a function in a function",
    "float(len(a))": "must be of a tuple",
    "SPEED.get(p.mode)": ".get(key, default)",
    "SPEED.get(p.mode, 1)": "the default is int; must be float",
    "float(len(SPEED))": "",
    "SPEED": "is no number",
    "Mode": "is no number",
    "float(Mode(p.n))": "must be a Mode already",
    "float(p.mode.name)": "a str, must be a number",
    "(TEXTS[0], a)[1]": "a tuple of str",
    "LIST[0]": "LIST is of type list",
    "2.0 * HUGE": "must be up to 2^53",
    "a + 9007199254740993": "must be up to 2^53",
    "a + 1j": "a complex is not in the subset",
    "f'{a}'": "only for the text of a raise",
    "unfit(a)": "must return a value on every way",
    "nothing_returned(a) + a": "a None, must be a number",
    "either(a)": "must be one type",
    "dataclasses_replace(p.inner)": "use a NamedTuple and _replace",
    "print(a)": "a block has no output",
    "isinstance(a, float)": "leave it out",
    "min(a)": "must be of two numbers, or of a tuple",
    "min(a, b, key=abs)": "keywords are not in the subset",
    "()[0]": "an empty tuple",
    "a @ b": "use arithmetic",
    "float(a in u)": "u: is not defined",
    "OPEN(a)": "",
    "p.weights[::0][0]": "the step must not be 0",
    "BY_TEXT['a']": "BY_TEXT: has keys of type str; must be numbers, or of an IntEnum",
    "Twice(a, b).alpha": "Twice: α and alpha are one name in C; rename one",
}

MORE = """

def variadic(*args: float) -> float:
    return args[0]


def recursive(a: float) -> float:
    return recursive(a - 1.0) if a > 0.0 else 0.0


def decorated(f):
    return f


@decorated
def wrapped(a: float) -> float:
    return a


def local(a: float) -> float:
    def inner() -> float:
        return a

    return inner()


def unfit(a: float) -> float:
    if a > 0.0:
        return a


def nothing_returned(a: float) -> None:
    demand(a)


def either(a: float) -> float:
    if a > 0.0:
        return a
    return a, a


def dataclasses_replace(inner: Inner) -> float:
    return dataclasses.replace(inner, gain=1.0).gain


import dataclasses

TEXTS = ("a", "b")
BY_TEXT = {"a": 1.0}


class Twice(NamedTuple):
    α: float
    alpha: float


LIST = [1.0]
HUGE = 2**60
OPEN = open
"""

BODIES = {
    "while a > 0.0:\n    a = a - 1.0\nreturn a": (1, "use for ... in range(n) with break"),
    "try:\n    return 1.0 / a\nexcept ZeroDivisionError:\n    return 0.0": (1, "try is not in"),
    "with open('x'):\n    return a": (1, "with is not in the subset"),
    "assert a > 0.0\nreturn a": (1, "raise ValueError"),
    "global COUNT\nreturn a": (1, "belongs in the State"),
    "def inner() -> float:\n    return a\nreturn inner()": (1, "a function in a function"),
    "class Inner:\n    pass\nreturn a": (1, "a class in a function"),
    "import math\nreturn a": (1, "import is only for the top level"),
    "from math import sin\nreturn a": (1, "import is only for the top level"),
    "match p.n:\n    case 1:\n        return a\nreturn b": (1, "use if and elif"),
    "del a\nreturn b": (1, "del is not in the subset"),
    "a, *rest = p.weights\nreturn a": (1, "a star among the targets"),
    "x, y = p.weights\nreturn x": (1, "there are 3 items"),
    "x, y = a\nreturn x": (1, "a float has no items"),
    "p.n = 2\nreturn a": (1, "only variables are assigned to"),
    "w = p.weights\nw[0] = 1.0\nreturn a": (2, "only variables are assigned to"),
    "x = a\nx = (a, b)\nreturn a + x[0]": (2, "must stay of one type"),
    "if a > 0.0:\n    x = 1.0\nreturn x": (3, "x: may have no value here"),
    "for i in range(p.n):\n    x = a\nreturn x": (3, "x: may have no value here"),
    "for i in range(a):\n    b = a\nreturn b": (1, "is float, must be an int"),
    "for i in range(0, 9, p.n):\n    b = a\nreturn b": (1, "must be a constant, and not 0"),
    "for i in range(3):\n    pass\nelse:\n    b = a\nreturn b": (4, "use a flag"),
    "for x in (a, p.flag):\n    b = x\nreturn b": (1, "items must be of one type"),
    "for x in a:\n    b = x\nreturn b": (1, "items must be of one type"),
    "for x in [a, b]:\n    b = x\nreturn b": (1, "a list is not in the subset"),
    "a + b\nreturn a": (1, "has no effect"),
    "print(a)\nreturn a": (1, "a block has no output"),
    "raise": (1, "raise a new one"),
    "raise ValueError('x') from None": (1, "raise a new one"),
    "raise ValueError(a)": (1, "must be a text, or an f-string"),
    "raise ValueError('a', 'b')": (1, "must have one text"),
    "raise KeyError('x')": (1, "KeyError shows its text in quotes; raise another"),
    "raise Point(a, b)": (1, "must be an exception of Python's own"),
    "raise ValueError(f'{a:.2f}')": (1, "in this format; must be"),
    "raise ValueError(f'{p.mode}')": (1, "in this format; must be"),
    "raise ValueError(f'{p.weights}')": (1, "in this format; must be"),
    "raise ValueError(f'{p.mode.name!r}')": (1, "in this format; must be"),
    "raise ValueError(f'{a!a}')": (1, "in this format; must be"),
    "x = demand(a)\nreturn x": (1, "the value of a function that returns none"),
    "async def f() -> None:\n    pass\nreturn a": (1, "is not in the subset"),
    "if a > 0.0:\n    return\nreturn a": (3, "returns float here, None before"),
    "x: list[float] = [a]\nreturn a": (1, "a list is not in the subset"),
    "yield a": (1, "is not in the subset"),
    "x = None\nreturn a": (1, "a NoneType is not in the subset"),
    "x = 'text'\nreturn (x, a)[1]": (2, "a tuple of str"),
}

CASES = {f"return {e}": (1, said) for e, said in EXPRESSIONS.items()} | BODIES


@pytest.mark.parametrize("body", CASES)
def test_it_is_refused_with_its_line_and_what_to_write_instead(body: str, tmp_path: Path) -> None:
    line, said = CASES[body]
    head = f"{HEAD.lstrip()}{MORE}\n\ndef case(p: Params, a: float, b: float, c: float) -> float:\n"
    text = head + textwrap.indent(body, "    ") + "\n" + STEP
    file = tmp_path / "refused.py"
    file.write_text(text, "utf-8")
    with _run(file, ast.parse(text)) as block, pytest.raises(UntranslatableError) as refused:
        translated("Refused", block, file)
    message = str(refused.value)
    place, number, reason = message.split(": ", 2)
    assert place == str(file)
    assert number.removeprefix("line ").isdigit()
    in_case = int(number.removeprefix("line ")) - head.count("\n")
    assert in_case == line or in_case <= 0, message
    assert "\n" not in message
    assert said in reason
