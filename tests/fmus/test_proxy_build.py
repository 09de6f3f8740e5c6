"""The proxy of an FMU: everything of the original, a valid description, the same bytes again."""

import ast
import json
import os
import subprocess
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import pytest
from conftest import Load
from fmpy.validation import validate_fmu
from grasp_cosim import cli
from grasp_cosim.hil.protocol import link_signature
from grasp_cosim.interface.read import read_interface
from grasp_fmus.c_header import c_header
from grasp_fmus.page import icon
from support import native_fmus
from support.kinds import Kind, native_slowly, proxy_options
from support.slow import slow

Proxy = Callable[..., Path]
Run = Callable[..., tuple[int, str, str]]

BLOCKS = ("GripperPlant", "ProximitySensor", "GraspController", "GraspControllerAdaptive")
OWN_PARAMETERS = {
    "proxy.host": ("String", "127.0.0.1"),
    "proxy.port": ("Integer", "5501"),
    "proxy.timeout": ("Real", "0.01"),
    "proxy.connect_timeout": ("Real", "5.0"),
    "proxy.misses_tolerated": ("Integer", "3"),
    "proxy.on_loss": ("String", "stop"),
    "proxy.resume": ("Boolean", "false"),
    "proxy.key_file": ("String", ""),
}
OWN_OUTPUTS = {
    "proxy.state": "Integer",
    "proxy.missed": "Integer",
    "proxy.consecutive_missed": "Integer",
    "proxy.late": "Integer",
    "proxy.out_of_order": "Integer",
    "proxy.duplicated": "Integer",
    "proxy.rejected": "Integer",
    "proxy.sessions": "Integer",
    "proxy.round_trip_time": "Real",
    "proxy.age": "Real",
}


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Run:
    """The command in an empty folder: exit code, standard output, standard error."""
    folder = tmp_path / "here"
    folder.mkdir()
    monkeypatch.chdir(folder)

    def command(*arguments: str | Path) -> tuple[int, str, str]:
        code = cli.main(["proxy", *map(str, arguments)])
        out, err = capsys.readouterr()
        return code, out, err

    return command


@pytest.fixture
def proxy(run: Run, kind: Kind) -> Proxy:
    """Builds the proxy of an FMU."""

    def build(original: Path, *options: str) -> Path:
        code, _, err = run(original, "-o", "TheProxy.fmu", *proxy_options(kind), *options)
        assert code == 0, err
        return Path("TheProxy.fmu").absolute()

    return build


def read(fmu: Path) -> Element:
    with zipfile.ZipFile(fmu) as archive:
        return ElementTree.fromstring(archive.read("modelDescription.xml"))


def rewritten(fmu: Path, change: Callable[[Element], None]) -> Path:
    """The FMU with another description."""
    root = read(fmu)
    change(root)
    with zipfile.ZipFile(fmu) as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    files["modelDescription.xml"] = ElementTree.tostring(root)
    with zipfile.ZipFile(fmu, "w") as archive:
        for name, data in files.items():
            archive.writestr(name, data)
    return fmu


# The variables of the original

KINDS = {"Float64": "Real", "Float32": "Real", "Enumeration": "Integer"}
KINDS |= {f"{u}Int{bits}": "Integer" for u in ("", "U") for bits in (8, 16, 32)}


def variables(fmu: Path) -> dict[str, dict[str, Any]]:
    """Inputs, parameters and outputs by name, read from FMI 2 or 3."""
    found = {}
    for element in read(fmu).iterfind("ModelVariables/*"):
        (typed,) = list(element) if element.tag == "ScalarVariable" else [element]
        if element.get("causality") not in ("input", "parameter", "output"):
            continue
        start = typed.get("start", next((e.get("value") for e in element.iter("Start")), None))
        kind = KINDS.get(typed.tag, typed.tag)
        convert: Any = {"Real": float, "Integer": int}.get(kind, str)
        numbers: dict[str, Any] = {
            k: convert(typed.attrib[k]) for k in ("min", "max") if k in typed.attrib
        }
        found[element.attrib["name"]] = {
            "kind": kind,
            "causality": element.get("causality"),
            "variability": element.get("variability"),
            "description": element.get("description"),
            "unit": typed.get("unit"),
            "nominal": float(typed.get("nominal", "1")),
            "relative": typed.get("relativeQuantity", "false"),
            "start": None if start is None else convert(start),
            **numbers,
        }
    return found


