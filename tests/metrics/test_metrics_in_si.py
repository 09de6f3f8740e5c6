"""Metrics get signals in SI units, or the system is refused before any FMU is loaded."""

from dataclasses import replace

import numpy as np
import pytest
from comparison.made import write_fmu
from grasp_cosim import InputError, System, metric, simulate
from grasp_cosim.comparison.qualify import qualify
from grasp_cosim.interface.units import Conversion
from grasp_cosim.metrics.in_si import InSi, in_si
from grasp_cosim.metrics.metric import Metric, Signals
from grasp_cosim.sweeps.sweep import sweep
from hypothesis import given
from hypothesis import strategies as st
from support.groups import bring_group

OUTPUT = 'causality="output" | Real'
INPUT = 'causality="input" | Real start="0"'
ROOM = {"x": OUTPUT, "y": OUTPUT, "p": 'causality="parameter" | Real start="1"'}


@metric("travel", unit="m", needs={"room.x": "m", "room.y": "m"})
def travel(run):
    """How far x goes."""
    return float(run["room.x"][-1] - run["room.x"][0])


def unit(text, name, more=""):
    return text.replace("| Real", f'| Real unit="{name}"{more}')


@pytest.fixture
def load(tmp_path):
    """A room whose outputs x and y go to the inputs a and b of a sink."""

    def system(room=None, sink=None, links=('"room.x -> sink.a"', '"room.y -> sink.b"'), units=""):
        if sink is None:
            sink = {}
        if room is None:
            room = {}
        write_fmu(tmp_path / "room.fmu", {**ROOM, **room})
        write_fmu(tmp_path / "sink.fmu", {"a": INPUT, "b": INPUT, "c": INPUT, **sink})
        values = {v: 0.0 for v in "abc" if not any(f"sink.{v}" in link for link in links)}
        path = tmp_path / "rooms.toml"
        path.write_text(
            f"connections = [{', '.join(links)}]\n[experiment]\nstep = 1e-3\nstop = 0.01\n"
            f'[components.room]\nfmu = "room.fmu"\nunits = {{ {units} }}\n'
            f'[components.sink]\nfmu = "sink.fmu"\n'
            f"values = {{ {', '.join(f'{n} = {v}' for n, v in values.items())} }}\n",
            "utf-8",
        )
        return System.load(path)

    return system


MM, M = unit(OUTPUT, "mm"), unit(OUTPUT, "m")
MM_IN, M_IN = unit(INPUT, "mm"), unit(INPUT, "m")
MILLI = Conversion(1e-3, 0.0)


def found(system, *metrics):
    return in_si(system, metrics or (travel,))


def refusal(system, *metrics):
    with pytest.raises(InputError) as caught:
        found(system, *metrics)
    assert "\n" not in str(caught.value)
    return str(caught.value)


# ------------------------------------------------------------------------- the unit of a signal


@pytest.mark.parametrize(
    ("room", "units", "to_si"),
    [
        ({"x": MM, "y": M}, "", MILLI),
        ({"y": M}, 'x = "mm"', MILLI),
        ({"x": M, "y": M}, 'x = "mm"', MILLI),
        ({"x": unit(OUTPUT, "cm"), "y": M}, "", Conversion(1e-2, 0.0)),  # made.py defines no cm
    ],
)
def test_a_unit_that_is_declared_named_or_known_is_converted(load, room, units, to_si):
    assert found(load(room, units=units)) == InSi({"room.x": to_si}, ())


def test_without_any_unit_it_is_that_of_si_and_that_is_said(load):
    """Whatever is beside it, takes it or scales it."""
    said = "room.x, room.y: no unit, taken to be in SI"
    assert found(load()) == InSi({}, (said,))
    for system in (
        load({"x": M}, {"b": MM_IN}),
        load(
            {"x": M},
            {},
            ['"room.x -> sink.a"', '{ from = "room.y", to = "sink.b", factor = 1000.0 }'],
        ),
    ):
        assert found(system) == InSi({}, ("room.y: no unit, taken to be in SI",))
    assert found(load({"x": MM})).conversions == {"room.x": MILLI}


