"""Qualifications in the closed loop: copies, altered plants, failures, bands; FMUs in C."""

import json
import math
from dataclasses import replace
from pathlib import Path

import pytest
from conftest import alter
from grasp_cosim import InputError, SimulationError, System, cli
from grasp_cosim.comparison.bands import Bands, Given, read_bands
from grasp_cosim.comparison.qualify import qualify
from grasp_cosim.comparison.summary import qualification_json as as_json
from grasp_cosim.comparison.summary import qualification_text as as_text
from grasp_cosim.comparison.summary import reason
from support.marks import slow
from support.native_fmus import build, build_model, needs_gcc

NUMERICS = ("every second sample", "step 0.002 s", "scheme jacobi")


@pytest.fixture(scope="module")
def short(grasp):
    """The beginning of the grasp."""
    return grasp.with_experiment(step=1e-3, stop=0.05)


@pytest.fixture(scope="module")
def heavy(tmp_path_factory):
    """The plant with a heavier second finger, which its model description tells."""
    before = "high=1e3, tunable=True)\n    ] = (0.5, 0.5)"
    after = before.replace("0.5)", "0.6)")
    folder = tmp_path_factory.mktemp("heavy")
    return alter(folder, "python", "GripperPlant", "gripper_plant/fingers.py", before, after)


@pytest.fixture(scope="module")
def copied(short):
    """The qualification of the plant that is there already."""
    return qualify(short, "plant", own_plant(short), isolation="none")


@pytest.fixture(scope="module")
def heavier(short, heavy):
    """That of the heavier finger."""
    return qualify(short, "plant", heavy, isolation="none")


def by_name(compared):
    return {c.name: c for c in compared}


def test_what_is_recorded_besides_is_compared_with_the_outputs(short, copied):
    """A parameter that the candidate has as well; the outputs are compared in any case."""
    found = qualify(
        short.with_record("plant.object_width"), "plant", own_plant(short), isolation="none"
    )
    assert found.qualified
    names = {s.name for s in copied.signals if not s.name.startswith("plant.exchange_energy")}
    assert {s.name for s in found.signals} == {*names, "plant.object_width"}


def own_plant(system):
    return system.component("plant", "test").fmu


def test_a_copy_is_qualified_without_any_deviation(copied):
    found = copied
    assert found.qualified
    assert found.swap.differences == ()
    assert found.comparison.numerics == NUMERICS
    assert found.failure is None
    assert len(found.signals) >= 21
    assert len(found.metrics) + len(found.comparison.absent) == 19
    assert {c.deviation for c in (*found.signals, *found.metrics)} == {0.0}
    assert all(c.band.source == "derived" for c in (*found.signals, *found.metrics))
    assert by_name(found.signals)["plant.gap[1]"].band.time == 0.002  # two steps
    assert as_text(found).startswith("QUALIFIED: GripperPlant.fmu as plant")
    found = replace(found, comparison=replace(found.comparison, signals=(), metrics=()))
    assert not found.qualified
    assert as_json(found)["reason"].startswith("nothing was compared: no output")


def test_text_and_json_of_a_heavier_finger(heavier, snapshot):
    found = heavier
    assert not found.qualified
    ratios = [c.ratio for c in found.signals]
    assert ratios == sorted(ratios, reverse=True)
    worst = found.signals[0]
    assert worst.deviation == pytest.approx(abs(worst.candidate - worst.original), rel=1e-12)
    report = json.loads(json.dumps(as_json(found), allow_nan=False))
    report |= {key: Path(report[key]).name for key in ("original", "candidate")}
    report |= {kind: list(report[kind][0]) for kind in ("signals", "metrics")}  # not the numbers
    report["bands"] = {kind: sorted(of) for kind, of in report["bands"].items()}
    assert report == snapshot
    first, *_, interface, bands = as_text(found).split("\n\n")
    assert [first, interface, bands] == snapshot


