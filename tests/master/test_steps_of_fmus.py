"""The steps that FMUs are asked for: of 1/30 s, up to the stop time, and as they declare them."""

from fractions import Fraction

import pytest
from grasp_cosim import InputError, System, load_run, simulate
from grasp_cosim.ssp.to_archive import write_ssp
from support.marks import engines
from support.native_fmus import CAPABLE, build_model, needs_cvode, needs_gcc

pytestmark = needs_gcc
EARLY = {**CAPABLE, "mightReturnEarlyFromDoStep": "true"}
KIND = ["CoSimulation"]
RIGID = {"canHandleVariableCommunicationStepSize": "false"}
INSIDE = {**RIGID, "fixedInternalStepSize": "0.005"}


def rigid(folder, experiment, more="", version="2.0", **built):
    """The system of one rigid FMU."""
    build_model("rigid", folder, version, KIND, **built)
    text = f'[experiment]\n{experiment}\n[components.a]\nfmu = "rigid.fmu"\n{more}'
    (folder / "rigid.toml").write_text(text)
    return System.load(folder / "rigid.toml")


@engines
@pytest.mark.parametrize("version", ["2.0", "3.0"])
@pytest.mark.parametrize("step", ['"1/30"', "0.033333333333333333", "0.0333333333333333"])
def test_thirty_steps_a_second(tmp_path, version, engine, step):
    """With the same number inside, all 300 in 10 s, each from the float nearest to k/30."""
    own = f"values = {{ inside = {1 / 30!r} }}\n"
    run = simulate(rigid(tmp_path, f"step = {step}\nstop = 10.0", own, version), engine=engine)
    assert run["a.count"].tolist() == list(range(301))
    assert run.time.tolist() == [float(Fraction(k, 30)) for k in range(301)]
    assert run["a.begin"][1:].tolist() == run.time[:-1].tolist()
    assert set(run["a.length"][1:]) == {1 / 30}


def test_files_and_archives_have_the_same_times(tmp_path):
    more = 'step = "1/15"\n'
    system = rigid(tmp_path, 'step = "1/30"\nstart = "-1/3"\nstop = "1/3"', more)
    write_ssp(system, tmp_path / "rigid.ssp")
    again = System.load(tmp_path / "rigid.ssp")
    assert (again.time_grid, again.stop_ns) == (system.time_grid, system.stop_ns)
    assert again.period("a") == 2
    run = simulate(again)
    run.to_csv(tmp_path / "signals.csv")
    run.to_json(tmp_path / "run.json")
    back = load_run(tmp_path)
    assert (
        back.time.tolist() == run.time.tolist() == [float(Fraction(k, 30)) for k in range(-10, 11)]
    )
    assert back.metrics["steps"] == 20
    assert back.every == 1


@engines
def test_events_faults_and_inputs_go_by_them(tmp_path, engine):
    """An event at 2/3 s comes before the step that begins there; inputs are at whole ns."""
    build_model("dahlquist", tmp_path)
    (tmp_path / "drive.csv").write_text("time,a.u\n0,0\n0.4,4\n")
    (tmp_path / "s.toml").write_text(
        'connections = ["a.y -> b.u"]\n[experiment]\nstep = "1/3"\nstop = 2.0\n'
        '[components.a]\nfmu = "dahlquist.fmu"\nvalues = { d = 1.0 }\n'
        '[components.b]\nfmu = "dahlquist.fmu"\n'
        '[[events]]\nat = "2/3"\nset = { "b.k" = 5.0 }\n'
        '[[faults]]\nconnection = "a.y -> b.u"\nkind = "stuck"\nvalue = 0.0\nfrom = "1/3"\n'
        '[input]\nfile = "drive.csv"\n'
    )
    run = simulate(System.load(tmp_path / "s.toml"), engine=engine)
    assert "t = 0.666666667 s: b.k = 5.0" in run.log
    assert "t = 0.333333333 s: b.u: stuck begins" in run.log
    fed = (run["a.y"] - run["a.x"])[1:]
    assert fed.tolist() == pytest.approx([0.0, 10 / 3, 4.0, 4.0, 4.0, 4.0], abs=1e-12)


