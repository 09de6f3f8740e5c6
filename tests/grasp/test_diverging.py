"""A grasp whose loop is wrong ends where a signal runs away, whoever runs it."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from grasp_cosim import SimulationError, System, simulate
from grasp_cosim.ssp.to_archive import write_ssp
from grasp_cosim.system.parts import Port
from support.marks import slow

AWAY = r"^controller\.force\[1\] ran away: -1e\+06 N at t = 0\.413\d s, ten times as much every "
HINT = "; look at the signs and gains, or try a shorter step"


def turned(grasp):
    """The grasp with the force on finger 1 the wrong way round."""
    target = Port("plant", "force[1]")
    return replace(
        grasp,
        connections=tuple(
            replace(c, factor=-1.0) if c.target == target else c for c in grasp.connections
        ),
    )


def as_file(folder, fmus, more=""):
    """That as a system file, with more in [experiment]."""
    from grasp_cosim.grasp.presets import SYSTEM

    text = SYSTEM.read_text("utf-8").replace('fmu = "', f'fmu = "{fmus}/')
    right = '"controller.force[1] -> plant.force[1]"'
    assert right in text
    wrong = '{ from = "controller.force[1]", to = "plant.force[1]", factor = -1.0 }'
    path = folder / "turned.toml"
    text = text.replace(right, wrong).replace("[experiment]", f"[experiment]\n{more}")
    path.write_text(text, "utf-8")
    return path


@pytest.mark.parametrize(
    ("engine", "every"), [("compiled", 1), slow("python", 1), slow("python", 100)]
)
def test_it_is_kept_up_to_there_the_same_bits_in_both_engines(grasp, engine, every):
    with pytest.raises(SimulationError, match=AWAY) as caught:
        simulate(turned(grasp), every=every, engine=engine, stop=0.6)
    result = caught.value.result
    assert str(caught.value).endswith(HINT + '; or let it go on: diverging = "continue"')
    assert not result.complete
    assert result.time[-1] == 0.4135
    force = result["controller.force[1]"]
    assert abs(force[-1]) >= 1e6
    on = simulate(turned(grasp), diverging="continue", stop=0.5, engine="python", every=every)
    assert (on["controller.force[1]"][: len(force) - 1] == force[:-1]).all()
    assert on.complete
    (line,) = on.log
    assert line.endswith(HINT + "; the run went on")


@pytest.mark.slow
def test_the_command_keeps_the_recording_and_is_3(command, fmus, tmp_path):
    path = as_file(tmp_path, fmus)
    code, out, err = command("run", path, "--out", "out")
    assert (code, out) == (3, "")
    assert "controller.force[1] ran away: " in err.splitlines()[-1]
    assert json.loads(Path("out/run.json").read_text())["complete"] is False
    assert len(Path("out/signals.csv").read_text().splitlines()) == 4137
    code, out, err = command("run", path, "--set", "experiment.diverging=continue", "--stop", "1")
    assert code == 0
    assert "ran away" in err
    assert "e+" in next(line for line in out.splitlines() if line.startswith("peak"))
    assert max(map(len, out.splitlines())) < 80


def test_a_system_file_lets_it_go_on_and_so_does_its_archive(fmus, tmp_path):
    system = System.load(as_file(tmp_path, fmus, 'diverging = "continue"'))
    assert simulate(system, stop=0.5, step=1e-3).settings["diverging"] == "continue"
    write_ssp(system, tmp_path / "turned.ssp")
    assert System.load(tmp_path / "turned.ssp").diverging == "continue"


@pytest.mark.slow
@pytest.mark.parametrize("case", [0, 1, 2])
@pytest.mark.parametrize("scheme", ["sequential", "jacobi"])
@pytest.mark.parametrize("plant", ["", "Compliant", "Movable"])
def test_no_grasp_of_ours_does(command, fmus, case, scheme, plant):
    swap = f"plant={fmus / f'GripperPlant{plant}.fmu'}"
    options = ("--case", str(case), "--scheme", scheme, "--swap", swap, "--step", "1e-3")
    code, _, err = command("run", *options, "--stop", "2")
    assert (code, "ran away" in err) == (0, False)


def test_a_loop_that_only_overshoots_does_not(grasp):
    """Hardly any damping in the contact force layer: 300 N instead of 3.4 N, and it settles."""
    result = simulate(grasp.with_values({"controller.contact_force.damping": 1e-3}), step=1e-3)
    assert result.complete
    assert np.abs(result["plant.contact_force[1]"]).max() > 50.0