def check(original: Path, proxy: Path, also: str = "") -> None:
    """Everything of the original is in the proxy, and what it has beside, and it is valid."""
    theirs, ours = variables(original), variables(proxy)
    assert {name: ours.get(name) for name in theirs} == theirs
    outputs = {name: v for name, v in theirs.items() if v["causality"] == "output"}
    own = {name: v for name, v in ours.items() if name not in theirs}
    expected = {name: (kind, "parameter") for name, (kind, _) in OWN_PARAMETERS.items()}
    expected |= {f"proxy.hold.{name}": ("Boolean", "parameter") for name in outputs}
    expected |= {f"proxy.failsafe.{n}": (v["kind"], "parameter") for n, v in outputs.items()}
    expected |= {name: (kind, "output") for name, kind in OWN_OUTPUTS.items()}
    assert {name: (v["kind"], v["causality"]) for name, v in own.items()} == expected
    for name, v in outputs.items():
        failsafe = ours[f"proxy.failsafe.{name}"]
        assert (failsafe["unit"], failsafe["relative"]) == (v["unit"], v["relative"])
    assert all(v["description"] for v in own.values())
    assert validate_fmu(proxy) == []
    check_units(original, proxy)
    check_structure(proxy)


def check_units(original: Path, proxy: Path) -> None:
    """Units that the proxy uses are defined as the original does."""

    def bases(fmu: Path) -> dict[str, dict[str, float] | None]:
        return {
            unit.attrib["name"]: None if base is None else {k: float(x) for k, x in base.items()}
            for unit in read(fmu).iter("Unit")
            for base in [unit.find("BaseUnit")]
        }

    theirs, ours = bases(original), bases(proxy)
    used = {v["unit"] for v in variables(proxy).values() if v["unit"]}
    assert set(ours) == used
    for name, base in ours.items():
        assert base == theirs.get(name, {"s": 1.0}), name


def unknowns(fmu: Path, section: str) -> dict[str, set[str] | None]:
    """What is declared of outputs, or at the start, in FMI 2 or 3; None: nothing."""
    root = read(fmu)
    names = [v.attrib["name"] for v in root.iterfind("ModelVariables/*")]
    if root.get("fmiVersion") == "2.0":
        found, place = root.iterfind(f"ModelStructure/{section}s/Unknown"), "index"
        names.insert(0, "")  # it counts from 1
    else:
        found, place = root.iterfind(f"ModelStructure/{section}"), "valueReference"
    listed = [(names[int(u.attrib[place])], u.get("dependencies")) for u in found]
    return {name: d if d is None else {names[int(i)] for i in d.split()} for name, d in listed}


def check_structure(proxy: Path) -> None:
    """Outputs follow nothing while stepping, and nothing of the proxy's own at the start."""
    outputs = [n for n, v in variables(proxy).items() if v["causality"] == "output"]
    for section in ("Output", "InitialUnknown"):
        found = unknowns(proxy, section)
        assert list(found) == outputs
        for known in found.values():
            assert known is not None
            assert section == "InitialUnknown" or not known
            assert not [name for name in known if name.startswith("proxy.")]


def initial(fmu: Path) -> dict[str, set[str]]:
    """What is declared of outputs at the start."""
    return {n: known for n, known in unknowns(fmu, "InitialUnknown").items() if known is not None}


@native_slowly
@pytest.mark.parametrize("name", [slow(n) if n != "ProximitySensor" else n for n in BLOCKS])
def test_the_proxy_of_one_of_ours(fmus: Path, proxy: Proxy, name: str) -> None:
    original = fmus / f"{name}.fmu"
    made = proxy(original)
    check(original, made)
    declared = initial(made)
    assert {n: declared[n] for n in initial(original)} == initial(original)
    assert read(made).get("variableNamingConvention") == "structured"
    theirs, ours = (read(f).find("DefaultExperiment") for f in (original, made))
    assert theirs is not None
    assert ours is not None
    assert {k: float(v) for k, v in ours.items()} == {k: float(v) for k, v in theirs.items()}


