"""Values at the start of what is neither input nor parameter, as FMI lets a host set them."""

import numpy as np
import pytest
from grasp_cosim import InputError, System, simulate, sweep
from grasp_cosim.comparison.compare import compare
from ssp.hand_made import archive, bind, component, parameter_set, structure, system
from support.native_fmus import KINDS, build_model, needs_cvode, needs_gcc

pytestmark = [needs_gcc, needs_cvode]
STEP, STOP, GRAVITY = 0.1, 0.4, -9.81


def fallen(height, speed=0.0):
    """The heights of a ball that does not touch the floor yet."""
    time = STEP * np.arange(round(STOP / STEP) + 1)
    return height + speed * time + GRAVITY / 2.0 * time**2


def last_height(run):
    """The height at the end, in m."""
    return run["ball.h"][-1]


def load(folder, entries="", kind="CoSimulation", version="2.0", values="values = { h = 2.0 }"):
    """A bouncing ball, whose height h and speed v are outputs with initial = exact."""
    build_model("bouncing_ball", folder, version, [kind])
    path = folder / "ball.toml"
    path.write_text(
        f"[experiment]\nstep = {STEP}\nstop = {STOP}\n"
        f'[components.ball]\nfmu = "bouncing_ball.fmu"\n{values}\n{entries}',
        "utf-8",
    )
    return System.load(path)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_a_state_begins_where_the_system_says(tmp_path, kind, version):
    result = simulate(load(tmp_path, kind=kind, version=version))
    assert result["ball.h"] == pytest.approx(fallen(2.0), abs=1e-9)


def test_one_in_a_process_of_its_own(tmp_path):
    result = simulate(load(tmp_path, 'isolation = "process"'))
    assert result["ball.h"] == pytest.approx(fallen(2.0), abs=1e-9)


@pytest.mark.slow
def test_presets_changes_and_sweeps_set_it_alike(tmp_path):
    loaded = load(tmp_path, "[presets.thrown]\n'ball.v' = 1.0\n")
    thrown = simulate(loaded.with_presets("thrown"))
    assert thrown["ball.h"] == pytest.approx(fallen(2.0, 1.0), abs=1e-9)
    by_hand = simulate(loaded.with_settings({"ball.v": "1.0"}))
    assert compare(by_hand, thrown).alike
    table = sweep(loaded, {"ball.h": [1.5, 3.0]}, metrics=[last_height], workers=1)
    heights = [fallen(h)[-1] for h in (1.5, 3.0)]
    assert list(table["last_height"]) == pytest.approx(heights, abs=1e-9)


def test_a_start_value_of_an_archive(tmp_path):
    ball = build_model("bouncing_ball", tmp_path).read_bytes()
    values = parameter_set("h Real 2.0;g Real -9.81;der(h) Real 5.0;nowhere Real 1.0")
    parts = system("top", component("ball", bindings=bind(values)))
    path = archive(tmp_path, structure(parts), {}, {"resources/ball.fmu": ball})
    loaded = System.load(path, step=STEP, stop=STOP)
    assert loaded.start("ball.h") == 2.0
    assert simulate(loaded)["ball.h"] == pytest.approx(fallen(2.0), abs=1e-9)
    assert any("der(h)" in note and "calculates" in note for note in loaded.notes)
    assert any("nowhere" in note for note in loaded.notes)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ("values = { 'der(h)' = 1.0 }", r"der\(h\) = 1.0: is a local variable that the FMU calcul"),
        ("values = { time = 1.0 }", "time = 1.0: is the time of the FMU; must be an input, a para"),
        ("values = { height = 1.0 }", "no input, parameter or initial value 'height'; valid: h, "),
    ],
)
def test_what_cannot_be_set_is_refused(tmp_path, values, message):
    with pytest.raises(InputError, match=message):
        load(tmp_path, values=values)


def test_an_event_does_not_set_it(tmp_path):
    event = "[[events]]\nat = 0.2\nset = { 'ball.h' = 1.0 }\n"
    with pytest.raises(InputError, match=r"ball\.h: is the start of what the FMU calculates: must"):
        load(tmp_path, event)
