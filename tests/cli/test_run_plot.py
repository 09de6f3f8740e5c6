"""run --plot: a picture of the grasp, one of the timing of a run in real time, or both."""

import sys

import pytest
from support.marks import slow


@pytest.fixture(autouse=True)
def sensor_toml(tmp_path, fmus):
    """A system that is no grasp."""
    (tmp_path / "sensor.toml").write_text(
        "[experiment]\nstep = 1e-3\nstop = 0.02\n"
        f'[components.sensor]\nfmu = "{fmus / "ProximitySensor.fmu"}"\nvalues = {{ gap = 0.02 }}\n'
    )


@pytest.mark.parametrize(
    ("arguments", "pictures"),
    [
        (["--step", "1e-3", "--stop", "0.02"], ["grasp.png"]),
        slow(["--step", "1e-3", "--stop", "0.02", "--realtime"], ["grasp.png", "timing.png"]),
        (["sensor.toml"], ["signals.png"]),
        slow(["sensor.toml", "--realtime"], ["signals.png", "timing.png"]),
    ],
)
def test_what_there_is_to_draw_is_drawn(arguments, pictures, command, tmp_path):
    code, _, err = command("run", *arguments, "--plot", "--out", "results")
    assert code == 0
    assert sorted(p.name for p in (tmp_path / "results").glob("*.png")) == pictures
    for name in pictures:
        assert (tmp_path / "results" / name).read_bytes().startswith(b"\x89PNG")
        assert f"drew results/{name}\n" in err


@pytest.mark.slow
def test_the_timing_goes_to_the_current_folder_without_out(command, tmp_path):
    assert command("run", "sensor.toml", "--realtime", "--plot")[0] == 0
    found = sorted(p.name for p in tmp_path.iterdir())
    assert found == ["sensor.toml", "signals.png", "timing.png"]


def test_without_matplotlib_a_run_in_real_time_is_refused_at_once(command, monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    code, _, err = command("run", "sensor.toml", "--realtime", "--plot", "--out", "results")
    assert code == 2
    assert "matplotlib is not installed" in err
    assert not (tmp_path / "results").exists()


@pytest.mark.slow
def test_a_run_that_stops_at_an_overrun_is_drawn_as_far_as_it_got(command, tmp_path):
    paced = "--realtime --set realtime.factor=1e5 --set realtime.overrun=stop --plot --out results"
    assert command("run", "sensor.toml", *paced.split())[0] == 3
    assert (tmp_path / "results/timing.png").read_bytes().startswith(b"\x89PNG")