@needs_cvode
def test_the_solver_of_a_model_ends_at_them(tmp_path):
    build_model("stair", tmp_path, "3.0", ["ModelExchange"])
    text = '[experiment]\nstep = "1/3"\nstop = 4.0\n[components.a]\nfmu = "stair.fmu"\n'
    (tmp_path / "s.toml").write_text(text)
    run = simulate(System.load(tmp_path / "s.toml"))
    assert run["a.counter"].tolist() == [1 + k // 3 for k in range(13)]


PAIRS = [
    (0.1, 0.3, 1),
    (0.1, 1.2, 1),
    (0.1, 0.6, 2),
    (0.7, 5.6, 1),
    (1e-3, 0.009, 1),
    (0.01, 0.15, 5),
]
"""Steps and stop times whose last step ends, in floats, after the stop time; and whole numbers of
steps that the FMU takes at once.
"""


@engines
@pytest.mark.parametrize("capabilities", [RIGID, EARLY])
@pytest.mark.parametrize(("step", "stop", "times"), PAIRS)
def test_no_step_ends_after_the_stop_time(tmp_path, step, stop, times, capabilities, engine):
    """All steps are equally long, also for an FMU that would take no other one."""
    more = f"step = {round(times * step, 9)}\n" if times > 1 else ""
    made = rigid(tmp_path, f"step = {step}\nstop = {stop}", more, capabilities=capabilities)
    run = simulate(made, engine=engine)
    assert run.complete
    assert set(run["a.length"][times:]) == {float(round(times * step, 9))}
    assert run["a.begin"][-1] + run["a.length"][-1] > stop


@pytest.mark.slow
def test_none_does_of_many_pairs(tmp_path):
    system = rigid(tmp_path, "step = 0.1\nstop = 1.0")
    beyond = 0
    for step in (0.1, 0.01, 0.001, 0.7):
        for count in range(1, 40):
            stop = round(step * count, 9)
            run = simulate(system, step=step, stop=stop)
            assert run.complete
            beyond += run["a.begin"][-1] + run["a.length"][-1] > stop
    assert beyond > 10


@pytest.mark.parametrize("version", ["2.0", "3.0"])
@pytest.mark.parametrize(
    ("step", "stop", "longest"), [(0.1, 0.3, 0.04), (0.7, 5.6, 0.3), (0.1, 1.2, 0.03)]
)
def test_no_part_of_a_rejected_step_does(tmp_path, version, step, stop, longest):
    more = f"values = {{ longest = {longest} }}\n"
    made = rigid(tmp_path, f"step = {step}\nstop = {stop}", more, version, capabilities=EARLY)
    run = simulate(made)
    assert run.complete
    assert run.rejections["a"].count == round(stop / step)


def remarks_on(system):
    """The lines of the log of a run."""
    return simulate(system).log


@pytest.mark.parametrize(
    ("experiment", "more", "settings"),
    [
        ("step = 0.01\nstop = 1.0", "", "--set experiment.step=0.005"),
        ("step = 0.001\nstop = 1.0", "", "--set components.a.step=0.005"),
        ("step = 0.001\nstop = 1.0", "step = 0.01\n", "--set components.a.step=0.005"),
        ("step = 0.01\nstart = 0.001\nstop = 0.031", "", "--set experiment.step=0.005"),
        (
            "step = 0.002\nstop = 0.022",
            "",
            "--set experiment.step=0.005 --set experiment.stop=0.02",
        ),
        ('step = "1/30"\nstop = 1.0', "", "--set experiment.step=0.005"),
    ],
)
def test_another_step_than_a_rigid_fmu_recommends_is_said_once(
    tmp_path, experiment, more, settings
):
    """What is said then runs, and nothing is said any more."""
    system = rigid(tmp_path, experiment, more, capabilities=RIGID, step=0.005)
    log = remarks_on(system)
    assert len(log) == 1
    assert log[0].startswith(
        "a: rigid.fmu recommends steps of 0.005 s, and declares that it cannot"
    )
    assert log[0].endswith(f"with its own: {settings}")
    pairs = (text.split("=") for text in settings.replace("--set ", "").split())
    assert remarks_on(system.with_settings(dict(pairs))) == ()


def test_a_step_that_is_no_whole_number_of_those_recommended_is_said(tmp_path):
    """Though the FMU may vary its step."""
    system = rigid(tmp_path, "step = 0.007\nstop = 0.07", step=0.005)
    assert remarks_on(system) == (
        "a: rigid.fmu recommends steps of 0.005 s, and is asked for 0.007 s, which is no whole "
        "number of them; one would be: --set experiment.step=0.005",
    )
    assert remarks_on(system.with_experiment(step=0.005)) == ()


@pytest.mark.parametrize("built", [{"step": 0.005}, {"capabilities": RIGID}])
def test_nothing_is_said_where_it_may_vary_or_is_asked_for_its_own(tmp_path, built):
    assert remarks_on(rigid(tmp_path, "step = 0.01\nstop = 1.0", **built)) == ()


@pytest.mark.parametrize(
    ("step", "settings"),
    [("0.007", "--set experiment.step=0.005"), ('"1/30"', "--set experiment.step=0.035")],
)
def test_a_step_that_a_rigid_fmu_cannot_take_is_refused(tmp_path, step, settings):
    system = rigid(tmp_path, f"step = {step}\nstop = 7.0", version="3.0", capabilities=INSIDE)
    with pytest.raises(InputError) as caught:
        simulate(system)
    said = "rigid.toml: a: rigid.fmu takes steps of 0.005 s inside (fixedInternalStepSize), and "
    assert str(caught.value).startswith(said)
    assert str(caught.value).endswith(f"is no whole number of them; one would be: {settings}")
    place, value = settings.removeprefix("--set ").split("=")
    assert remarks_on(system.with_settings({place: value})) == ()


def test_it_is_said_of_one_that_may_vary(tmp_path):
    """Reference FMUs are such: they get to the communication point at the next one."""
    able = {**INSIDE, "canHandleVariableCommunicationStepSize": "true"}
    system = rigid(tmp_path, "step = 0.007\nstop = 0.07", version="3.0", capabilities=able)
    assert "0.007 s is no whole number of them" in remarks_on(system)[0]
    assert remarks_on(system.with_experiment(step=0.01)) == ()


def test_our_own_take_any_step_without_a_word(grasp):
    """They recommend one, and may vary it."""
    assert all(c.interface.step for c in grasp.components)
    assert not [line for line in simulate(grasp, step=7e-4, stop=0.0049).log if "step" in line]
