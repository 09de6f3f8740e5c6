"""The parts of a system refuse what is out of range, in one line that says what is valid."""

import math
from fractions import Fraction
from pathlib import Path

import pytest
from comparison.made import PLANT, write_fmu
from grasp_cosim import InputError, Realtime
from grasp_cosim.system.parts import (
    Acceptance,
    Component,
    Condition,
    Connection,
    Event,
    Fault,
    Initialisation,
    Limit,
    Link,
    Port,
    Solver,
    SystemInput,
    SystemOutput,
)

YEARS = 1e9
"""The longest time in s."""

COUNTS = ("lost", "trips", "limited", "initialised_anew", "refused", "warnings", "unfinished")
SHARES = ("missed", "implausible", "overruns")

RANGES = [
    (Solver, "relative_tolerance", [1e-13, 1e-6, 0.1], [0.99e-13, 0.11, -1e-6, math.nan, "x"],
     "a number from 1e-13 to 0.1"),
    (Solver, "absolute_tolerance", [5e-324, 1.0], [0.0, -1.0, 1.01, 2.0],
     "a number greater than 0, at most 1"),
    (Solver, "maximum_step", [1e-9, YEARS], [0.0, -1.0, 1.01 * YEARS],
     "a number greater than 0, at most 1e+09"),
    (Realtime, "factor", [1e-300, 1.0, 1e300], [0.0, -1.0, math.inf, math.nan],
     "a finite number > 0"),
    (Realtime, "overrun", ["auto", "catch-up", "continue", "stop"], ["halt", None, 1],
     "one of auto, catch-up, continue, stop"),
    (Realtime, "tolerance", [0.0, 0.5, YEARS], [-1e-9, 1.01 * YEARS, math.nan],
     "a time in s, at least 0"),
    (Realtime, "stall", [1e-9, YEARS], [0.0, -1.0, 1.01 * YEARS], "a time in s, over 0"),
    (Realtime, "priority", [None, 1, 99], [0, 100, 1.5, True], "a whole number from 1 to 99"),
    (Realtime, "cpu", [None, 0, 2**16], [-1, 2**16 + 1, 0.5], "a whole number from 0 to 65536"),
    (Realtime, "lock_memory", [True, False], [None, 1, "yes"], "True or False"),
    (Initialisation, "loops", ["iterate", "refuse"], ["no"], "one of "),
    (Initialisation, "tolerance", [1e-300, 0.5, math.nextafter(1.0, 0.0)], [0.0, 1.0, -0.1],
     "a number between 0 and 1"),
    (Initialisation, "iterations", [1, 10**6], [0, -1, 1.5], "a whole number, at least 1"),
    *((Acceptance, name, [0, 1, 10**6], [-1, 0.5], "a whole number, at least 0")
      for name in COUNTS),
    *((Acceptance, name, [0.0, 0.5, 1.0], [-1e-9, 1.001, math.nan],
       "a share of the steps, from 0 to 1") for name in SHARES),
    (Acceptance, "lead", [0.0, 1e6], [-1e-9, math.inf], "a time in s, at least 0"),
]  # fmt: skip


@pytest.mark.parametrize(("part", "name", "valid", "wrong", "must"), RANGES)
def test_a_value_out_of_range_is_refused(part, name, valid, wrong, must):
    for value in valid:
        assert getattr(part(**{name: value}), name) == value
    for value in wrong:
        with pytest.raises(InputError) as caught:
            part(**{name: value})
        assert str(caught.value).startswith(f"{name} = {value!r}: must be {must}")


def test_what_is_not_said_is_as_the_pages_say():
    assert Solver() == Solver(1e-10, None, None)
    assert Realtime() == Realtime(1.0, "auto", None, None, False, 0.0, 0.1)
    assert Initialisation() == Initialisation("iterate", 1e-10, 50)
    usual = Acceptance()
    assert [getattr(usual, name) for name in COUNTS] == [0] * len(COUNTS)
    assert [getattr(usual, name) for name in SHARES] == [0.01] * len(SHARES)
    assert usual.lead == 0.1


@pytest.mark.parametrize(
    "part",
    [
        Solver(), Realtime(), Initialisation(), Acceptance(), Component("a", Path("a.fmu"), {}),
        Port("a", "x"), Connection(Port("a", "x"), Port("b", "u")), Link(Port("a", "x")),
        SystemInput(()), SystemOutput(Link(Port("a", "x"))), Condition(Port("a", "x"), "<", 1.0),
        Event({}, 0), Fault(Port("b", "u"), "lost", {}),
        Limit(Condition(Port("a", "x"), "<", 1.0)),
    ],
    ids=lambda part: type(part).__name__,
)  # fmt: skip
def test_a_part_cannot_be_changed(part):
    """Systems share them."""
    (name, *_) = getattr(part, "_fields", None) or part.__dataclass_fields__
    with pytest.raises(AttributeError):
        setattr(part, name, None)


@pytest.mark.parametrize(
    ("factor", "period"), [(1.0, 1e6), (0.1, 1e7), (0.3, "10000000/3"), (1e6, 1.0), (4.0, 250_000)]
)
def test_the_wall_time_of_a_step_is_not_rounded(factor, period):
    assert Realtime(factor).period(1_000_000) == Fraction(period)


@pytest.mark.parametrize("factor", [1.000001e6, 1e-3 / 366 / 24 / 3600 * 0.999])
def test_a_period_is_from_a_nanosecond_to_a_year(factor):
    with pytest.raises(
        InputError, match=r"a step of 0\.001 s would begin every .* from 1 ns to a y"
    ):
        Realtime(factor).period(1_000_000)
    Realtime(1e6).period(1_000_000)
    Realtime(1e-3 / 366 / 24 / 3600 * 1.001).period(1_000_000)


def test_a_component_is_current_until_its_fmu_is_another(tmp_path):
    path = write_fmu(tmp_path / "plant.fmu")
    component = Component("plant", path, {})
    assert component.interface.by_name["width"].start == "0.05"
    assert component.is_current is True
    path.unlink()
    other = PLANT["width"].replace("0.05", "0.04321")
    write_fmu(path, {**PLANT, "width": other})
    assert component.is_current is False
    assert Component("plant", path, {}).is_current is True


PROXY = {
    **PLANT,
    "proxy.state": 'causality="output" variability="discrete" | Integer',
    "proxy.resume": 'causality="parameter" variability="fixed" | Boolean start="false"',
    "proxy.peer": 'causality="parameter" variability="fixed" | String start=""',
}


@pytest.mark.parametrize(
    ("declared", "values", "rename", "resume"),
    [
        ("false", {}, {}, False),
        ("true", {}, {}, True),
        ("1", {}, {}, True),
        ("0", {}, {}, False),
        ("true", {"proxy.resume": False}, {}, False),
        ("false", {"proxy.resume": True}, {}, True),
        ("false", {"again": True}, {"again": "proxy.resume"}, True),
        ("false", {"proxy.resume": True}, {"again": "proxy.resume"}, False),
    ],
)
def test_a_setting_of_a_proxy_is_its_start_value_or_that_of_the_system(
    tmp_path, declared, values, rename, resume
):
    variable = PROXY["proxy.resume"].replace('"false"', f'"{declared}"')
    path = write_fmu(tmp_path / "bench.fmu", {**PROXY, "proxy.resume": variable})
    component = Component("bench", path, values, rename)
    assert component.is_proxy
    assert component.of_proxy("resume") is resume
    assert component.of_proxy("peer") == ""
    assert not Component("plant", write_fmu(tmp_path / "plant.fmu"), {}).is_proxy