def test_a_signal_of_another_quantity_is_refused(load):
    assert "rooms.toml: room.x is in N; travel must know" in refusal(
        load({"x": unit(OUTPUT, "N"), "y": M})
    )
    unknown = load({"x": unit(OUTPUT, "cubit"), "y": M})
    assert "room.x is in 'cubit', which its FMU does not define in SI units" in refusal(unknown)


@pytest.mark.parametrize("name", ["mm", "cubit", ""])
def test_a_metric_expects_units_of_si(load, name):
    wrong = Metric("wrong", travel.function, needs={"room.x": name})
    message = rf"^wrong: needs room\.x in '{name}'; must be a unit of SI like 'm'"
    with pytest.raises(InputError, match=message):
        found(load({"x": MM}), wrong)


def test_an_angle_may_be_a_number(load):
    turn = Metric("turn", travel.function, needs={"room.x": "rad", "room.y": "1"})
    system = load({"x": unit(OUTPUT, "1"), "y": unit(OUTPUT, "rad")})
    assert found(system, turn) == InSi({}, ())


# ------------------------------------------------------------------------- before anything runs


def test_every_way_to_run_a_system_refuses_it_first(load, tmp_path, monkeypatch):
    """These FMUs have no binary: loading one would be another error."""
    bring_group(monkeypatch, "travels", travel)
    wrong = replace(load({"x": unit(OUTPUT, "N")}), metrics=("travels",))
    ways = [
        lambda: simulate(wrong),
        lambda: simulate.session(wrong),
        lambda: sweep(wrong, [{"room.p": 1.0}], native=False),
        lambda: qualify(wrong, "room", tmp_path / "room.fmu"),
        lambda: qualify(replace(load({"x": M}), metrics=("travels",)), "room", other),
    ]
    other = write_fmu(
        tmp_path / "other.fmu", {**ROOM, "x": unit(OUTPUT, "mm"), "y": unit(OUTPUT, "N")}
    )
    for way in ways:
        with pytest.raises(
            InputError, match=r"must know its unit, one like m: \[components\.room\]"
        ):
            way()
    with pytest.raises(
        InputError, match=r"of the candidate: --set components.NAME.units.VARIABLE=UNIT$"
    ):
        ways[-1]()


# ------------------------------------------------------------------------- what a metric sees

TIME = np.array([0.0, 1.0])
COLUMN = np.array([1.0, 3.0])


@given(st.floats(1e-6, 1e6) | st.floats(-1e6, -1e-6), st.floats(-1e3, 1e3))
def test_signals_come_in_si(factor, offset):
    to_si = {"room.x": Conversion(factor, offset)}
    run = Signals(TIME, {"room.x": COLUMN, "room.y": COLUMN}, {"hall": "room"}, to_si)
    assert (run["hall.x"] == factor * COLUMN + offset).all()
    assert run["hall.x"] is run["room.x"]
    assert run["room.y"] is COLUMN
    assert run.by_name["room.x"] is COLUMN


def test_all_that_metrics_expect_of_a_signal_is_checked(load):
    @metric("milli", needs={"room.x": "mm"})
    def milli(run): ...

    @metric("force", needs={"room.x": "N"})
    def force(run): ...

    room = load({"x": M})
    assert refusal(room, travel, milli).startswith("milli: needs room.x in 'mm'; must be a unit")
    assert refusal(room, travel, force) == (
        "force: needs room.x in N, travel in m; must be of one quantity"
    )


def test_what_a_metric_may_read_without_a_unit_is_said(load):
    @metric("free")
    def free(run):
        return float(run["room.x"][-1])

    @metric("bound", needs={"room.x": "m"})
    def bound(run): ...

    room = load({"y": M})
    assert found(room, free).notes == ("room.x: no unit, taken to be in SI",)
    assert found(room, bound).notes == ("room.x: no unit, taken to be in SI",)
    assert found(load({"x": MM, "y": M}), free).notes == ()
