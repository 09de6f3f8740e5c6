"""Where the FMUs can be run."""

import fmpy
import pytest
from grasp_cosim.interface.obstacles import this_platform

needs_pythonfmu = pytest.mark.skipif(
    this_platform("2.0") != "linux64", reason="NO binary of pythonfmu for this machine"
)
"""On what calls an FMU that runs in Python, and not the native twin in its place."""


def skip_without_pythonfmu():
    """Skip a test that calls an FMU that runs in Python."""
    if needs_pythonfmu.args[0]:
        pytest.skip(needs_pythonfmu.kwargs["reason"])


def skip_where_fmpy_runs_none(version):
    """Skip a test in which FMPy simulates an FMU of that version of FMI."""
    if version == "3.0" and fmpy.architecture != "x86_64":
        pytest.skip(f"FMPy simulates no FMI 3.0 on {fmpy.architecture}")
