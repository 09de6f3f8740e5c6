"""The scripts of docs/studies.md and docs/colour_studies.py run; here with fewer runs."""

import re
from pathlib import Path

import colour_studies
import pytest
from grasp_cosim import grasp_system, sweep

PAGE = (Path(__file__).parents[2] / "docs/studies.md").read_text("utf-8")
MAP, CUBE, SOBOL = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("script", "fewer", "printed"),
    [
        (MAP, {", 25)": ", 3)", ", 17)": ", 2)", "stop=6.0": "stop=0.5"}, ""),
        (CUBE, {"random(200)": "random(4)", "stop=6.0": "step=1e-3, stop=3.0"}, "50%"),
        (SOBOL, {"n=64": "n=2"}, "alone"),
    ],
    ids=["map", "cube", "sobol"],
)
def test_a_script_runs(script, fewer, printed, tmp_path, monkeypatch, capsys):  # fmt: skip
    monkeypatch.chdir(tmp_path)
    for text, less in fewer.items():
        assert text in script
        script = script.replace(text, less)
    exec(script, {"__name__": "script"})
    assert printed in capsys.readouterr().out
    assert (tmp_path / "map.png").exists() == (script[:5] == MAP[:5] and "map.png" in script)


@pytest.mark.slow
def test_the_rows_of_the_monte_carlo_fit():
    rows = colour_studies.drawn(4)
    assert len(rows[0]) == 24
    system = colour_studies.rig("adaptive", bench=True).with_experiment(stop=0.01)
    plant = system.component("plant", "plant").fmu.with_name("GripperPlantMovable.fmu")
    assert not sweep(system.swap("plant", plant), rows).errors
    assert grasp_system().start("sensor_1.diffusion_exponent") == pytest.approx(1.1506)
