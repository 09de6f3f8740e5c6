"""What a command loads before it does anything: nothing that only others need."""

import subprocess
import sys

from support.native_systems import write_oscillator

OF_FEW = (
    "tqdm", "attrs", "fmpy.model_description", "importlib.metadata", "multiprocessing.connection",
    "lxml", "pyarrow", "matplotlib", "scipy", "grasp_cosim.report.run_report", "grasp_cosim.ssp",
)  # fmt: skip
OF_RUNS = "numpy", "fmpy", "grasp_cosim.master"


def loaded(*arguments):
    """Which of these modules are loaded after a command."""
    program = (
        f"import sys; from grasp_cosim.cli.entry import main; main({[*arguments]}); "
        f"print([m for m in {(*OF_FEW, *OF_RUNS)} if m in sys.modules], file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", program], check=True, capture_output=True)
    return eval(done.stderr.splitlines()[-1])


def test_a_run_loads_what_it_uses(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_oscillator(tmp_path, "")
    assert loaded("run", "oscillator.toml", "--stop", "0.01") == [*OF_RUNS]


def test_the_version_loads_no_numbers():
    assert loaded("--version") == ["importlib.metadata"]
