"""What is said of this machine and of an FMU, sound or damaged, and that it is right."""

import dataclasses
import json
import shutil
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path
from shlex import quote

import fmpy
import pytest
from fmpy.fmi2 import FMU2Slave
from grasp_cosim.base.errors import InputError
from grasp_cosim.inspection import loading
from grasp_cosim.inspection.loading import Finding, unpack
from support import native_fmus
from support.marks import slow
from support.models import build_model

SCRIPT = """\
from pythonfmu import Fmi2Causality, Fmi2Slave, Real

class Stock(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.y = 0.0
        self.register_variable(Real("y", causality=Fmi2Causality.output))

    def do_step(self, current_time, step_size):
        return True
"""
LINUX64 = "binaries/linux64/Stock.so"
FMU_CHECKS = ["fmu", "binary", "script", "modules", "host", "libraries", "trial"]
MACHINE_CHECKS = ["python", "temp folder", "libpython", "python3", "environment"]

NATIVE = """\
static int model;
int lost(void);
void *fmi2Instantiate(void) { INSTANTIATE; return &model; }
"""
DESCRIPTION = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="{version}" modelName="N" guid="g">
  {kinds}
  <ModelVariables><ScalarVariable name="p" valueReference="0" causality="parameter"
    variability="fixed"><Real start="0"/></ScalarVariable></ModelVariables><ModelStructure/>
