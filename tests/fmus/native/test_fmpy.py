"""FMPy reads, validates, compiles and simulates native FMUs of both versions, to the last bit."""

import os
import shutil
import sysconfig

import pytest
from fmpy import simulate_fmu
from fmpy.build import build_platform_binary
from fmpy.util import read_csv, read_ref_opt_file
from fmpy.validation import validate_fmu
from grasp_cosim.fmu_export.build import planned
from grasp_cosim.fmu_export.description import Description
from grasp_cosim.fmu_export.proxy import Settings, build_proxy
from support.kinds import TRANSLATED
from support.marks import platforms, slow
from support.native_fmus import needs_gcc
from support.scripted_peer import VARIABLES, ScriptedPeer

BOTH = [(name, 2) for name in TRANSLATED] + [slow(name, 3) for name in TRANSLATED]

PROGRAMS = os.pathsep.join([sysconfig.get_path("scripts"), os.environ["PATH"]])
"""Where they are looked for; CMake is installed with FMPy."""

pytestmark = needs_gcc


@pytest.fixture
def fmu(folder_of, name, fmi):
    """A native FMU of one of the versions."""
    return folder_of("native" if fmi == 2 else "native FMI 3") / f"{name}.fmu"


def assert_gives_the_reference(fmu, folder, name):
    """Run by FMPy with the options and inputs in the folder, every output is that of the block."""
    options = read_ref_opt_file(folder / f"{name}_ref.opt")
    result = simulate_fmu(
        fmu,
        start_time=options["StartTime"],
        stop_time=options["StopTime"],
        output_interval=options["StepSize"],
        input=read_csv(folder / f"{name}_in.csv"),
    )
    reference = read_csv(folder / f"{name}_ref.csv")
    assert len(reference) == 769
    assert set(result.dtype.names) >= set(reference.dtype.names)
    for column in reference.dtype.names:
        assert result[column].astype(float).tobytes() == reference[column].tobytes(), column


@pytest.mark.parametrize(("name", "fmi"), BOTH)
def test_it_is_valid(fmu):
    assert validate_fmu(fmu) == []


@pytest.mark.parametrize(("name", "fmi"), BOTH)
def test_it_gives_the_cross_check_reference(fmu):
    assert_gives_the_reference(fmu, fmu.parent, fmu.stem)


@pytest.mark.slow
@pytest.mark.skipif(not shutil.which("cmake", path=PROGRAMS), reason="NO cmake")
@pytest.mark.parametrize(
    ("name", "fmi"),
    [(name, fmi) if (name, fmi) == ("ProximitySensor", 2) else platforms(name, fmi)
     for name in TRANSLATED for fmi in (2, 3)],
)  # fmt: skip
def test_fmpy_compiles_its_sources(fmu, tmp_path, monkeypatch):
    """Without its binary, with another made by CMake: the same bits."""
    monkeypatch.setenv("PATH", PROGRAMS)
    folder, made = tmp_path / "fmu", tmp_path / "made"
    made.mkdir()
    shutil.unpack_archive(fmu, folder, "zip")
    shutil.rmtree(folder / "binaries")
    build_platform_binary(folder, made)
    assert [*folder.glob("binaries/*/*")]
    assert_gives_the_reference(folder, fmu.parent, fmu.stem)


@pytest.mark.slow
@pytest.mark.skipif(not shutil.which("cmake", path=PROGRAMS), reason="NO cmake")
@pytest.mark.parametrize("fmi", [2, platforms(3)])
def test_fmpy_compiles_the_sources_of_a_proxy(fmi, tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", PROGRAMS)
    folder, made = tmp_path / "fmu", tmp_path / "made"
    made.mkdir()
    with ScriptedPeer() as peer:
        original = Description("Original.fmu", "", VARIABLES, {})
        settings = Settings(port=peer.port, timeout=60.0)
        fmu = build_proxy(tmp_path / "P.fmu", original, planned(fmi=fmi), settings).path
        shutil.unpack_archive(fmu, folder, "zip")
        shutil.rmtree(folder / "binaries")
        build_platform_binary(folder, made)
        result = simulate_fmu(
            folder, stop_time=1.0, output_interval=0.125, start_values={"force": 3.0},
            output=["doubled"],
        )  # fmt: skip
    assert set(result["doubled"]) == {6.0}
    assert len(result) == 9
