"""Which tests run when and where: slow ones, for other tools, in both engines, how often."""

import importlib.util

import fmpy
import pytest
from grasp_cosim.interface.obstacles import this_platform
from grasp_cosim.master.engine import has_compiler
from hypothesis import settings

needs_zig = pytest.mark.skipif(not importlib.util.find_spec("ziglang"), reason="NO ziglang")
needs_compiler = pytest.mark.skipif(not has_compiler(), reason="there is no C compiler")

ENGINES = ["python", pytest.param("compiled", marks=needs_compiler)]
engines = pytest.mark.parametrize("engine", ENGINES)

USUAL = 100
"""Examples of a property that asks for no other count, four times those of `make test`."""


def slow(*values):
    """A case that only `make test-slow` runs."""
    return pytest.param(*values, marks=pytest.mark.slow)


def platforms(*values):
    """A case that only `make platforms` runs."""
    return pytest.param(*values, marks=pytest.mark.platforms)


def interop(*values):
    """A case that only `make interop` runs."""
    return pytest.param(*values, marks=pytest.mark.interop)


def examples(count=USUAL, **more):
    """The settings of a test with `count` examples, as many times more as the profile has."""
    return settings(max_examples=max(1, count * settings().max_examples // USUAL), **more)


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


first_seed = 0
"""Where seeds begin: what --hypothesis-seed says, see conftest.py."""


def exploring():
    """Whether this is `make explore`."""
    return settings.get_current_profile_name() == "explore"


def part(whole):
    """How much of a campaign that many large is done."""
    return whole if exploring() else -(-whole // 10)


def seeds(whole):
    """The seeds of a campaign with that many: the same ones in each run of the slow tests."""
    return range(first_seed, first_seed + part(whole))


def only_whole(why):
    """For what cannot be done in part, and takes longer than all slow tests may."""
    return pytest.mark.skipif(not exploring(), reason=f"{why}: make explore")