</fmiModelDescription>"""

gcc = pytest.mark.skipif(not shutil.which("gcc"), reason="needs gcc")


@pytest.fixture(scope="module")
def stock(tmp_path_factory):
    """An FMU as pythonfmu makes it; in a process of its own, as pythonfmu imports the script."""
    folder = tmp_path_factory.mktemp("stock")
    (folder / "Stock.py").write_text(SCRIPT)
    command = [sys.executable, "-m", "pythonfmu", "build", "-f", "Stock.py"]
    subprocess.run(command, cwd=folder, check=True, capture_output=True)
    return folder / "Stock.fmu"


def altered(fmu, target, changes):
    """A copy of an FMU in which the given files are replaced, added, or left out (None)."""
    with zipfile.ZipFile(fmu) as source, zipfile.ZipFile(target, "w") as copy:
        files = {name: source.read(name) for name in source.namelist()}
        for name, data in {**files, **changes}.items():
            if data is not None:
                copy.writestr(name, data)
    return target


@pytest.fixture
def opened(stock, tmp_path):
    """The stock FMU with changes, unpacked for a single check."""

    def open_(changes=None):
        folder = Path(tempfile.mkdtemp(dir=tmp_path))
        fmu = unpack(altered(stock, tmp_path / "altered.fmu", changes or {}), folder)
        return dataclasses.replace(fmu, linked=loading._linked(fmu.binary))

    return open_


def linked(fmu, folder):
    found = unpack(fmu, folder)
    return dataclasses.replace(found, linked=loading._linked(found.binary))


def status(verdict):
    assert verdict is not None
    return verdict[0]


def patched(fmu, offset, value):
    """The binary of an FMU with one byte of its ELF header replaced."""
    with zipfile.ZipFile(fmu) as archive:
        data = bytearray(archive.read(LINUX64))
    data[offset] = value
    return bytes(data)


def examine(fmu):
    return loading.examine(fmu, load=True)


def test_of_the_file_alone_nothing_is_run(fmus, monkeypatch):
    monkeypatch.setattr(loading, "_run", None)
    findings = loading.examine(fmus / "GripperPlant.fmu")
    assert [f.check for f in findings] == ["fmu", "binary", "script", "modules"]
    assert {f.status for f in findings} == {"ok"}


def test_our_fmu_loads_here(fmus):
    findings = examine(fmus / "GripperPlant.fmu")
    found = {f.check: f.status for f in findings}
    assert list(found) == MACHINE_CHECKS + FMU_CHECKS
    assert "problem" not in found.values()
    assert [name for name in FMU_CHECKS if found[name] != "ok"] == ["host"]
    fix = {f.check: f.fix for f in findings}["host"]
    assert fix
    assert "LD_PRELOAD=" in fix
    assert "grasp-cosim build --native" in fix


def test_a_stock_fmu_loads_here(stock):
    found = {f.check: f for f in examine(stock)}
    assert {f.status for f in found.values() if f.check in FMU_CHECKS} == {"ok", "warning"}
    assert found["trial"].status == "ok"
    assert "PythonFMU 0.7.0" in found["fmu"].text
    assert "grasp-cosim" not in (found["host"].fix or "")


def test_text_is_one_line_each_with_the_fix_below():
    findings = [Finding("a", "ok", "fine", None), Finding("b c", "problem", "broken", "mend it")]
    assert loading.as_text(findings, tried=True).splitlines() == [
        "loads on this machine: no",
        "ok       a            fine",
        "problem  b c          broken",
        "                      fix: mend it",
    ]


def test_json_has_four_keys():
    finding = Finding("a", "warning", "odd", "mend it")
    expected = {"check": "a", "status": "warning", "text": "odd", "fix": "mend it"}
    assert json.loads(json.dumps([dataclasses.asdict(finding)])) == [expected]


@pytest.mark.parametrize("name", ["a#b", "a+b", "a%b", "é", "a,b", "a:b", "(a)"])
def test_a_temporary_folder_that_crashes_python_fmus(name):
    verdict, text, fix = loading.temporary_folder(Path("/tmp", name), False, True)
    assert (verdict, fix) == ("problem", "export TMPDIR=/tmp")
    assert f"/tmp/{name}" in text
    assert status(loading.temporary_folder(Path("/tmp", name), False, False)) == "ok"


@pytest.mark.parametrize("name", ["a b", "a_b", "a-b.c~1"])
def test_a_temporary_folder_that_does_not(name):
    assert status(loading.temporary_folder(Path("/tmp", name), False, True)) == "ok"


@pytest.mark.parametrize("python", [False, True])
def test_a_temporary_folder_from_which_nothing_loads(python):
    assert status(loading.temporary_folder(Path("/tmp"), True, python)) == "problem"


def test_libpython_is_found(monkeypatch, tmp_path):
    listed = f"\t{loading.LIBPYTHON} (libc6,x86-64) => /lib/{loading.LIBPYTHON}\n\tlibz.so => /z\n"
    monkeypatch.setattr(sys, "base_prefix", str(tmp_path))
    monkeypatch.setattr(loading, "_run", lambda *_: (0, listed))
    assert loading.find_libpython() == f"/lib/{loading.LIBPYTHON}"
    monkeypatch.setattr(loading, "_run", lambda *_: (0, "\tlibz.so => /z\n"))
    assert loading.find_libpython() is None
    (tmp_path / "lib").mkdir()
    (tmp_path / "lib" / loading.LIBPYTHON).touch()
    assert loading.find_libpython() == str(tmp_path / "lib" / loading.LIBPYTHON)


def test_python3_on_the_path(tmp_path):
    assert status(loading.python_on_path(sys.executable)) == "ok"
    other = tmp_path / "python3"
    other.write_text("#!/bin/sh\necho 3.1.4\n")
    other.chmod(0o755)
    verdict, text, fix = loading.python_on_path(str(other))
    assert verdict == "warning"
    assert text.startswith("3.1.4 on the PATH")
    assert str(Path(sys.executable).parent) in (fix or "")
    for missing in (None, str(tmp_path / "none")):
        assert status(loading.python_on_path(missing)) == "warning"


def test_the_environment_of_another_python(tmp_path):
    folder = tmp_path / "python3.1"
    folder.mkdir()
    assert status(loading.environment({"PYTHONPATH": str(folder)})) == "warning"


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, "no such FMU file"),
        ({}, "not a readable FMU: no modelDescription.xml at the top of the archive"),
        ({"modelDescription.xml": "<fmi"}, "not a readable FMU: unclosed token"),
        ({"../x": ""}, "not a readable FMU"),
        ("text", "not a readable FMU: File is not a zip file"),
    ],
)
def test_no_fmu_is_wrong_input(content, message, tmp_path):
    fmu = tmp_path / "x.fmu"
    if isinstance(content, str):
        fmu.write_text(content)
    elif content is not None:
        with zipfile.ZipFile(fmu, "w") as archive:
            for name, data in content.items():
                archive.writestr(name, data)
    with pytest.raises(InputError) as error:
        examine(fmu)
    assert str(error.value).startswith(f"{fmu}: ")
    assert message in str(error.value)
    assert len(str(error.value).splitlines()) == 1


def test_a_folder_is_no_fmu(tmp_path):
    with pytest.raises(InputError, match="is a folder; must be an FMU"):
        examine(tmp_path)


@pytest.mark.parametrize(
    ("version", "kinds"),
    [
        ("3.0", '<ScheduledExecution modelIdentifier="N"/>'),
        ("2.0", ""),
        ("1.0", ""),
    ],
)
def test_an_fmu_of_another_kind_is_not_loaded(version, kinds, tmp_path):
    with zipfile.ZipFile(tmp_path / "n.fmu", "w") as archive:
        text = DESCRIPTION.format(version=version, kinds=kinds)
        if version == "3.0":
            text = text.replace('<Real start="0"/>', "").replace("ScalarVariable", "Float64")
        archive.writestr("modelDescription.xml", text)
        archive.writestr("binaries/x86_64-linux/N.so", Path(sys.executable).read_bytes()[:64])
    found = {f.check: f for f in examine(tmp_path / "n.fmu")}
    assert found["fmu"].status == "problem"
    assert f"FMI {version}" in found["fmu"].text
    assert "ask the vendor for an export as FMI 2.0 or 3.0" in (found["fmu"].fix or "")
    assert found["binary"].status == ("ok" if version == "3.0" else "problem")
    assert found["trial"].status == "warning"
    assert "not loaded" in found["trial"].text


@gcc
@pytest.mark.slow
@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_one_for_model_exchange_runs_here_by_a_solver(version, tmp_path):
    fmu = build_model("bouncing_ball", tmp_path, version, ("ModelExchange",))
    found = {f.check: f for f in examine(fmu)}
    checks = ("fmu", "binary", "libraries", "trial")
    assert {found[check].status for check in checks} == {"ok"}
    assert "run here by a solver, elsewhere ask the vendor" in found["fmu"].text


def test_both_kinds_are_a_cosimulation(tmp_path):
    kinds = '<ModelExchange modelIdentifier="M"/><CoSimulation modelIdentifier="C"/>'
    with zipfile.ZipFile(tmp_path / "n.fmu", "w") as archive:
        text = DESCRIPTION.format(version="2.0", kinds=kinds)
        archive.writestr("modelDescription.xml", text)
    fmu = unpack(tmp_path / "n.fmu", tmp_path)
    assert status(loading.description(fmu)) == "ok"
    assert fmu.binary.stem == "C"


def test_a_description_that_fmpy_refuses(opened):
    fmu = opened()
    file = fmu.folder / "modelDescription.xml"
    file.write_text(file.read_text().replace('causality="output"', 'causality="parameter"'))
    verdict, text, _ = loading.by_fmpy(fmu)
    assert verdict == "problem"
    assert 'illegal combination of causality="parameter" and variability="continuous"' in text
    assert len(text.splitlines()) == 1
    loaded = loading.by_fmpy(dataclasses.replace(fmu, loads=True))
    assert loaded[0] == "warning"  # this master reads it, and others may not


def test_no_binary_for_this_system(stock, tmp_path):
    fmu = altered(stock, tmp_path / "windows.fmu", {LINUX64: None})
    found = {f.check: f for f in examine(fmu)}
    assert found["binary"].status == "problem"
    assert found["binary"].text == "has a binary for win64 only; this machine: linux64"
    assert "pythonfmu 0.7.0" in (found["binary"].fix or "")
    assert "host" not in found
    assert "libraries" not in found
    assert found["trial"].status == "warning"


SOURCES = "<b><SourceFileSet><SourceFile name='N.c'/></SourceFileSet></b>"


@pytest.mark.parametrize(
    ("files", "expected", "text"),
    [
        ({}, None, ""),
        ({"N.c": ""}, "warning", "sources/ without buildDescription.xml"),
        ({"N.c": "", "buildDescription.xml": SOURCES}, "ok", "sources/N.c, to compile for other"),
        ({"M.c": "", "buildDescription.xml": SOURCES}, "problem", "names N.c, which is not there"),
        ({"N.c": "", "buildDescription.xml": "<b/>"}, "problem", "names none"),
        ({"N.c": "", "buildDescription.xml": "<b"}, "problem", "buildDescription.xml: unclosed"),
    ],
)
def test_sources_can_be_compiled(files, expected, text, opened):
    verdict = loading.sources(opened({f"sources/{n}": t.encode() for n, t in files.items()}))
    assert (verdict and verdict[0]) == expected
    assert text in (verdict[1] if verdict else "")


@gcc
@pytest.mark.parametrize("version", [slow("2.0"), "3.0"])
def test_a_native_fmu_of_either_version_is_tried(version, tmp_path):
    found = {
        f.check: f for f in examine(native_fmus.build(tmp_path, version=version, complete=True))
    }
    assert found["fmu"].status == found["binary"].status == found["trial"].status == "ok"
    assert "needs no Python" in found["fmu"].text
    ours = fmpy.platform_tuple if version == "3.0" else fmpy.platform
    assert f"there is: {ours}; this machine: {ours}" in found["binary"].text


def test_no_binary_but_sources(opened):
    fmu = opened({LINUX64: None, "sources/all.c": b""})
    assert "LDFLAGS=-Wl,--no-as-needed,-lm fmpy compile FMU" in (loading.binary(fmu)[2] or "")


@pytest.mark.parametrize(
    ("offset", "value", "text"),
    [
        (4, 1, "is x86-64, 32 bit; must be"),
        (18, 183, "is AArch64, 64 bit; must be"),
        (18, 200, "is ELF machine 200, 64 bit; must be"),
        (0, 0, "is no ELF file; must be"),
    ],
)
def test_a_binary_for_another_processor(offset, value, text, stock, opened):
    fmu = opened({LINUX64: patched(stock, offset, value)})
    verdict = loading.binary(fmu)
    assert verdict[0] == "problem"
    assert text in verdict[1]
    assert loading.trial(fmu)[0] == "warning"


LOADER = "\tlibc.so.6 => /lib/libc.so.6 (0x1)\n"
BOUND = "\tlibpython{} => {}\n" + LOADER


@pytest.mark.parametrize(
    ("linked", "text"),
    [
        ("\tlibm.so.9 => not found\n" + LOADER, "not found: libm.so.9"),
        ("x.so: /lib/libc.so.6: version `GLIBC_9.1' not found (required by x.so)\n" + LOADER,
         "not on this system: GLIBC_9.1"),
        (LOADER + "undefined symbol: gsl_sin\t(x.so)\n", "undefined symbols: gsl_sin"),
    ],
)  # fmt: skip
def test_libraries_that_are_missing(linked, text, opened):
    verdict = loading.libraries(dataclasses.replace(opened(), linked=linked))
    assert verdict is not None
    assert verdict[:2] == ("problem", text)


def test_libraries_besides_libpython_are_all_there(opened):
    linked = BOUND.format("9.so", "not found") + "undefined symbol: PyLong_AsLong\t(x.so)\n"
    assert status(loading.libraries(dataclasses.replace(opened(), linked=linked))) == "ok"
    assert loading.libraries(dataclasses.replace(opened(), linked="ldd: not found")) is None


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"resources/slavemodule.txt": None}, "resources/slavemodule.txt names none"),
        ({"resources/Stock.py": None}, "resources/slavemodule.txt names Stock"),
        ({"resources/Stock.py": b"class Stock(:"}, "invalid syntax (Stock.py, line 1)"),
        ({"resources/Stock.py": b"x = '\0'"}, "null bytes"),
        ({"resources/Stock.py": b"import a.b", "resources/a/b.py": b"\n1x"}, "b.py, line 2"),
    ],
)
def test_a_script_that_is_not_there_or_no_python(changes, text, opened):
    verdict = loading.script(opened(changes))
    assert verdict is not None
    assert verdict[0] == "problem"
    assert text in verdict[1]


def test_an_fmu_of_python_without_its_resources(stock, opened):
    with zipfile.ZipFile(stock) as archive:
        resources = [name for name in archive.namelist() if name.startswith("resources/")]
    assert status(loading.script(opened(dict.fromkeys(resources)))) == "problem"


@pytest.mark.parametrize(
    ("files", "missing"),
    [
        ({"Stock": "import nope.x"}, "nope"),
        ({"Stock": "from nope.x import y, z"}, "nope"),
        ({"Stock": "class A:\n import nope"}, "nope"),
        ({"Stock": "import a", "a": "import b", "b": "import nope"}, "nope"),
        ({"Stock": "import a.b", "a/__init__": "import nope", "a/b": ""}, "nope"),
        ({"Stock": "from a import b", "a/__init__": "", "a/b": "import nope"}, "nope"),
        ({"Stock": "import a", "a/__init__": "from . import b", "a/b": "import nope"}, "nope"),
        ({"Stock": "import a", "a/__init__": "from .b import c", "a/b": "import nope"}, "nope"),
        ({"Stock": "import a.b.c", "a/b/c": "from .. import d", "a/d": "import nope"}, "nope"),
        ({"Stock": "import nope, yaml_"}, "nope, yaml_"),
        ({"Stock": "try:\n import nope\nexcept ImportError: pass"}, None),
        ({"Stock": "from typing import *\nif TYPE_CHECKING:\n import nope"}, None),
        ({"Stock": "def f():\n import nope"}, None),
        ({"Stock": "import a", "a": "", "b": "import nope", "c": "no python"}, None),
        ({"Stock": "import a", "a/__init__": "", "a/b": "import nope"}, None),
        ({"Stock": "import a.b", "a/b": "from a import b"}, None),
        ({"Stock": "import math, numpy.linalg, xml.etree, __future__"}, None),
        ({"Stock": "'\\d'"}, None),
    ],
)
def test_what_a_script_imports_is_packed_or_installed(files, missing, opened):
    changes = {f"resources/{name}.py": text.encode() for name, text in files.items()}
    verdict = loading.script(opened({**changes}))
    assert verdict is not None
    if missing is None:
        assert verdict[0] == "ok"
    else:
        assert verdict[0] == "problem"
        assert verdict[1].endswith(f"neither packed nor installed: {missing}")
        names = missing.replace(",", "")
        assert verdict[2] == f"{quote(sys.executable)} -m pip install {names}"


def test_an_extension_module_may_be_packed(opened):
    changes = {"resources/Stock.py": b"import fast", "resources/fast.abi3.so": b""}
    assert status(loading.script(opened({**changes}))) == "ok"


def test_what_is_imported_is_named(opened):
    verdict = loading.script(opened({"resources/Stock.py": b"import numpy, math"}))
    assert verdict is not None
    assert verdict[1] == "resources/Stock.py imports, besides the standard library: numpy"


@pytest.mark.slow
def test_a_temporary_folder_that_crashes_is_predicted_and_found(stock, unpack_in):
    folder = unpack_in("a#b")
    found = {f.check: f for f in examine(stock)}
    assert found["temp folder"].status == found["trial"].status == "problem"
    assert "a Python FMU crashes on its characters" in found["trial"].text
    assert list(folder.iterdir()) == []


@pytest.mark.parametrize(
    ("script", "text"),
    [
        ("import nope\n" + SCRIPT, "does not instantiate: ModuleNotFoundError("),
        (SCRIPT.replace("self.y = 0.0", "raise OSError('no disk')"), "OSError('no disk')"),
        ("import atexit, os\natexit.register(os.abort)\n" + SCRIPT,
         "crashes with SIGABRT after it was freed"),
        ("import os\nos._exit(0)\n" + SCRIPT, "does not instantiate: no reason given"),
    ],
)  # fmt: skip
def test_a_trial_that_fails(script, text, opened):
    verdict = loading.trial(opened({"resources/Stock.py": script.encode()}))
    assert verdict[0] == "problem"
    assert text in verdict[1]


@pytest.mark.slow
def test_a_trial_that_does_not_end(opened):
    script = b"import os, time\nopen('pid', 'w').write(str(os.getpid()))\ntime.sleep(60)\n"
    fmu = opened({"resources/Stock.py": script})
    assert loading.trial(fmu, timeout=2.0)[1] == "does not load and instantiate within 2 s"
    pid = fmu.folder / "pid"
    assert not pid.exists() or not Path("/proc", pid.read_text()).exists()


def native(folder, instantiate="", options=()):
    """A native FMU, compiled here."""
    others = {f for f in dir(FMU2Slave) if f.startswith("fmi2")} - {"fmi2Instantiate"}
    code = [NATIVE.replace("INSTANTIATE", instantiate), *(f"void {f}(void) {{}}" for f in others)]
    (folder / "n.c").write_text("\n".join(code))
    command = ["gcc", "-shared", "-fPIC", "-w", "-o", "n.so", "n.c", *options]
    subprocess.run(command, cwd=folder, check=True)
    with zipfile.ZipFile(folder / "n.fmu", "w") as archive:
        kinds = '<CoSimulation modelIdentifier="N"/>'
        text = DESCRIPTION.format(version="2.0", kinds=kinds)
        archive.writestr("modelDescription.xml", text)
        archive.write(folder / "n.so", "binaries/linux64/N.so")
    return folder / "n.fmu"


@gcc
def test_a_native_fmu_loads_here(tmp_path):
    found = {f.check: f for f in examine(native(tmp_path))}
    checks = ["python", "temp folder", "fmu", "binary", "libraries", "trial"]
    assert [name for name in found if name in checks] == checks
    assert {f.status for f in found.values()} == {"ok"}
    assert "native" in found["fmu"].text


@gcc
def test_a_native_fmu_that_crashes(tmp_path):
    found = {f.check: f for f in examine(native(tmp_path, "*(volatile int *)0 = 1"))}
    assert found["trial"].text == "crashes with SIGSEGV when instantiated; it says nothing"


@gcc
def test_a_native_fmu_without_a_library(tmp_path):
    (tmp_path / "lost.c").write_text("int lost(void) { return 1; }")
    command = ["gcc", "-shared", "-fPIC", "-o", "liblost.so", "lost.c"]
    subprocess.run(command, cwd=tmp_path, check=True)
    fmu = native(tmp_path, "return lost() ? &model : 0", ("-L.", "-llost"))
    found = {f.check: f for f in examine(fmu)}
    assert found["libraries"].text == "not found: liblost.so"
    assert found["trial"].text.startswith(
        "does not instantiate: Failed to load shared library binaries/linux64/N.so. liblost.so: "
    )
    packed = altered(fmu, tmp_path / "packed.fmu", {"binaries/linux64/liblost.so": b""})
    (tmp_path / "unpacked").mkdir()
    verdict = loading.libraries(linked(packed, tmp_path / "unpacked"))
    assert verdict is not None
    assert verdict[1] == "not found though packed: liblost.so"
    assert "$ORIGIN" in (verdict[2] or "")