def test_a_blocked_candidate_is_not_run(short, fmus):
    found = qualify(short, "plant", fmus / "ProximitySensor.fmu")
    assert not found.qualified
    assert found.comparison is None
    assert "force[1], " in as_json(found)["reason"]
    lines = as_text(found).splitlines()
    assert lines[1].startswith("not run, the interface does not fit: force[1], ")
    assert sum(line.startswith("  blocks  missing      ") for line in lines) == 8
    assert "  blocks  1 more; --json has all" in lines
    assert "  notes   missing      finger_mass[1]: parameter is missing" in lines


def test_bands_of_a_file_decide(short, heavy):
    wide = Bands("b.toml", {"*": Given(relative=1.0)}, {"*": Given(absolute=math.inf)})
    found = qualify(short, "plant", heavy, bands=wide, isolation="none")
    assert found.qualified
    assert found.comparison.numerics == ()  # nothing is derived, so the original is run once
    assert {c.band.source for c in (*found.signals, *found.metrics)} == {"given"}
    wrong = replace(wide, metrics={"plant.gapp": Given(absolute=1.0)})
    with pytest.raises(InputError, match=r"b.toml: \[metrics\]: nothing is called 'plant.gapp'"):
        qualify(short, "plant", heavy, bands=wrong, isolation="none")


def test_a_written_band_file_gives_the_same_verdict(short, heavy, heavier, tmp_path):
    first = heavier
    (tmp_path / "first.json").write_text(json.dumps(as_json(first)))
    bands = read_bands(tmp_path / "first.json")
    second = qualify(short, "plant", heavy, bands=bands, isolation="none")
    assert [(c.name, c.ratio) for c in second.signals] == [(c.name, c.ratio) for c in first.signals]
    assert second.comparison.numerics == ()


CONTACT = "s_1, v_1, f_1, touch_1 = contact.advance("


def test_a_candidate_that_refuses_its_parameters(short, altered):
    before = "right, left = self.initial_position"
    trap = "if self.initial_object_position == 0.01:\n            raise ValueError('no licence')"
    refuse = f"{trap}\n        {before}"
    fmu = altered("GripperPlant", "gripper_plant/fingers.py", before, refuse)
    moved = short.with_values({"plant.initial_object_position": 0.01})
    found = qualify(moved, "plant", fmu, isolation="none")
    assert not found.qualified
    assert found.failure is not None
    assert "no licence" in found.failure
    assert found.signals == ()


def test_an_original_that_fails_is_no_verdict(short, altered):
    trap = f"if u_2 > 0.5:\n        raise RuntimeError('the motor burns')\n    {CONTACT}"
    fmu = altered("GripperPlant", "gripper_plant/rigid.py", CONTACT, trap)
    with pytest.raises(SimulationError, match="the motor burns"):
        qualify(short.swap("plant", fmu), "plant", own_plant(short), isolation="none")


# ------------------------------------------------------------------------- FMUs in C

UNITS = {"x": "m", "gain": "m"}


@pytest.fixture
def loop(tmp_path):
    """x' = gain·(1 - x), one step of 0.01 s after the other: x = 1 - 0.97^k."""
    build(tmp_path, "plant", "2.0", UNITS)
    build(tmp_path, "spring", "2.0", {"u_Real": "m"})
    inputs = ", ".join(
        f"{name} = {value}"
        for name, value in (
            ("u_Integer", "0"), ("u_Boolean", "false"), ("u_Enumeration", "1"), ("u_String", '"a"'),
        )
    )  # fmt: skip
    (tmp_path / "loop.toml").write_text(
        "connections = [\n"
        '  "plant.x -> spring.u_Real",\n'
        '  { from = "spring.y_Real", to = "plant.u_Real", factor = -1.0, offset = 1.0 },\n]\n'
        "[experiment]\nstep = 0.01\nstop = 1.0\n"
        f'[components.plant]\nfmu = "plant.fmu"\nvalues = {{ gain = 3.0, {inputs} }}\n'
        f'[components.spring]\nfmu = "spring.fmu"\nvalues = {{ {inputs} }}\n'
    )
    return System.load(tmp_path / "loop.toml")


