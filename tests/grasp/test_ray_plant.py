"""A plant whose sensors' rays hit nothing at first is grasped as any other."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from grasp_cosim import load_run
from support.marks import needs_pythonfmu

pytestmark = [needs_pythonfmu, pytest.mark.slow]

APART = "components.plant.isolation=process"  # pythonfmu's FMUs share the modules of a process

SCRIPT = """\
from gripper_plant import rigid
from pythonfmu import Boolean, Fmi2Causality, Fmi2Slave, Real

REACH, NOTHING = 0.06, float("{nothing}")


class RayPlant(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.p = rigid.Params()
        self.force = [0.0, 0.0]
        self.x = rigid.initial_state(self.p, rigid.Inputs())
        for j in (0, 1):
            self.register_variable(Real(
                f"force[{{j + 1}}]", causality=Fmi2Causality.input, start=0.0,
                getter=lambda j=j: self.force[j],
                setter=lambda value, j=j: self.force.__setitem__(j, value),
            ))
            for name in ("position", "velocity", "contact_force"):
                self.put(Real, f"{{name}}[{{j + 1}}]", lambda n=name, j=j: getattr(self.y(), n)[j])
            self.put(Real, f"gap[{{j + 1}}]", lambda j=j: self.seen(self.y().gap[j]))
            self.put(Boolean, f"contact[{{j + 1}}]", lambda j=j: self.y().contact[j])
        self.put(Real, "object_position", lambda: self.y().object_position)

    def put(self, kind, name, getter):
        self.register_variable(kind(name, causality=Fmi2Causality.output, getter=getter))

    def y(self):
        return rigid.outputs(self.p, self.x, rigid.Inputs(tuple(self.force)))

    def seen(self, gap):
        return gap if gap < REACH else NOTHING

    def do_step(self, time, h):
        self.x = rigid.step(self.p, self.x, rigid.Inputs(tuple(self.force)), h)
        return True
"""


@pytest.fixture
def ray_plant(tmp_path):
    """The plant, which says `nothing` where a ray hits nothing."""

    def build(nothing):
        (tmp_path / "RayPlant.py").write_text(SCRIPT.format(nothing=nothing))
        command = [sys.executable, "-m", "pythonfmu", "build", "-f", "RayPlant.py"]
        subprocess.run(command, cwd=tmp_path, check=True, capture_output=True)
        return tmp_path / "RayPlant.fmu"

    return build


@pytest.mark.parametrize("kind", ["--python", "--native"])
@pytest.mark.parametrize("nothing", ["inf", "1.7976931348623157e308"])
def test_it_runs_to_the_end_and_can_be_looked_at(command, ray_plant, nothing, kind):
    swap = f"plant={ray_plant(nothing)}"
    more = ("--out", "out", "--plot", "--json", kind)
    code, out, _ = command("run", "--step", "1e-3", "--swap", swap, "--set", APART, *more)
    assert code == 0
    metrics = json.loads(out, parse_constant=pytest.fail)
    assert metrics["time_difference"] < 0.01  # as GripperPlant
    assert max(metrics["impact_velocity"]) < 7e-3
    run = load_run(Path("out"))
    unseen = run["plant.gap[2]"] == float(nothing)
    assert 100 < unseen.sum() < 300
    assert set(run["sensor_2.intensity"][unseen]) == {0.0}
    assert command("report", "out")[0] == 0
    assert command("compare", "out", "out")[0] == 0


def test_a_ray_that_says_minus_one_is_refused(command, ray_plant):
    swap = f"plant={ray_plant('-1')}"
    code, _, err = command("run", "--step", "1e-3", "--swap", swap, "--set", APART)
    assert code == 2
    assert "sensor_2: ProximitySensor.fmu " in err
    assert "gap = -1.0 m: must be from -0.005 m on" in err
