"""The core is a core: a system that is no grasp goes all the way where there is no grasp.

In a process in which nothing below grasp_cosim.grasp can be imported, as if it were deleted.
"""

import json
import subprocess
import sys
import textwrap

import pytest
from support.native_fmus import needs_gcc
from support.native_systems import write_oscillator

pytestmark = needs_gcc

WITHOUT = """
import sys
from importlib.machinery import PathFinder

class Deleted(PathFinder):
    @classmethod
    def find_spec(cls, name, path=None, target=None):
        if f"{name}.".startswith("grasp_cosim.grasp."):
            return None
        return super().find_spec(name, path, target)

sys.meta_path[:] = [Deleted if f is PathFinder else f for f in sys.meta_path]
"""
"""As if the folder were deleted: find_spec() finds nothing, to import it is a ModuleNotFoundError.

The finder that reads folders is replaced; those of editable installs find top-level packages only.
"""

METRICS = """
from math import hypot

from grasp_cosim import metric


@metric("amplitude", unit="m", description="of the oscillation")
def amplitude(run):
    return hypot(run["left.x"][-1], 1.0 - run["right.x"][-1])
"""

ROLES = '[roles]\nleft = "a"\nright = "b"\n[presets.twice]\n"a.gain" = 2.0\n'


@pytest.fixture
def folder(tmp_path):
    """The oscillator with roles and a preset, and a file of metrics."""
    write_oscillator(tmp_path, ROLES)
    (tmp_path / "mine.py").write_text(METRICS)
    return tmp_path


@pytest.fixture
def python(folder):
    """Runs a program in the folder, in a process without a grasp; what it prints.

    Its own processes have no grasp either: they are started by the same file.
    """

    return lambda program: _output(folder, program)


@pytest.fixture
def command(folder):
    """Runs a command line in the folder, in a process without a grasp; what it prints."""
    program = "from grasp_cosim.cli import entry\n\nentry()"
    return lambda *arguments: _output(folder, program, *arguments)


def _output(folder, program, *arguments):
    path = folder / "program.py"
    body = textwrap.indent(textwrap.dedent(program), "    ")
    path.write_text(f"{WITHOUT}\nif __name__ == '__main__':\n{body}\n")
    command = [sys.executable, "-B", str(path), *arguments]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_there_is_no_grasp_in_these_processes(python):
    """Or the others would show nothing."""
    python(
        """
        from importlib.util import find_spec

        import grasp_cosim

        for name in ("grasp", "grasp.metrics", "grasp.system"):
            try:
                __import__(f"grasp_cosim.{name}")
            except ModuleNotFoundError as error:
                assert error.name.startswith("grasp_cosim.grasp")
            else:
                raise AssertionError(name)
        assert find_spec("grasp_cosim.grasp") is None
        assert find_spec("grasp_cosim.metrics.metric") is not None
        """
    )


@pytest.mark.slow
def test_every_other_module_can_be_imported(python):
    """Those of the commands of a grasp cannot: its figures, its friction."""
    printed = python(
        """
        import pkgutil

        import grasp_cosim

        refused = []
        for module in pkgutil.walk_packages(grasp_cosim.__path__, "grasp_cosim."):
            above = ("grasp_cosim.grasp.", "grasp_cosim.hand.", "grasp_cosim.tandem.")
            if f"{module.name}.".startswith(above):
                continue
            if module.name.endswith("__main__"):
                continue
            try:
                __import__(module.name)
            except ModuleNotFoundError as error:
                assert error.name.startswith("grasp_cosim.grasp"), module.name
                refused.append(module.name)
        print(" ".join(refused))
        """
    )
    assert printed.split() == ["grasp_cosim.cli.paper"]


def test_the_help_has_the_commands_of_any_system(command):
    listed = command("--help").partition("Simulate:\n")[2].splitlines()
    assert sorted(line.split()[0] for line in listed if line.startswith("  ")) == [
        "build", "compare", "diff", "init", "inspect", "proxy", "qualify", "relay", "report",
        "run", "serve", "ssp", "sweep",
    ]  # fmt: skip
    assert "Default: fmus/build" in command("build", "--help")


@pytest.mark.slow
def test_a_run_is_written_read_back_drawn_and_reported(python, folder):
    python(
        """
        from math import hypot
        from pathlib import Path

        from grasp_cosim import System, load_run, simulate
        from grasp_cosim.metrics.metric import load_metrics
        from grasp_cosim.report.run_report import write_page

        system = System.load("oscillator.toml")
        result = simulate(system, metrics=load_metrics(Path("mine.py")))
        amplitude = hypot(result["a.x"][-1], 1.0 - result["b.x"][-1])
        assert abs(amplitude - 1.0) < 0.01
        assert result.metrics["amplitude"] == amplitude
        assert result.measured.missing == ()
        assert result.metric_units["amplitude"] == "m"
        result.to_csv("signals.csv")
        result.to_json("run.json")
        back = load_run(".")
        assert back.metrics == result.metrics
        assert back.metric_units == result.metric_units
        assert back.roles == {"left": "a", "right": "b"}
        back.plot("signals.png")
        write_page(back, Path("page.html"))
        """
    )
    assert (folder / "signals.png").read_bytes().startswith(b"\x89PNG")
    page = (folder / "page.html").read_text("utf-8")
    assert "amplitude" in page
    assert "a.x" in page


@pytest.mark.slow
def test_the_commands_of_any_system_do_without(command, folder):
    options = ("--metrics", "mine.py", "--json")
    ran = json.loads(
        command("run", "oscillator.toml", "--preset", "twice", "--out", "out", "--plot", *options)
    )
    assert (ran["units"]["amplitude"], ran["complete"]) == ("m", True)
    assert (folder / "out/signals.png").exists()
    command("report", "out", "--out", "page.html")
    assert "amplitude" in (folder / "page.html").read_text("utf-8")
    vary = ("--vary", "experiment.step=0.01,0.02,0.04")
    swept = json.loads(command("sweep", "oscillator.toml", *vary, "--workers", "2", *options))
    assert 0.9 < swept["convergence"]["amplitude"]["order"] < 1.1
    judged = json.loads(
        command("qualify", "integrator.fmu", "--as", "b", "--system", "oscillator.toml", *options)
    )
    assert (judged["qualified"], judged["metrics"][0]["name"]) == (True, "amplitude")
    command("ssp", "oscillator.toml", "-o", "oscillator.ssp")
    runs = [json.loads(command("run", f"oscillator.{form}", *options)) for form in ("toml", "ssp")]
    assert runs[0]["amplitude"] == runs[1]["amplitude"]