@needs_gcc
def test_millimetres_are_converted_on_the_connection_in_values_and_in_signals(loop, tmp_path):
    """With its gain in mm, the candidate integrates to x in mm."""
    candidate = build(tmp_path, "millimetres", "2.0", {"x": "mm", "gain": "mm"})
    found = qualify(loop, "plant", candidate, isolation="none")
    assert [(d.severity, d.kind, d.variable, d.text) for d in found.swap.differences] == [
        ("warns", "unit", "gain", "unit mm instead of m: 3 m becomes 3000 mm"),
        ("warns", "unit", "x", "unit mm instead of m: converted"),
    ]
    assert found.qualified
    x, other = (run["plant.x"].values for run in found.comparison.curves)
    assert x.tolist() == pytest.approx([1.0 - 0.97**k for k in range(101)], rel=1e-9)
    assert other.tolist() == pytest.approx(x.tolist(), rel=1e-12)
    assert {c.unit for c in found.signals if c.name == "plant.x"} == {"m"}


@needs_gcc
def test_a_candidate_of_fmi_3_under_other_names(loop, tmp_path):
    candidate = build(tmp_path, "three", "3.0", UNITS)
    rename = {"u_Real": "u_Float64", "y_Real": "y_Float64", "u_Integer": "u_Int32"}
    rename["y_Integer"] = "y_Int32"
    new = ("Float32", "Int8", "UInt8", "Int16", "UInt16", "UInt32", "Int64", "UInt64")
    values = {f"plant.u_{t}": 0 for t in new}
    found = qualify(loop, "plant", candidate, rename=rename, values=values)
    assert found.blocks == ()
    assert found.failure is None
    assert found.qualified
    kinds = {d.kind for d in found.swap.differences}
    assert {"capability", "extra"} <= kinds
    assert "type" not in kinds  # Float64 is Real, Int32 is Integer


def going_wrong(loop, folder, what, isolation):
    """A candidate with a misfortune at 0.505 s, which it takes for its gain."""
    candidate = build(folder, "candidate", "2.0", {"x": "m", what: "m"})
    system = loop.with_values({"plant.gain": 0.505})
    rename = {"gain": what, what: "gain"}
    return qualify(system, "plant", candidate, rename=rename, isolation=isolation)


@pytest.mark.parametrize(
    ("what", "text"),
    [("crash_at", "SIGSEGV"), slow("exit_at", "exit"), slow("error_at", "lamp is broken")],
)
@needs_gcc
def test_a_candidate_that_ends_on_the_way(loop, tmp_path, what, text):
    """Not even a crash leaves the candidate's process: what it did until then is compared."""
    found = going_wrong(loop, tmp_path, what, "process")
    assert not found.qualified
    assert found.failure is not None
    assert text in found.failure
    assert found.comparison.curves[1]["plant.x"].time[-1] == pytest.approx(0.5)
    assert found.comparison.curves[0]["plant.x"].time[-1] == pytest.approx(1.0)
    assert found.metrics == ()
    assert all(c.time is not None and c.time <= 0.5 for c in found.signals)
    assert as_text(found).splitlines()[1].startswith("the candidate failed: plant: ")


@needs_gcc
def test_a_candidate_that_asks_for_the_end_ends_sooner(loop, tmp_path):
    found = going_wrong(loop, tmp_path, "terminate_at", "none")
    (end,) = (m for m in found.metrics if m.name == "end_of_run")
    assert (end.original, end.unit, end.inside) == (1.0, "s", False)
    assert end.candidate == pytest.approx(0.505, abs=0.011)


