"""What is said of this machine and of an FMU, sound or damaged, and that it is right."""

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from shlex import quote

import fmpy
import pytest
from grasp_cosim.inspection import loading
from grasp_cosim.inspection.loading import Finding, unpack
from ssp.hand_made import described, entries_of, zipped
from support import native_fmus
from support.marks import slow

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
FMU_CHECKS = ["fmu", "binary", "script", "host", "libraries", "trial"]

DESCRIPTION = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="N" guid="g">
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
    files = entries_of(fmu) | changes
    return zipped(target, {name: data for name, data in files.items() if data is not None})


@pytest.fixture
def opened(stock, tmp_path):
    """The stock FMU with changes, unpacked for a single check."""

    def open_(changes=None):
        folder = Path(tempfile.mkdtemp(dir=tmp_path))
        return unpack(altered(stock, tmp_path / "altered.fmu", changes or {}), folder)

    return open_


def examined(fmu):
    return {f.check: f for f in loading.examine(fmu, load=True)}


def test_of_the_file_alone_nothing_is_run(fmus, monkeypatch):
    monkeypatch.setattr(loading, "_run", None)
    findings = loading.examine(fmus / "GripperPlant.fmu")
    assert [f.check for f in findings] == ["fmu", "binary", "script"]
    assert {f.status for f in findings} == {"ok"}


def test_our_fmu_loads_here(fmus):
    found = examined(fmus / "GripperPlant.fmu")
    assert list(found) == FMU_CHECKS
    assert [name for name in FMU_CHECKS if found[name].status != "ok"] == ["host"]
    assert found["host"].status == "warning"
    fix = found["host"].fix
    assert fix.startswith("LD_PRELOAD=")
    assert fix.endswith("HOST, or grasp-cosim build --native")


def test_text_is_one_line_each_with_the_fix_below():
    findings = [Finding("a", "ok", "fine", None), Finding("b c", "problem", "broken", "mend it")]
    assert loading.findings_text(findings, tried=True).splitlines() == [
        "loads on this machine: no",
        "ok       a            fine",
        "problem  b c          broken",
        "                      fix: mend it",
    ]
    said = "loads on this machine: yes, judged by the file; --load tries"
    assert loading.findings_text(findings[:1], tried=False).splitlines()[0] == said


ASK = "ask the vendor for an export as FMI 2.0 or 3.0, for co-simulation or model exchange"
BOTH = '<ModelExchange modelIdentifier="M"/><CoSimulation modelIdentifier="N"/>'


@pytest.mark.parametrize(
    ("kinds", "status", "text", "fix"),
    [
        (BOTH, "ok", "FMI 2.0, CoSimulation, ModelExchange, made by an unknown", None),
        ('<ModelExchange modelIdentifier="N"/>', "ok", "run here by a solver", None),
        ("", "problem", "declares no kind of FMU", ASK),
    ],
)
def test_kinds(kinds, status, text, fix, tmp_path):
    fmu = unpack(described(tmp_path / "n.fmu", DESCRIPTION.format(kinds=kinds)), tmp_path)
    found = loading.description(fmu)
    assert (found[0], found[2], fmu.binary.stem == "N") == (status, fix, bool(kinds))
    assert text in found[1]
    assert loading.trial(fmu)[0] == "warning"


@gcc
@pytest.mark.parametrize("version", [slow("2.0"), "3.0"])
def test_a_native_fmu_of_either_version_is_tried(version, tmp_path):
    found = examined(native_fmus.build(tmp_path, version=version, complete=True))
    assert list(found) == ["fmu", "binary", "libraries", "trial"]
    assert {f.status for f in found.values()} == {"ok"}
    assert "needs no Python" in found["fmu"].text
    ours = fmpy.platform_tuple if version == "3.0" else fmpy.platform
    assert f"there is: {ours}; this machine: {ours}" in found["binary"].text


OTHERS = {"binaries/linux64/Other.so": b"", LINUX64: None}


@pytest.mark.parametrize(
    ("changes", "text", "fix"),
    [
        ({LINUX64: None}, "has a binary for win64 only; this machine: linux64", "ask the vendor"),
        (
            {LINUX64: None, "sources/all.c": b""},
            "has a binary for win64",
            "do not compile as they are: modelDescription.xml lists no source files",
        ),
        (OTHERS, "Stock.so, but Other.so; there is: linux64, win64; this machine: ", "for linux64"),
    ],
)
def test_no_binary_for_this_machine(changes, text, fix, opened):
    fmu = opened(changes)
    status, said, remedy = loading.binary(fmu)
    assert status == "problem"
    assert text in said
    assert fix in remedy
    assert "build --native" not in remedy  # whose block only its maker has
    assert loading.trial(fmu)[0] == "warning"


