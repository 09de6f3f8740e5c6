"""Native FMUs for Windows, under wine, and for ARM, under qemu, in a host that is not ours."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import fmpy
import pytest
from c_compilers import environment as of_compiler
from grasp_fmus.build import build_native, compiler_for, planned
from grasp_fmus.native.targets import LINUX_ARM, LINUX_X86, WINDOWS, Target
from support.compilers import needs_zig
from support.fmi2 import read_members

HOST = Path(__file__).with_name("platform_host.c")
ARM = Path("/usr/aarch64-linux-gnu")
ENDING = {LINUX_X86: "", LINUX_ARM: "", WINDOWS: ".exe"}

pytestmark = [needs_zig, pytest.mark.platforms]

Ends = list[list[float]]
"""Status and two outputs at both ends."""


@pytest.fixture(scope="module", params=["GraspController", "GraspControllerAdaptive"])
def name(request: pytest.FixtureRequest) -> str:
    """Both controllers, which have the same inputs and first outputs."""
    return str(request.param)


@pytest.fixture(scope="module")
def fmu(name: str, tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """The files in an FMU with a binary for each."""
    plan = planned([LINUX_X86, LINUX_ARM, WINDOWS])
    (built,) = build_native(tmp_path_factory.mktemp("fmu"), plan, [name])
    return read_members(built.path)


def ends(fmu: dict[str, bytes], target: Target, folder: Path, *emulator: str) -> Ends:
    """What the host prints, which is compiled for the target and run by its emulator."""
    (name,) = {Path(file).stem for file in fmu if file.startswith("binaries/")}
    host = f"host{ENDING[target]}"
    zig = compiler_for(target, asked=True)
    headers = Path(fmpy.__file__).parent / "c-code"
    command = [*zig.command, "-w", "-ffp-contract=off", "-I", str(headers), "-o", host, str(HOST)]
    subprocess.run(command, cwd=folder, check=True, env=of_compiler(folder))
    place = target.tuple if target == LINUX_ARM else target.folder
    binary = folder / f"fmu{target.suffix}"
    binary.write_bytes(fmu[f"binaries/{place}/{name}{target.suffix}"])
    guid = re.search(rb'guid="(\w+)"', fmu["modelDescription.xml"])
    assert guid
    run = [*emulator, f"./{host}", f"./{binary.name}", guid[1].decode()]
    environment = {
        **os.environ, "WINEDEBUG": "-all", "WINEPREFIX": str(Path(sys.prefix, "wine_of_the_tests")),
    }  # fmt: skip
    said = subprocess.run(
        run, cwd=folder, env=environment, stdout=subprocess.PIPE, check=True, timeout=300
    )
    return [[float(word) for word in line.split()] for line in said.stdout.splitlines()]


@pytest.fixture(scope="module")
def here(fmu: dict[str, bytes], tmp_path_factory: pytest.TempPathFactory) -> Ends:
    """Those on this machine: no call fails, and a restored state goes on as it did."""
    found = ends(fmu, LINUX_X86, tmp_path_factory.mktemp("here"))
    first, second = found
    assert first == second
    assert first[0] == 0
    assert all(first[1:])
    return found


@pytest.mark.skipif(
    not (shutil.which("qemu-aarch64") and ARM.exists()), reason="NO qemu-aarch64 with a libc"
)
def test_on_arm_the_same_bits(fmu: dict[str, bytes], here: Ends, tmp_path: Path) -> None:
    assert ends(fmu, LINUX_ARM, tmp_path, "qemu-aarch64", "-L", str(ARM)) == here


@pytest.mark.skipif(not shutil.which("wine"), reason="NO wine")
def test_on_windows_the_same_but_for_the_last_digits(
    fmu: dict[str, bytes], here: Ends, tmp_path: Path
) -> None:
    found = ends(fmu, WINDOWS, tmp_path, "wine")
    assert found[0] == found[1]
    assert found[0] == pytest.approx(here[0], rel=1e-12)
