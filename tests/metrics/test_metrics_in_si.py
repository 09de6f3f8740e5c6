"""Metrics get signals in SI units, or the system is refused before any FMU is loaded."""

from dataclasses import replace

import numpy as np
import pytest
from comparison.made import write_fmu
from grasp_cosim import AnyOf, InputError, System, metric, simulate
from grasp_cosim.comparison.qualify import qualify
from grasp_cosim.interface.units import Conversion
from grasp_cosim.metrics.in_si import InSi, in_si
from grasp_cosim.metrics.metric import Metric, Signals
from grasp_cosim.sweeps.sweep import sweep
from hypothesis import given
from hypothesis import strategies as st
from support.mocks import bring_group

OUTPUT = 'causality="output" | Real'
ROOM = {"x": OUTPUT, "y": OUTPUT, "p": 'causality="parameter" | Real start="1"'}
SINK = {"a": 'causality="input" | Real start="0" unit="mm"'}


@metric("travel", unit="m", needs={"room.x": "m", "room.y": "m"})
def travel(run):
    """How far x goes."""
    return float(run["room.x"][-1] - run["room.x"][0])


def wanting(name, **needs):
    """A metric that expects signals of the room in units."""
    return Metric(name, travel.function, needs={f"room.{n}": unit for n, unit in needs.items()})


def room(**units):
    """The variables of a room whose outputs have units."""
    return ROOM | {n: OUTPUT.replace("Real", f'Real unit="{unit}"') for n, unit in units.items()}


@pytest.fixture
def load(tmp_path):
    """A room whose output y goes, times 1000, to the input of a sink in mm."""

    def system(named="", **units):
        write_fmu(tmp_path / "room.fmu", room(**units))
        write_fmu(tmp_path / "sink.fmu", SINK)
        (tmp_path / "rooms.toml").write_text(
            'connections = [{ from = "room.y", to = "sink.a", factor = 1000.0 }]\n'
            "[experiment]\nstep = 1e-3\nstop = 0.01\n"
            f'[components.room]\nfmu = "room.fmu"\nunits = {{ {named} }}\n'
            '[components.sink]\nfmu = "sink.fmu"\n'
        )
        return System.load(tmp_path / "rooms.toml")

    return system


MILLI = Conversion(1e-3, 0.0)


@pytest.mark.parametrize(
    ("units", "named", "to_si", "silent"),
    [
        ({"x": "mm", "y": "m"}, "", {"room.x": MILLI}, ""),
        ({"y": "m"}, 'x = "mm"', {"room.x": MILLI}, ""),
        ({"x": "m", "y": "m"}, 'x = "mm"', {"room.x": MILLI}, ""),
        ({"x": "cm", "y": "m"}, "", {"room.x": Conversion(1e-2, 0.0)}, ""),  # made.py has no cm
        ({}, "", {}, "room.x, room.y"),
        ({"x": "m"}, "", {}, "room.y"),  # whatever takes it or scales it
        ({"x": "mm"}, "", {"room.x": MILLI}, "room.y"),
    ],
)
def test_units_are_declared_named_known_or_taken_to_be_those_of_si(
    load, units, named, to_si, silent
):
    notes = (f"{silent}: no unit, taken to be in SI",) if silent else ()
    assert in_si(load(named, **units), (travel,)) == InSi(to_si, notes)


def test_an_angle_may_be_a_number(load):
    turn = wanting("turn", x="rad", y="1")
    assert in_si(load(x="1", y="rad"), (turn,)) == InSi({}, ())


