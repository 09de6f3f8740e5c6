"""The published grasp with components of other names: roles say who is the plant."""

import json
from pathlib import Path

import numpy as np
import pytest
from grasp_cosim import System, load_run, simulate
from grasp_cosim.grasp.metrics import METRICS
from grasp_cosim.grasp.presets import CASES, SYSTEM, with_case, with_preset
from grasp_cosim.metrics.metric import Signals, measure
from grasp_cosim.recording.recorded_run import UNITS
from hypothesis import given
from hypothesis import strategies as st
from support.marks import needs_pythonfmu

LOST = (
    "no metrics of the grasp but target_position: no component is the plant; name it under "
    '[roles]: plant = "gripper"',
)
NAMES = {"plant": "gripper", "sensor_1": "right", "sensor_2": "left", "controller": "brain"}


def written(fmus, folder, names, roles, presets):
    """The built-in system file with other names of its components, in folder."""
    text, _, rest = SYSTEM.read_text("utf-8").partition("# Values under a name")
    text += rest.partition("\n")[2] if presets else ""
    for old, new in names.items():
        for place in ('"{}.', "-> {}.", "components.{}]"):
            text = text.replace(place.format(old), place.format(new))
    text = text.replace('fmu = "', f'fmu = "{fmus}/')
    if roles:
        text += "\n[roles]\n" + "".join(f'{old} = "{new}"\n' for old, new in names.items())
    path = folder / "renamed.toml"
    path.write_text(text, "utf-8")
    return path


def renamed(signals, names):
    found = {}
    for name, column in signals.items():
        component, _, variable = name.partition(".")
        found[f"{names.get(component, component)}.{variable}"] = column
    return found


def of_the_grasp(metrics):
    return {k: v for k, v in metrics.items() if k not in UNITS}


@pytest.fixture(scope="module")
def original(grasp):
    """Case 0, until both fingers have touched."""
    return simulate(with_case(grasp, 0), step=1e-3, stop=0.5)


def test_without_a_plant_there_are_no_metrics_of_it_and_it_says_why(fmus, tmp_path):
    """It is called gripper, and nobody says so."""
    path = written(fmus, tmp_path, {"plant": "gripper"}, roles=False, presets=False)
    result = simulate(System.load(path), step=1e-3, stop=0.01)
    assert result.measured.missing == LOST
    assert set(result.metrics) == {"target_position", *UNITS}
    assert result.view.stem == "signals"


def test_with_roles_they_are_the_same_to_the_bit(original, fmus, tmp_path):
    system = System.load(written(fmus, tmp_path, NAMES, roles=True, presets=False))
    result = simulate(with_case(system, 0), step=1e-3, stop=0.5)
    assert list(result) == list(renamed(original, NAMES))
    assert "gripper.gap[1]" in result
    assert of_the_grasp(result.metrics) == of_the_grasp(original.metrics)
    assert result.measured.missing == ()
    assert None not in result.metrics["time_to_contact"]
    assert result.view.stem == "grasp"


def test_a_plant_whose_contacts_have_other_names_has_the_same_metrics(original, grasp):
    """Of every step, as its gaps are kept for them: a rigid finger touches where none is left."""
    names = {f"components.plant.rename.touches[{j}]": f"contact[{j}]" for j in (1, 2)}
    system = with_case(grasp.with_settings(names), 0)
    result = simulate(system, step=1e-3, stop=0.5, every=10)
    assert "plant.touches[1]" in result
    assert of_the_grasp(result.metrics) == of_the_grasp(original.metrics)
    assert result.measured.missing == ()
    assert result.view.stem == "grasp"


@given(
    st.lists(
        st.sampled_from(["plant", "controller", "sensor_1", "gripper", "a b", "x", "plant2", "p"]),
        min_size=2,
        max_size=2,
        unique=True,
    )
)
def test_metrics_do_not_depend_on_the_names_of_components(original, chosen):
    """Not even where the controller is called plant, and the plant controller."""
    names = dict(zip(("plant", "controller"), chosen, strict=True))
    signals = {name: original[name] for m in METRICS if not m.optional for name in m.reads}
    expected = measure(Signals(original.time, signals), METRICS)
    found = measure(Signals(original.time, renamed(signals, names), names), METRICS)
    assert found.values == expected.values
    assert found.missing == expected.missing == ()
    whole = renamed(signals, names)
    without = {name: column for name, column in whole.items() if "object_position" not in name}
    lacking = measure(Signals(original.time, without, names), METRICS)
    said = f"no object_shift, object_drift: {names['plant']} lacks object_position"
    assert lacking.missing == (said,)


@pytest.mark.parametrize("presets", [True, False], ids=["own presets", "built-in presets"])
def test_cases_and_bench_find_components_by_their_roles(grasp, fmus, tmp_path, presets):
    system = System.load(written(fmus, tmp_path, NAMES, roles=True, presets=presets))
    assert bool(system.presets) == presets
    pairs = [(with_case(system, n), with_case(grasp, n)) for n in CASES]
    pairs.append((with_preset(system, "bench"), with_preset(grasp, "bench")))
    pairs.append((with_case(pairs[-1][0], 1), with_case(pairs[-1][1], 1)))
    for ours, theirs in pairs:
        for role, name in NAMES.items():
            assert ours.component(name, "").values == theirs.component(role, "").values
        assert ours.roles == NAMES