LOADER = "\tlibc.so.6 => /lib/libc.so.6 (0x1)\n"
NEWER = "x.so: /lib/libc.so.6: version `GLIBC_9.1' not found (required by x.so)\n"


@pytest.mark.parametrize(
    ("linked", "status", "text"),
    [
        ("\tlibm.so.9 => not found\n" + NEWER, "problem", "not found: libm.so.9"),
        (NEWER, "problem", "not on this system: GLIBC_9.1"),
        ("undefined symbol: gsl_sin\t(x.so)\n", "problem", "undefined symbols: gsl_sin"),
        ("undefined symbol: PyLong_AsLong\t(x.so)\n", "ok", "the dynamic linker finds all"),
    ],
)
def test_libraries_that_are_missing(linked, status, text):
    assert loading.libraries(LOADER + linked, loads=False)[:2] == (status, text)
    loaded = loading.libraries(LOADER + linked, loads=True)
    assert loaded[0] == ("ok" if status == "ok" else "warning")
    assert loading.libraries("ldd: not found", loads=False) is None


def test_a_binary_that_is_bound_to_a_libpython_needs_none_from_its_host(opened):
    linked = "\tlibpython3.9.so => /lib/libpython3.9.so\nundefined symbol: PyLong_New\t(x.so)\n"
    assert loading.host(opened(), linked) is None


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"resources/slavemodule.txt": None}, "resources/slavemodule.txt names none"),
        ({"resources/Stock.py": None}, "resources/slavemodule.txt names Stock"),
        ({"resources/Stock.py": b"class Stock(:"}, "invalid syntax (Stock.py, line 1)"),
    ],
)
def test_a_script_that_is_not_there_or_no_python(changes, text, opened):
    verdict = loading.script(opened(changes))
    assert verdict[0] == "problem"
    assert text in verdict[1]


@pytest.mark.parametrize(
    ("files", "missing"),
    [
        ({"Stock": "from nope.x import y, z"}, "nope"),
        ({"Stock": "import nope.x, yaml_"}, "nope, yaml_"),
        ({"Stock": "try:\n import nope\nexcept ImportError: pass"}, None),
        ({"Stock": "from typing import *\nif TYPE_CHECKING:\n import nope"}, None),
        ({"Stock": "import a.b, c", "a/b": "", "c": ""}, None),
        ({"Stock": "import math, numpy.linalg, xml.etree, fast", "fast.abi3.so": ""}, None),
    ],
)
def test_what_a_script_imports_is_packed_or_installed(files, missing, opened):
    names = {name: name if name.endswith(".so") else f"{name}.py" for name in files}
    changes = {f"resources/{names[name]}": text.encode() for name, text in files.items()}
    verdict = loading.script(opened(changes))
    if missing is None:
        assert verdict[0] == "ok"
        assert verdict[1].endswith(": numpy" if "numpy" in files["Stock"] else ": none")
    else:
        assert verdict[0] == "problem"
        assert verdict[1].endswith(f"neither packed nor installed: {missing}")
        names = missing.replace(",", "")
        assert verdict[2] == f"{quote(sys.executable)} -m pip install {names}"


@pytest.mark.parametrize(
    ("script", "text"),
    [
        ("import nope\n" + SCRIPT, "does not instantiate: ModuleNotFoundError("),
        (SCRIPT.replace("self.y = 0.0", "raise OSError('no disk')"), "OSError('no disk')"),
        ("import atexit, os\natexit.register(os.abort)\n" + SCRIPT,
         "crashes with SIGABRT after it was freed"),
        ("import os\nprint('oh', flush=True)\nos.abort()\n" + SCRIPT,
         "crashes with SIGABRT when instantiated; it says oh"),
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


@gcc
def test_a_native_fmu_without_a_library(tmp_path):
    for name, code, *options in (
        ("liblost", "int lost(void) { return 1; }"),
        ("n", "int lost(void); int found(void) { return lost(); }", "-L.", "-llost"),
    ):
        (tmp_path / f"{name}.c").write_text(code)
        command = ["gcc", "-shared", "-fPIC", "-o", f"{name}.so", f"{name}.c", *options]
        subprocess.run(command, cwd=tmp_path, check=True)
    text = DESCRIPTION.format(kinds='<CoSimulation modelIdentifier="N"/>')
    files = {"binaries/linux64/N.so": (tmp_path / "n.so").read_bytes()}
    found = examined(described(tmp_path / "n.fmu", text, **files))
    assert found["libraries"].text == "not found: liblost.so"
    assert found["trial"].text.startswith(
        "does not instantiate: Failed to load shared library binaries/linux64/N.so. liblost.so: "
    )
