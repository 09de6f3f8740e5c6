"""The FMU of a block that is one file of the user's own."""

import sys
from math import exp

import pytest
from grasp_cosim.fmu_export import own_block
from grasp_cosim.fmu_export.build import build_block
from grasp_cosim.fmu_export.package import Built
from support.fmi2 import OK, Fmu, Instance, read_members

READ = "declaration" if sys.version_info >= (3, 14) else "import"
"""When Python evaluates an annotation."""

LAG = '''"""A first-order lag.

    T·y' = u - y
"""

from dataclasses import dataclass
from math import exp
from typing import Annotated, NamedTuple

from block_variables import Input, Output, Parameter


@dataclass(frozen=True)
class Params:
    time_constant: Annotated[
        float, Parameter("T, time constant", unit="s", low=1e-3, high=1e3)
    ] = 0.5


class Inputs(NamedTuple):
    u: Annotated[float, Input("what it follows", unit="N", nominal=1.0)] = 1.0


class State(NamedTuple):
    y: float


class Outputs(NamedTuple):
    y: Annotated[float, Output("what follows", unit="N", nominal=1.0, depends_on=set())]


def initial_state(p, u):
    return State(0.0)


def step(p, x, u, h):
    return State(u.u + (x.y - u.u) * exp(-h / p.time_constant))


def outputs(p, x, u):
    return Outputs(x.y)
'''


def write(folder, text, name="first_order_lag.py"):
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def answer(path, folder):
    """Its output after 0.3 s of one step."""
    with Instance(Fmu(path, folder)) as instance:
        instance.initialise()
        assert instance.step(0.0, 0.3) == OK
        return instance.get("y")[0]


def test_a_change_is_built_and_both_run_in_one_process(tmp_path):
    file = write(tmp_path, LAG)
    before = build_block(file, tmp_path / "1")
    assert before == Built(tmp_path / "1/FirstOrderLag.fmu", "new")
    assert build_block(file, tmp_path / "1").status == "unchanged"
    after = build_block(write(tmp_path, LAG.replace("= 0.5", "= 0.6")), tmp_path / "2")
    assert answer(before.path, tmp_path / "a") == pytest.approx(1.0 - exp(-0.6), abs=1e-15)
    assert answer(after.path, tmp_path / "b") == pytest.approx(1.0 - exp(-0.5), abs=1e-15)
    assert [p.name for p in (tmp_path / "2").iterdir()] == ["FirstOrderLag.fmu"]
    page = read_members(after.path)["documentation/index.html"].decode()
    assert "<h1>FirstOrderLag</h1>\n<p>A first-order lag.</p>" in page
    assert "T·y' = u - y" in page
    assert "<code>time_constant</code>" in page


def test_packages_of_our_blocks_come_along(tmp_path):
    text = LAG.replace("from math", "from gripper_plant import fingers\nfrom math")
    text = text.replace("State(0.0)", "State(float(fingers.substep_count(30.0, 1.0)))")
    built = build_block(write(tmp_path, text), tmp_path)
    expected = 1.0 + 299.0 * exp(-0.6)  # 30 1/s over 1 s, sub-steps of 0.1
    assert answer(built.path, tmp_path / "a") == pytest.approx(expected, rel=1e-14)