OWN = """
import numpy as np

from grasp_cosim import metric


@metric("reach", unit="m", factor=1e3, shown_unit="mm", entries=("finger 1", "finger 2"))
def reach(run):
    return [np.ptp(run[f"plant.position[{j}]"]) for j in (1, 2)]


@metric("lazy")
def lazy(run):
    return reach(run)[0] < 1e-3
"""

HEAT = """

@metric("heat", unit="K", needs=("plant.temperatur",))
def heat(run):
    return run["plant.temperatur"][-1]
"""


@pytest.fixture
def own(tmp_path):
    path = tmp_path / "own.py"
    path.write_text(OWN, "utf-8")
    return path


def test_a_user_s_metrics_are_wherever_those_of_the_grasp_are(command, own, tmp_path):
    short = ("run", "--case", "0", "--step", "1e-3", "--stop", "0.05", "--metrics", own)
    code, out, _ = command(*short, "--out", "out")
    assert code == 0
    table = {line[:22].strip(): line[22:].split() for line in out.splitlines()}
    assert table["lazy"] == ["no"]
    run = json.loads(Path("out/run.json").read_text())
    measured = run["measured"]
    assert table["reach"] == [*(f"{1e3 * v:.3f}" for v in measured["reach"]), "mm"]
    assert (run["metric_units"]["reach"], run["metric_units"]["lazy"]) == ("m", None)
    assert run["missing_metrics"] == []

    found = json.loads(command(*short, "--json")[1])
    assert (found["reach"], found["lazy"]) == (measured["reach"], False)
    assert (found["units"]["reach"], found["units"]["lazy"]) == ("m", None)
    assert {*found} - {"units"} == {*found["units"]}

    back = load_run("out")
    assert (back.metrics["reach"], back.metrics["lazy"]) == (measured["reach"], False)
    assert back.metric_units == run["metric_units"]
    expected = np.ptp(back["plant.position[1]"])
    assert back.metrics["reach"][0] == expected > 0.0


PACED = ("--realtime", "--set", "realtime.factor=1e6", "--set", "realtime.overrun=stop")


@needs_pythonfmu
@pytest.mark.parametrize(
    ("more", "code", "said"),
    [
        ((), 2, "grasp-cosim: metric 'lazy': own.py, line 14: AttributeError: 'Signals' "),
        (PACED, 3, "kept what was recorded, in out\ngrasp-cosim: grasp.toml: the step at t = 0 s "),
    ],
)
def test_a_metric_that_fails_loses_nothing_of_the_run(command, own, more, code, said):
    """Nor does it hide why a run failed."""
    own.write_text(OWN.replace("return reach(run)[0] < 1e-3", "return run.reach"))
    short = ("run", "--step", "1e-3", "--stop", "0.01", "--metrics", own, "--out", "out", *more)
    found, out, err = command(*short)
    assert (found, out) == (code, "")
    assert err.startswith(said)
    assert err.count("\n") == said.count("\n") + 1
    run = json.loads(Path("out/run.json").read_text())
    (failed,) = run["missing_metrics"]
    assert failed.endswith("line 14: AttributeError: 'Signals' object has no attribute 'reach'")
    measured = run["measured"]
    assert ("reach" in measured, "lazy" in measured) == (True, False)
    back = load_run("out")
    assert back.metrics["reach"] == measured["reach"]
    assert back.complete == (code == 2)


def test_a_metric_of_the_name_of_one_of_the_grasp_is_refused(command, own):
    own.write_text(OWN.replace('"reach"', '"time_to_contact"'))
    code, out, err = command("run", "--stop", "0.01", "--metrics", own, "--json", "--quiet")
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert "metric 'time_to_contact': is defined twice" in err


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("", "", "metric 'heat': plant lacks temperatur; valid: "),
        (
            '"plant.temperatur"',
            '"plant.gapp[1]"',
            "plant lacks gapp[1]; did you mean plant.gap[1]?",
        ),
    ],
)
def test_a_metric_that_needs_another_signal_is_refused_before_the_run(
    command, own, old, new, message
):
    own.write_text(OWN + HEAT.replace(old, new) if old else OWN + HEAT)
    code, out, err = command("run", "--step", "1e-3", "--metrics", own, "--out", "out")
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert message in err
    assert not Path("out/run.json").exists()


def test_a_metric_that_reads_another_signal_names_its_line_and_the_nearest(command, own):
    own.write_text(
        OWN + HEAT.replace(', needs=("plant.temperatur",)', "").replace("temperatur", "gap")
    )
    code, _, err = command("run", "--step", "1e-3", "--stop", "0.1", "--metrics", own)
    assert (code, err.count("\n")) == (2, 1)
    assert "metric 'heat': own.py, line 19: plant lacks gap; a signal that is no output must" in err
    assert "did you mean plant.gap[1], plant.gap[2]?" in err


def test_an_optional_metric_may_need_another_signal(command, own):
    own.write_text(OWN + HEAT.replace('unit="K"', 'unit="K", optional=True'))
    code, out, _ = command("run", "--step", "1e-3", "--stop", "0.1", "--metrics", own)
    assert (code, "heat" in out) == (0, False)