@native_slowly
@native_fmus.needs_gcc
def test_the_proxy_of_an_fmu_with_every_type_of_fmi_2(tmp_path: Path, proxy: Proxy) -> None:
    units = {"u_Real": "degC", "y_Real": "degF", "x": "mm", "now": "bare"}

    def describe(root: Element) -> None:
        for v in root.iter("ScalarVariable"):
            v.set("description", f"a <{v.get('name')}> & more")
            typed = v[0]
            typed.attrib.pop("declaredType", None)
            if typed.tag == "Enumeration":
                typed.set("declaredType", "Choice")
            if typed.tag in ("Real", "Integer"):
                typed.set("min" if v.get("causality") == "input" else "max", "1e9"[:1])
            if typed.tag == "Real":
                typed.set("nominal", "2.5")
            if v.get("name") == "u_Real":
                typed.set("relativeQuantity", "true")
                typed.set("start", "1.0625")
            if v.get("name") == "now":
                v.set("initial", "exact")
                typed.set("start", "0.5")
            if v.get("name") == "gain":
                typed.set("max", "100")

    original = rewritten(native_fmus.build(tmp_path, version="2.0", units=units), describe)
    made = proxy(original)
    check(original, made)
    parameters = {n for n, v in variables(original).items() if v["causality"] == "parameter"}
    declared = initial(made)
    assert declared["y_Real"] == {"u_Real", *parameters}
    assert declared["x"] == parameters
    assert read(made).get("variableNamingConvention") == "structured"
    assert read(made).find("DefaultExperiment") is None


def without_odd_types(root: Element) -> None:
    """A description of FMI 3 without what a proxy cannot have as input or output."""
    wide = ("Int64", "UInt32", "UInt64", "Binary", "Clock")
    model, structure = root.find("ModelVariables"), root.find("ModelStructure")
    assert model is not None
    assert structure is not None
    gone = set()
    for element in list(model):
        odd = element.tag in wide or element.find("Dimension") is not None
        if odd and element.get("causality") in ("input", "output"):
            gone.add(element.get("valueReference"))
            model.remove(element)
    for element in list(structure):
        if element.get("valueReference") in gone:
            structure.remove(element)
        elif set(element.get("dependencies", "").split()) & gone:
            element.set("dependencies", "")


@native_slowly
@native_fmus.needs_gcc
def test_the_proxy_of_an_fmu_of_fmi_3(tmp_path: Path, run: Run, kind: Kind) -> None:
    original = rewritten(native_fmus.build(tmp_path, capabilities={}), without_odd_types)
    code, out, err = run(original, "-o", "TheProxy.fmu", "--json", *proxy_options(kind))
    assert code == 0
    report = json.loads(out)
    assert report["fmu"] == "TheProxy.fmu"
    assert report["notes"] == ["native.fmu: parameter size is structural: left out"]
    assert err.splitlines()[-1:] == report["notes"]
    made = Path("TheProxy.fmu")
    check(original, made)
    assert variables(made)["u_Enumeration"]["kind"] == "Integer"
    items = [read_interface(fmu).by_name["u_Enumeration"].items for fmu in (original, made)]
    assert items == [{"one": 1, "two": 2}] * 2
    assert variables(made)["u_Float32"]["kind"] == "Real"
    capabilities = read(made).find("CoSimulation")
    assert capabilities is not None
    assert capabilities.get("canHandleVariableCommunicationStepSize") == "false"


@native_fmus.needs_gcc
@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda root: None, "input u_UInt32 is of type UInt32"),
        (lambda root: _only(root, "u_Binary"), "input u_Binary is of type Binary"),
        (lambda root: _only(root, "y_array"), "output y_array is of type array of String"),
        (lambda root: _only(root, "y_clock"), "output y_clock is of type Clock"),
    ],
)
def test_an_input_or_output_that_cannot_be_exchanged_is_named(
    tmp_path: Path, run: Run, change: Callable[[Element], None], reason: str
) -> None:
    original = rewritten(native_fmus.build(tmp_path), change)
    code, out, err = run(original, "-o", "TheProxy.fmu")
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert reason in err
    assert not Path("TheProxy.fmu").exists()


def _only(root: Element, name: str) -> None:
    kept = next(v for v in root.iterfind("ModelVariables/*") if v.get("name") == name)
    place = list(root.findall("ModelVariables/*")).index(kept)
    without_odd_types(root)
    model = root.find("ModelVariables")
    assert model is not None
    model.insert(place, kept)


