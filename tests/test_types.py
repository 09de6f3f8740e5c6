"""What a type checker knows of a user's script: mypy is one of several, and strict."""

import re
import subprocess
import sys

import pytest

SCRIPT = """\
import grasp_cosim
from grasp_cosim import System, compare, grasp_system, qualify, simulate, sweep

system = grasp_system().with_values({"plant.object_width": 0.06})
reveal_type(system)  # System
reveal_type(System.load("grasp.toml"))  # System
result = simulate(system, stop=3.0)
reveal_type(result.metrics["time_to_contact"])  # float | bool | None | list[float | bool | None]
reveal_type(result.metrics["wall_time"])  # float | None
reveal_type(result.metrics["scheme"])  # str
reveal_type(result["plant.gap[1]"])  # ndarray
with simulate.session(system) as session:
    reveal_type(session["plant.gap[1]"])  # float
    reveal_type(session.text("plant.state"))  # str
    reveal_type(session.step())  # bool
    reveal_type(session.result())  # Result
class Push:
    def step(self, t: float, inputs: dict[str, float]) -> dict[str, float]:
        return {"force": 2.0 * inputs["gap"]}
own = System(
    components={"plant": "Plant.fmu", "push": Push, "pull": lambda t, inputs: inputs["gap"]},
    connections=["push.force -> plant.force", ("plant.gap", "push.gap")],
    experiment={"step": 1e-3, "stop": 1.0},
)
reveal_type(own)  # System
reveal_type(own.parameters["plant.mass"].unit)  # str | None
table = sweep(system, {"plant.object_width": [0.05, 0.06]})
reveal_type(table["plant.object_width"])  # ndarray
reveal_type(compare(result, "other/").alike)  # bool
reveal_type(qualify(system, "plant", "other.fmu").qualified)  # bool
reveal_type(grasp_cosim.__version__)  # str
"""


@pytest.fixture(scope="module")
def checked(tmp_path_factory):
    """Of a script what mypy says, without the places."""
    folder = tmp_path_factory.mktemp("typed")

    def check(text):
        (folder / "script.py").write_text(text)
        command = [sys.executable, "-m", "mypy", "--strict", "--cache-dir", "cache", "script.py"]
        said = subprocess.run(command, cwd=folder, capture_output=True, text=True).stdout
        return [re.sub(r"^script\.py:\d+: ", "", line) for line in said.splitlines()]

    return check


@pytest.mark.slow
def test_what_a_user_gets_has_a_type(checked):
    wanted = re.findall(r"reveal_type.*  # (.*)", SCRIPT)
    *said, end = checked(SCRIPT)
    assert end == "Success: no issues found in 1 source file"
    found = [re.search('is "(.*)"', line)[1] for line in said]
    assert [re.sub(r"[\w.]*\.(?=\w)|(?<=ndarray).*", "", text) for text in found] == wanted


@pytest.mark.slow
def test_a_name_that_is_not_there_is_found(checked):
    first, *_ = checked("import grasp_cosim\ngrasp_cosim.simulat\n")
    assert first.startswith('error: Module has no attribute "simulat"')


@pytest.mark.slow
def test_a_misspelt_argument_is_found_of_a_run_and_of_a_session(checked):
    script = "from grasp_cosim import simulate\nsimulate('a.toml', stopp=1.0)\n"
    script += "simulate.session('a.toml', until=None)\n"
    of_run, of_session, *_ = [line for line in checked(script) if line.startswith("error")]
    assert of_run.startswith('error: Unexpected keyword argument "stopp"')
    assert of_session.startswith('error: Unexpected keyword argument "until" for "Session"')