@pytest.mark.parametrize(
    ("units", "asked", "said"),
    [
        ({"x": "N"}, [travel], "rooms.toml: room.x is in N; travel must know its unit, one like m"),
        ({"x": "cubit"}, [travel], "is in 'cubit', which its FMU does not define in SI units"),
        ({"x": "m"}, [wanting("w", x="mm")], "w: needs room.x in 'mm'; must be a unit of SI like"),
        ({"x": "m"}, [wanting("w", x="cubit")], "w: needs room.x in 'cubit'; must be a unit of SI"),
        ({"x": "m"}, [wanting("w", x="")], "w: needs room.x in ''; must be a unit of SI like 'm'"),
        (
            {"x": "m"},
            [travel, wanting("force", x="N")],
            "room.x is in m; force must know its unit, one like N",
        ),
    ],
)
def test_another_quantity_is_refused_in_one_line(load, units, asked, said):
    with pytest.raises(InputError) as caught:
        in_si(load(**units), asked)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_the_unit_of_what_need_not_be_there_counts_where_it_is(load):
    """As one of several, in one unit for all, or as what is used besides."""
    either = Metric("either", travel.function, needs={AnyOf(("room.y", "room.z")): "m"})
    used = Metric("used", travel.function, uses={"room.y": "m", "room.z": "m"})
    for m in (either, used):
        assert in_si(load(x="N", y="mm"), [m]) == InSi({"room.y": MILLI}, ())
        with pytest.raises(InputError, match=rf"room.y is in N; {m.name} must know its unit"):
            in_si(load(y="N"), [m])


def test_a_need_that_is_not_there_hides_none_behind_it(load):
    """Nor does one without a unit, or one of which the first alternative is not there."""
    for behind in ({"gone": "m", "x": "m"}, {"y": None, "x": "m"}):
        used = Metric("used", travel.function, uses={f"room.{n}": u for n, u in behind.items()})
        with pytest.raises(InputError, match=r"room\.x is in N; used must know its unit"):
            in_si(load(x="N"), [used])


def test_only_numbers_are_taken_to_be_in_si(load, tmp_path):
    """A Boolean and an Integer have no unit, and need none."""
    load()
    kinds = {"on": "Boolean", "count": "Integer"}
    outputs = {n: f'causality="output" variability="discrete" | {k}' for n, k in kinds.items()}
    write_fmu(tmp_path / "room.fmu", ROOM | outputs)
    system = System.load(tmp_path / "rooms.toml")
    assert {str(port) for port in system.observed} >= {"room.on", "room.count"}
    notes = in_si(system, (Metric("free", travel.function),)).notes
    assert notes == ("room.x, room.y: no unit, taken to be in SI",)


def test_what_a_metric_may_read_without_a_unit_is_said(load):
    free = Metric("free", travel.function)
    note = ("room.x: no unit, taken to be in SI",)
    assert in_si(load(y="m"), (free,)).notes == note
    assert in_si(load(), (wanting("bound", x="m", y=None),)).notes == note
    assert in_si(load(x="mm", y="m"), (free,)).notes == ()


def test_every_way_to_run_a_system_refuses_it_first(load, tmp_path, monkeypatch):
    """These FMUs have no binary: loading one would be another error."""
    bring_group(monkeypatch, "travels", travel)
    wrong = replace(load(x="N"), metrics=("travels",))
    ways = [
        lambda: simulate(wrong),
        lambda: simulate.session(wrong),
        lambda: sweep(wrong, [{"room.p": 1.0}], native=False),
        lambda: qualify(wrong, "room", tmp_path / "room.fmu"),
        lambda: qualify(replace(load(x="m"), metrics=("travels",)), "room", other),
    ]
    other = write_fmu(tmp_path / "other.fmu", room(x="mm", y="N"))
    for way in ways:
        with pytest.raises(InputError, match=r"must know its unit, one like m: \[components\.room"):
            way()
    with pytest.raises(InputError, match="of the candidate: --set components"):
        ways[-1]()


TIME, COLUMN = np.array([0.0, 1.0]), np.array([1.0, 3.0])


@given(st.floats(1e-6, 1e6) | st.floats(-1e6, -1e-6), st.floats(-1e3, 1e3))
def test_signals_come_in_si(factor, offset):
    to_si = {"room.x": Conversion(factor, offset)}
    run = Signals(TIME, {"room.x": COLUMN, "room.y": COLUMN}, {"hall": "room"}, to_si)
    assert (run["hall.x"] == factor * COLUMN + offset).all()
    assert run["hall.x"] is run["room.x"]
    assert run["room.y"] is COLUMN
    assert run.by_name["room.x"] is COLUMN