@needs_gcc
@pytest.mark.parametrize(
    ("start", "stop", "shift", "numerics"),
    [
        (0.0, 0.08, 0.02, ["step 0.02 s", "scheme jacobi"]),
        (0.01, 0.09, 0.02, ["step 0.02 s", "scheme jacobi"]),
        (0.01, 0.08, 0.02, ["scheme jacobi"]),
        (30.0, 30.04, 0.02, ["step 0.02 s", "scheme jacobi"]),
    ],
)
def test_the_numerics_and_the_shift_are_those_of_the_span(loop, start, stop, shift, numerics):
    """Which is from the start to the stop, wherever that is on the clock."""
    system = loop.with_settings({"experiment.start": start, "experiment.stop": stop})
    found = qualify(system, "plant", loop.component("plant", "").fmu, isolation="none")
    assert found.qualified
    assert [n for n in found.comparison.numerics if n.startswith(("step", "scheme"))] == numerics
    (signal,) = (s for s in found.signals if s.name == "plant.x")
    assert signal.band.time == pytest.approx(shift)


@needs_gcc
def test_a_step_that_the_candidate_rejects_is_told(loop, tmp_path):
    found = going_wrong(loop, tmp_path, "discard_at", "none")
    assert not found.qualified
    assert any(
        "discard" in line or "reject" in line
        for line in (*found.comparison.notes, found.failure or "")
    )


@needs_gcc
@pytest.mark.parametrize(
    ("loops", "said"), [("refuse", "algebraic loop"), ("iterate", "out of band")]
)
def test_a_new_direct_dependence_is_judged_by_the_candidates_own_run(loops, said, loop, tmp_path):
    """What it calls x is u_Real at once."""
    system = replace(loop, initialisation=replace(loop.initialisation, loops=loops))
    found = qualify(system, "plant", tmp_path / "plant.fmu", rename={"x": "y_Real", "y_Real": "x"})
    assert not found.qualified
    assert said in as_json(found)["reason"]


def test_a_qualification_is_true_where_the_candidate_may_take_the_place(copied, heavier):
    assert copied
    assert not heavier
    assert copied != heavier


def test_a_qualification_shows_its_verdict_and_its_reason(heavier):
    first, why, *lines = repr(heavier).splitlines()
    assert first.startswith("NOT QUALIFIED: GripperPlant.fmu as plant (now GripperPlant.fmu)")
    assert why.startswith("  7 of 33 signals and ")
    assert len(lines) < 22
    assert reason(heavier) in heavier._repr_html_()


def test_a_candidate_that_did_not_run_shows_why(short, fmus):
    blocked = qualify(short, "plant", fmus / "GraspController.fmu")
    assert not blocked
    assert "the interface does not fit" in repr(blocked)
    assert "the interface does not fit" in blocked._repr_html_()


SOLVED = (
    "x: other.fmu runs by model exchange, integrated by CVode with a relative tolerance of 1e-08"
)


@pytest.fixture
def decay(tmp_path):
    """A decay by co-simulation, and the same as an FMU of both kinds."""
    build_model("dahlquist", tmp_path, "2.0", ("CoSimulation",))
    other = build_model("dahlquist", tmp_path, file="other")
    path = tmp_path / "system.toml"
    path.write_text(
        "[experiment]\nstep = 0.1\nstop = 1.0\n"
        '[components.x]\nfmu = "dahlquist.fmu"\nvalues = { u = 0.0 }\n',
        "utf-8",
    )
    return System.load(path), other


@needs_gcc
def test_a_candidate_of_both_kinds_runs_by_model_exchange_with_options_of_a_solver(decay):
    """They are not those of the original, which is for co-simulation."""
    system, other = decay
    for solver, solved in ((None, False), ({"relative_tolerance": 1e-8}, True)):
        found = qualify(system, "x", other, solver=solver, isolation="none")
        assert (SOLVED in found.comparison.notes) == solved
    with pytest.raises(InputError, match=r"^--set components.x.solver: unknown entry 'tolerance'"):
        qualify(system, "x", other, solver={"tolerance": 1e-8})


@needs_gcc
def test_the_command_gives_the_options_of_a_solver_to_the_candidate(decay, tmp_path, capsys):
    _, other = decay
    options = ("--as", "x", "--system", str(tmp_path / "system.toml"))
    solver = ("--set", "components.x.solver.relative_tolerance=1e-8")
    cli.main(["qualify", str(other), *options, *solver])
    assert SOLVED in capsys.readouterr().out.splitlines()