@native_slowly
@native_fmus.needs_gcc
def test_dependencies_that_are_not_declared_are_all(tmp_path: Path, proxy: Proxy) -> None:
    def undeclare(root: Element) -> None:
        for unknown in root.iter("Unknown"):
            unknown.attrib.pop("dependencies")

    original = rewritten(native_fmus.build(tmp_path, version="2.0"), undeclare)
    made = proxy(original)
    check(original, made)
    causalities = {n: v["causality"] for n, v in variables(original).items()}
    everything = {n for n, causality in causalities.items() if causality != "output"}
    declared = initial(made)
    assert all(declared[n] == everything for n, c in causalities.items() if c == "output")


@native_slowly
@native_fmus.needs_gcc
def test_an_output_that_is_constant_stays_so(tmp_path: Path, proxy: Proxy) -> None:
    def fix(root: Element) -> None:
        for v in root.iter("ScalarVariable"):
            if v.get("name") == "steps":
                v.set("variability", "constant")
                v.set("initial", "exact")
                v[0].set("start", "7")

    made = proxy(rewritten(native_fmus.build(tmp_path, version="2.0"), fix))
    assert validate_fmu(made) == []
    found = variables(made)["steps"]
    assert (found["variability"], found["start"]) == ("constant", 7)
    assert "steps" not in initial(made)


@native_slowly
@native_fmus.needs_gcc
def test_names_that_are_not_structured(tmp_path: Path, proxy: Proxy) -> None:
    def rename(root: Element) -> None:
        next(root.iter("ScalarVariable")).set("name", "u Real, °C | 1")

    original = rewritten(native_fmus.build(tmp_path, version="2.0"), rename)
    made = proxy(original)
    check(original, made)
    assert read(made).get("variableNamingConvention") == "flat"


@native_fmus.needs_gcc
def test_start_values_that_no_datagram_holds(tmp_path: Path, run: Run) -> None:
    """A parameter keeps the value it has in the original; an input cannot."""

    def endless(name: str) -> Callable[[Element], None]:
        def change(root: Element) -> None:
            for v in root.iter("ScalarVariable"):
                if v.get("name") == name:
                    v[0].set("start", "INF")

        return change

    original = rewritten(native_fmus.build(tmp_path, version="2.0"), endless("hang_at"))
    code, _, err = run(original, "-o", "TheProxy.fmu")
    assert (code, err) == (0, "native.fmu: parameter hang_at is INF at the start: left out\n")
    assert "hang_at" not in variables(Path("TheProxy.fmu"))
    rewritten(original, endless("u_Real"))
    code, _, err = run(original, "-o", "TheProxy.fmu")
    assert code == 2
    assert "input u_Real is INF at the start" in err


@native_fmus.needs_gcc
@pytest.mark.parametrize("options", [["-o", "P.fmu"], ["--c-header", "p.h", "-o", "P.fmu"]])
@pytest.mark.parametrize("native", [[], ["--native"]])
def test_a_text_that_is_too_long_to_be_sent(
    tmp_path: Path, run: Run, options: list[str], native: list[str]
) -> None:
    """Neither the header nor the FMU is written; in C such a start would be written over others."""

    def wordy(root: Element) -> None:
        for v in root.iter("ScalarVariable"):
            if v.get("name") == "u_String":
                v[0].set("start", "x" * 128)

    original = rewritten(native_fmus.build(tmp_path, version="2.0"), wordy)
    code, _, err = run(original, *options, *native)
    assert (code, err.count("\n"), list(Path().iterdir())) == (2, 1, [])
    assert "u_String = 'xxx" in err
    assert "bytes in UTF-8" in err


def test_a_proxy_of_a_proxy_has_no_names_left(fmus: Path, proxy: Proxy, run: Run) -> None:
    made = proxy(fmus / "ProximitySensor.fmu")
    code, _, err = run(made, "-o", "Second.fmu")
    assert (code, err.count("\n")) == (2, 1)
    assert "TheProxy.fmu: proxy.host: proxy. begins the names of a proxy's own" in err


# What is in it