# fmt: off
WRONG = [
    (LAG.partition("\n\nfrom")[0], "", "must begin with a docstring; its first line describes"),
    ("from math", "import numpy\nfrom math", "line 7: imports numpy; must be of the standard "),
    ("from math", "import numpy\nfrom math", 'REQUIRES = ("numpy",) names what is to be installed'),
    ("from math", "from  gripper_plant import fingers\nfrom math", "line 7: imports gripper_plant; "
     "must be at the top level, with single spaces: from PACKAGE import ..."),
    ("from math", "from .more import a\nfrom math", "must be in the file itself, as a block is"),
    ("class Params", "class Lag(pythonfmu.Fmi2Slave): ...\nclass Params",
     "line 14: is a class of pythonfmu, and no block; `pythonfmu build -f "),
    ("class Params", "class Lag(Fmi3Slave): ...\nclass Params", "`pythonfmu3 build -f "),
    ("from math", "import nothere\nfrom math", "imports nothere; must be of the standard library"),
    ("from math", "REQUIRES = ('nothere',)\nimport nothere\nfrom math",
     "import: ModuleNotFoundError: No module named 'nothere'; "),
    ("from math", "REQUIRES = ('nothere',)\nimport nothere\nfrom math", "-m pip install nothere"),
    ("(frozen=True)", "", "Params: must be a frozen dataclass: @dataclass(frozen=True)"),
    ("@dataclass(frozen=True)\n", "", "Params: must be a frozen dataclass: @dataclass(frozen"),
    ("class Inputs(NamedTuple)", "@dataclass\nclass Inputs",
     "Inputs: must be a NamedTuple: class Inputs(NamedTuple)"),
    ("def step(p, x, u, h)", "def step(p, x, h)", "step(p, x, h): must be step(p, x, u, h)"),
    ("def step(", "def step((", "line 36: is not Python: "),
    ("from math", "1 / 0\nfrom math", "line 7: import: ZeroDivisionError: division by zero"),
    ("from math", "raise SystemExit('a\\nb')\nfrom math", "line 7: import: SystemExit: a b"),
    ("from math", "\0\nfrom math", "is not Python: source code string cannot contain null "),
    ("def step", "def advance", "has no step; a block has Params, Inputs, State, Outputs, "),
    ("= 1.0\n", "\n", "Inputs(): TypeError: "),
    ("high=1e3", "hihg=1e3", f"line 16: {READ}: TypeError: Parameter.__init__() got an"),
    ("high=1e3", "hihg=1e3", "valid: Parameter(meaning, unit=..., low=..., high=..., tunable=...)"),
    ("low=1e-3", "low=1e4", "time_constant: low = 10000.0: must not be above high = 1000.0"),
    ("] = 0.5", "] = 'a'", "declaration: TypeError: time_constant = 'a': must be of type float"),
    ('Input("what it follows", unit="N", nominal=1.0)', "'N'", "declaration: TypeError: u: must be "
     'like Annotated[float, Input("meaning", unit="N", nominal=1.0)]'),
    ("return State(u.u + (x.y - u.u) * exp(-h / p.time_constant))", "pass",
     "step(): ValueError: returns None: must return State(...)"),
    ("return Outputs(x.y)", "pass", "outputs(): ValueError: returns None: must return Outputs(y)"),
    ("u: Annotated[float,", "u: Annotated[int,", "declaration: TypeError: u is int: must be "),
    ("State(0.0)", "Stat(0.0)", "line 33: initial_state(): NameError: name 'Stat' is not "),
    ("Outputs(x.y)", "(x.y, x.y)", "outputs(): ValueError: returns (0.0, 0.0): must return Out"),
    ("exp(-h / p.time_constant)", "float('nan')", "outputs(): ValueError: y = nan N: must "),
    ("Outputs(x.y)", "Outputs(x.y * 1e999 if x.y else 0.0)", "outputs(): ValueError: y = inf N"),
    ("Outputs(x.y)", "Outputs(x.y > 0)", "outputs(): ValueError: y = False: must be of type "),
    ("Outputs(NamedTuple):\n    y:", "Outputs(NamedTuple):\n    u:",
     "declaration: ValueError: u: appears twice; inputs, outputs and parameters share their names"),
    ("Outputs(NamedTuple):\n    y:", "Outputs(NamedTuple):\n    \u00ff:",
     "declaration: ValueError: \u00ff: must be of ASCII letters, digits and _"),
    ("= 0.5", "= 5e3", "declaration: ValueError: time_constant = 5000.0 s: must be from 0.001 to "),
    ("] = 1.0", "] = 1", "declaration: ValueError: u = 1: must be of type float"),
    ('Input("what it follows", unit="N"', 'Input("what it follows", unit="n"',
     "declaration: ValueError: u: unit 'n' is not known; did you mean N?"),
    ("State(0.0)", "State((0.0, None))", "initial_state(): ValueError: State.y[2] = None: must b"),
    ("return State(0.0)", "return State(0)",
     "step(): ValueError: State.y is float: must be as initial_state() makes it, int; write 0.0"),
    ("State(u.u + (x.y - u.u) * exp(-h / p.time_constant))", "State((1.0, 2.0))",
     "step(): ValueError: State.y is not there: must be as initial_state() makes it, float"),
]
# fmt: on


@pytest.mark.parametrize(("before", "after", "said"), WRONG)
def test_what_is_wrong_is_one_line(command, tmp_path, before, after, said):
    assert LAG.count(before) == 1
    file = write(tmp_path, LAG.replace(before, after))
    code, out, err = command("build", file, "--out", "out")
    assert (code, out) == (2, "")
    assert err.startswith(f"grasp-cosim: build: {file}: ")
    assert said in err
    assert err.count("\n") == 1
    assert not list(tmp_path.glob("out/*"))


ENDLESS = """    while True:
        try:
            x = x
        except Exception:
            pass
"""


@pytest.mark.parametrize(
    ("before", "endless", "place"),
    [
        ("    return State(u.u", f"{ENDLESS}    return State(u.u", " step()"),
        ("def initial", "while True: pass\ndef initial", "line 32: import"),
    ],
)  # fmt: skip
def test_what_never_ends_is_said_with_its_line(
    command, tmp_path, monkeypatch, before, endless, place
):
    """And what ends in time is no worse for the clock."""
    monkeypatch.setattr(own_block, "LONGEST_TRIAL", 0.1)
    file = write(tmp_path, LAG.replace(before, endless))
    code, _, err = command("build", file)
    assert code == 2
    assert place in err
    assert "was not done after 0.1 s; must end; for a loop with a bound write for" in err
    assert command("build", write(tmp_path, LAG))[0] == 0


OURS = "GripperPlant.fmu is one of the FMUs that come with this package"


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("1st.py", "must be NAME.py"),
        ("lag.txt", "must be NAME.py"),
        ("GRIPPERplant.py", OURS),
    ],
)
def test_a_name_that_does_not_do(command, tmp_path, name, said):
    file = write(tmp_path, LAG, name)
    code, _, err = command("build", file)
    assert code == 2
    assert err.startswith(f"grasp-cosim: build: {file}: {said}")