@native_slowly
def test_start_values_of_its_own(fmus: Path, proxy: Proxy) -> None:
    made = variables(proxy(fmus / "ProximitySensor.fmu"))
    for name, (kind, start) in OWN_PARAMETERS.items():
        convert: Any = {"Real": float, "Integer": int}.get(kind, str)
        assert made[name]["start"] == convert(start)
    options = ("--host", "192.0.2.7", "--port", "6000", "--timeout", "2e-3")
    made = variables(proxy(fmus / "ProximitySensor.fmu", *options))
    names = ("proxy.host", "proxy.port", "proxy.timeout")
    assert [made[name]["start"] for name in names] == ["192.0.2.7", 6000, 0.002]


def test_capabilities(fmus: Path, proxy: Proxy) -> None:
    element = read(proxy(fmus / "ProximitySensor.fmu")).find("CoSimulation")
    assert element is not None
    assert element.attrib == {
        "modelIdentifier": "TheProxy",
        "needsExecutionTool": "true",
        "canHandleVariableCommunicationStepSize": "true",
        "canNotUseMemoryManagementFunctions": "true",
        "canGetAndSetFMUstate": "false",
        "canSerializeFMUstate": "false",
    }


def test_what_is_packed_imports_the_standard_library_and_itself(fmus: Path, proxy: Proxy) -> None:
    with zipfile.ZipFile(proxy(fmus / "GripperPlant.fmu")) as archive:
        sources = {n: archive.read(n) for n in archive.namelist() if n.endswith(".py")}
        script = archive.read("resources/slavemodule.txt").decode()
        assert archive.read("model.png") == icon("Proxy")
        page = archive.read("documentation/index.html").decode()
    content = script.rpartition("_")[2]
    imported = set()
    for data in sources.values():
        for node in ast.walk(ast.parse(data)):
            if isinstance(node, ast.Import):
                imported |= {alias.name.partition(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and not node.level:
                imported.add((node.module or "").partition(".")[0])
    ours = {f"grasp_fmus_{content}", f"block_variables_{content}"}
    assert {m for m in imported if m not in sys.stdlib_module_names} == ours
    for text in ("proxy.failsafe.gap[1]", "GRSP", "grasp-cosim proxy --bind-python", "TheProxy"):
        assert text in page
    ElementTree.fromstring(page)


@pytest.mark.slow
def test_the_same_options_give_the_same_bytes_in_any_process(fmus: Path, proxy: Proxy) -> None:
    made = proxy(fmus / "GripperPlant.fmu")
    first = made.read_bytes()
    command = "import sys; from grasp_cosim.cli import main; sys.exit(main(sys.argv[1:]))"
    made.unlink()
    subprocess.run(
        [sys.executable, "-c", command, "proxy", fmus / "GripperPlant.fmu", "-o", made],
        check=True, capture_output=True,
        env={**os.environ, "PYTHONHASHSEED": "7", "PYTHONPATH": os.pathsep.join(sys.path)},
    )  # fmt: skip
    assert made.read_bytes() == first
    with zipfile.ZipFile(made) as archive:
        names = archive.namelist()
    assert names == sorted(names)


def test_other_options_give_another_guid(fmus: Path, proxy: Proxy) -> None:
    original = fmus / "ProximitySensor.fmu"
    guids = {
        read(proxy(original, *options)).get("guid")
        for options in ((), ("--port", "6000"), ("--timeout", "1"), ("--host", "localhost"))
    }
    assert len(guids) == 4


def test_an_unchanged_proxy_is_left_alone(fmus: Path, run: Run) -> None:
    arguments = (fmus / "ProximitySensor.fmu", "-o", "sub/Eye.fmu")
    assert run(*arguments) == (0, "sub/Eye.fmu: new\n", "")
    before = Path("sub/Eye.fmu").stat().st_mtime_ns
    assert run(*arguments) == (0, "sub/Eye.fmu: unchanged\n", "")
    assert Path("sub/Eye.fmu").stat().st_mtime_ns == before
    code, out, _ = run(*arguments, "--port", "7000")
    assert code == 0
    assert out.splitlines()[:2] == [
        "sub/Eye.fmu: changed", "    proxy.port: start 5501 -> 7000",
    ]  # fmt: skip
    assert [p.name for p in Path("sub").iterdir()] == ["Eye.fmu"]


def test_the_peers_side_as_a_c_header(fmus: Path, run: Run) -> None:
    """What it does: test_c_header.py."""
    original = fmus / "GripperPlant.fmu"
    signature, _ = link_signature(read_interface(original))
    both = ("-o", "P.fmu", "--c-header", "sub/bench.h")
    assert run(original, *both) == (0, "P.fmu: new\nsub/bench.h: written\n", "")
    text = Path("sub/bench.h").read_text("ascii")
    starts = {n: v["start"] for n, v in variables(original).items() if v["start"] is not None}
    said = {v.name: v.description or "" for v in read_interface(original).variables}
    assert text == c_header("GripperPlant", signature, starts, said)
    Path("P.fmu").unlink()
    code, out, _ = run(original, "--c-header", "other.h", "--json")
    assert (code, json.loads(out)) == (0, {"notes": [], "c_header": "other.h"})
    assert Path("other.h").read_text("ascii") == text
    assert not Path("P.fmu").exists()


# Mistakes


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["ProximitySensor.fmu"], "proxy: must have -o FILE.fmu or --c-header FILE, or both"),
        (["-o", "P.fmu"], "Missing argument 'FMU'"),
        (["none.fmu", "-o", "P.fmu"], "none.fmu: no such FMU file"),
        (["ProximitySensor.fmu", "-o", "my-proxy.fmu"], "my-proxy.fmu: must be NAME.fmu, NAME of"),
        (["ProximitySensor.fmu", "-o", "2nd.fmu"], "2nd.fmu: must be NAME.fmu, NAME of"),
        (["ProximitySensor.fmu", "-o", "Grün.fmu"], "Grün.fmu: must be NAME.fmu, NAME of letters"),
        (["ProximitySensor.fmu", "-o", "P"], "P: must be NAME.fmu, NAME of letters"),
        (["ProximitySensor.fmu", "-o", "./ProximitySensor.fmu"], "is the original; must be"),
        (["ProximitySensor.fmu", "--c-header", "ProximitySensor.fmu"], "is the original; must be"),
        (["ProximitySensor.fmu", "-o", "P.fmu", "--c-header", "P.fmu"], "is the proxy; must be"),
        (["ProximitySensor.fmu", "-o", "P.fmu", "--timeout", "0"],
         "proxy.timeout = 0.0 s: must be from 1e-06 to 3600 s"),
        (["ProximitySensor.fmu", "-o", "P.fmu", "--timeout", "nan"],
         "proxy.timeout = nan s: must be from 1e-06 to 3600 s"),
        (["ProximitySensor.fmu", "-o", "P.fmu", "--port", "0"], "0 is not in the range"),
        (["ProximitySensor.fmu", "-o", "P.fmu", "--host", "h" * 1024], "must have 0 to 1023 bytes"),
        (["ProximitySensor.fmu", "-o", "P.fmu", "--native", "--host", "h" * 1024],
         "must have 0 to 1023 bytes"),
        (["ProximitySensor.fmu", "-o", "P.fmu", "--bind-python", ""], "--bind-python ''"),
        (["ProximitySensor.fmu", "-o", "P.fmu", "--fmi", "3"], "--fmi 3: must be with --native"),
        (["ProximitySensor.fmu", "-o", "P.fmu", "--native", "--target", "vax"], "--target 'vax'"),
        (["ProximitySensor.fmu", "-o", "P.fmu", "--native", "--bind-python", "python3"],
         "--bind-python: a native FMU needs no Python"),
        (["ProximitySensor.fmu", "--c-header", "p.h", "--native"], "--native: there is no FMU"),
        (["ProximitySensor.fmu", "-o", "P.fmu", "--bind-python", "/no/python"], "/no/python"),
    ],
)  # fmt: skip
def test_a_mistake_is_one_line(fmus: Path, run: Run, arguments: list[str], reason: str) -> None:
    original = Path("ProximitySensor.fmu")
    original.write_bytes((fmus / original).read_bytes())
    before = original.read_bytes()
    code, out, err = run(*arguments)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert reason in err
    assert [p.name for p in Path().iterdir()] == [original.name]
    assert original.read_bytes() == before


def test_blocks_log_no_warnings(load: Load) -> None:
    root = ElementTree.parse(load("GripperPlant").folder / "modelDescription.xml").getroot()
    categories = [c.get("name") for c in root.iter("Category")]
    assert categories == ["logStatusDiscard", "logStatusError"]
