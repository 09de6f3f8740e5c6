"""The proxy of an FMU: everything of the original, a valid description, the same bytes again."""

import json
import shutil
from operator import attrgetter
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from fmpy.validation import validate_fmu
from grasp_cosim import cli, simulate
from grasp_cosim.base.si_units import known_unit
from grasp_cosim.fmu_export.native.bench_header import bench_header
from grasp_cosim.fmu_export.package import write_members
from grasp_cosim.fmu_export.page import icon
from grasp_cosim.hil.proxy_of_fmu import link_signature
from grasp_cosim.hil.served import Service
from grasp_cosim.interface.read import read_interface
from grasp_cosim.system.description import System
from grasp_cosim.system.parts import Component
from support import native_fmus
from support.fmi2 import read_members
from support.marks import platforms, slow
from support.native_fmus import state_space
from support.proxies import ANY_PORT, build_proxy, serving

pytestmark = native_fmus.needs_gcc

BLOCKS = ("GripperPlant", "ProximitySensor", "GraspController", "GraspControllerAdaptive")
OWN_PARAMETERS = {
    "proxy.host": ("String", "127.0.0.1"),
    "proxy.port": ("Integer", 5501),
    "proxy.timeout": ("Real", 0.01),
    "proxy.connect_timeout": ("Real", 5.0),
    "proxy.misses_tolerated": ("Integer", 3),
    "proxy.greatest_lead": ("Real", 0.1),
    "proxy.on_loss": ("String", "stop"),
    "proxy.resume": ("Boolean", False),
    "proxy.on_limit": ("String", "clamp"),
    "proxy.key_file": ("String", ""),
    "proxy.name": ("String", ""),
    "proxy.build": ("String", ""),
}
OWN_OUTPUTS = dict.fromkeys(
    ["state", "missed", "consecutive_missed", "late", "out_of_order", "duplicated", "rejected",
     "sessions", "trips", "limited", "implausible"], "Integer",
) | {"round_trip_time": "Real", "age": "Real", "lead": "Real"}  # fmt: skip


@pytest.fixture
def run(tmp_path, monkeypatch, capsys):
    """The command in an empty folder: exit code, standard output, standard error."""
    folder = tmp_path / "here"
    folder.mkdir()
    monkeypatch.chdir(folder)

    def command(*arguments):
        code = cli.main(["proxy", *map(str, arguments)])
        out, err = capsys.readouterr()
        return code, out, err

    return command


@pytest.fixture(params=["2", platforms("3")])
def proxy(run, request):
    """Builds the proxy of an FMU."""

    def build(original, *options):
        code, _, err = run(original, "-o", "TheProxy.fmu", "--fmi", request.param, *options)
        assert code == 0, err
        return Path("TheProxy.fmu").absolute()

    return build


def read(fmu):
    return ElementTree.fromstring(read_members(fmu)["modelDescription.xml"])


def rewritten(fmu, change):
    """The FMU with another description."""
    root, files = read(fmu), read_members(fmu)
    change(root)
    write_members(fmu, {**files, "modelDescription.xml": ElementTree.tostring(root)})
    return fmu


def started(name):
    """A change: a variable starts at infinity."""

    def change(root):
        for v in root.iter("ScalarVariable"):
            if v.get("name") == name:
                v[0].set("start", "INF")

    return change


# The variables of the original

SAME = (
    "kind", "causality", "variability", "description", "unit", "nominal", "relative",
    "start_value", "minimum", "maximum",
)  # fmt: skip


def exchanged(fmu):
    """Inputs, parameters and outputs but texts, by name."""
    found = read_interface(fmu).of("input", "parameter", "output")
    return {v.name: v for v in found if v.kind != "String" or v.name.startswith("proxy.")}


LIMITS = {"input": ("min", "max", "rate"), "output": ("lowest", "highest", "fastest")}
"""Of each Real variable of a causality."""


def check(original, proxy):
    """Everything of the original is in the proxy, and what it has beside, and it is valid.

    Outputs follow nothing while stepping, and nothing of the proxy's own at the start.
    """
    theirs, ours, same = exchanged(original), exchanged(proxy), attrgetter(*SAME)
    assert {n: same(ours[n]) for n in theirs} == {n: same(v) for n, v in theirs.items()}
    outputs = {name: v for name, v in theirs.items() if v.causality == "output"}
    own = {name: v for name, v in ours.items() if name not in theirs}
    expected = {name: kind for name, (kind, _) in OWN_PARAMETERS.items()}
    expected |= {f"proxy.hold.{name}": "Boolean" for name in outputs}
    expected |= {f"proxy.failsafe.{name}": v.kind for name, v in outputs.items()}
    for causality, limits in LIMITS.items():
        reals = [v for v in theirs.values() if (v.causality, v.kind) == (causality, "Real")]
        expected |= {f"proxy.{limit}.{v.name}": "Real" for v in reals for limit in limits}
    expected |= {f"proxy.{name}": kind for name, kind in OWN_OUTPUTS.items()}
    assert {name: v.kind for name, v in own.items()} == expected
    told = {name.removeprefix("proxy.") for name, v in own.items() if v.causality == "output"}
    assert told == {*OWN_OUTPUTS}
    for name, v in outputs.items():
        failsafe = ours[f"proxy.failsafe.{name}"]
        assert (failsafe.unit, failsafe.relative) == (v.unit, v.relative)
    assert all(v.description for v in own.values())
    assert {n: (own[n].kind, own[n].start_value) for n in OWN_PARAMETERS} == OWN_PARAMETERS
    assert validate_fmu(proxy) == []
    defined, used = read_interface(original).units, {v.unit for v in ours.values()}
    units = {"s": known_unit("s"), **defined}
    assert read_interface(proxy).units == {n: unit for n, unit in units.items() if n in used}
    for name, v in ours.items():
        if v.causality == "output":
            assert v.dependencies == ()
            assert (v.initial_dependencies is None) == (name == "n, °C | 1")
            assert not [n for n in v.initial_dependencies or () if n.startswith("proxy.")]


def initial(fmu):
    """What is declared of outputs at the start."""
    found = exchanged(fmu).values()
    return {v.name: {*v.initial_dependencies} for v in found if v.initial_dependencies is not None}


@pytest.mark.parametrize("name", [slow(n) if n != "ProximitySensor" else n for n in BLOCKS])
def test_the_proxy_of_one_of_ours(fmus, proxy, name):
    original = fmus / f"{name}.fmu"
    made = proxy(original)
    check(original, made)
    declared = initial(made)
    assert {n: declared[n] for n in initial(original)} == initial(original)
    assert read(made).get("variableNamingConvention") == "structured"
    assert read_interface(made).experiment == read_interface(original).experiment


def test_the_proxy_of_an_fmu_with_every_type_of_fmi_2(tmp_path, proxy):
    units = {"u_Real": "degC", "y_Real": "degF", "x": "mm", "now": "bare"}

    def describe(root):
        for v in root.iter("ScalarVariable"):
            v.set("description", f"a <{v.get('name')}> & more")
            typed = v[0]
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
            if v.get("name") == "steps":
                v.attrib |= {"variability": "constant", "initial": "exact", "name": "n, °C | 1"}
                typed.set("start", "7")

    original = rewritten(native_fmus.build(tmp_path, version="2.0", units=units), describe)
    made = proxy(original)
    check(original, made)
    parameters = {n for n, v in exchanged(original).items() if v.causality == "parameter"}
    declared = initial(made)
    assert declared["y_Real"] == {"u_Real", *parameters}
    assert declared["x"] == parameters
    assert read(made).get("variableNamingConvention") == "flat"
    assert read(made).find("DefaultExperiment") is None


def test_dependencies_that_are_not_declared_are_all(tmp_path, proxy):
    def undeclare(root):
        for unknown in root.iter("Unknown"):
            unknown.attrib.pop("dependencies")

    original = rewritten(native_fmus.build(tmp_path, version="2.0"), undeclare)
    made = proxy(original)
    found, declared = exchanged(original), initial(made)
    everything = {n for n, v in found.items() if v.causality != "output"}
    assert all(declared[n] == everything for n, v in found.items() if v.causality == "output")


def test_arrays_are_exchanged_by_element(tmp_path, run):
    """In lockstep with the same values as without the link, to the bit."""
    original = state_space(tmp_path, complete=True)
    values = {
        **{f"u[{i}]": 0.1 * i for i in (1, 2, 3)}, "x0[2]": 0.75,
        **{f"A[{i},{j}]": -1.0 / (i + j) for i in (1, 2, 3) for j in (1, 2, 3)},
    }  # fmt: skip
    with serving(original, Service(lockstep=True)) as server:
        made = build_proxy(original, tmp_path / "Bench.fmu", ANY_PORT)
        assert [*exchanged(made)][:3] == ["u[1]", "u[2]", "u[3]"]
        found = []
        port = {"proxy.port": server.address[1]}
        for fmu, given in ((original, values), (made, values | port)):
            parts = (Component("a", fmu, given),)
            system = System("s", parts, (), 10**8, 10**9, "sequential")
            found.append(simulate(system, engine="python"))
    for k in (1, 2, 3):
        direct, there = (result[f"a.y[{k}]"] for result in found)
        assert len({*direct}) == 11
        np.testing.assert_array_equal(direct, there)


def only(name):
    """A change: of inputs and outputs one is left."""

    def change(root):
        model, structure = root.find("ModelVariables"), root.find("ModelStructure")
        for element in list(model):
            if element.get("causality") in ("input", "output") and element.get("name") != name:
                model.remove(element)
        structure.clear()

    return change


@pytest.mark.parametrize(
    ("change", "version", "reason"),
    [
        (only("u_UInt32"), "3.0", "input u_UInt32 is of type UInt32"),
        (only("y_array"), "3.0", "output y_array is of type array of String"),
        (only("y_clock"), "3.0", "output y_clock is of type Clock"),
        (started("u_Real"), "2.0", "input u_Real is INF at the start"),
    ],
)
def test_an_input_or_output_that_cannot_be_exchanged_is_named(
    tmp_path, run, change, version, reason
):
    original = rewritten(native_fmus.build(tmp_path, version=version), change)
    code, out, err = run(original, "-o", "TheProxy.fmu")
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert reason in err
    assert not Path("TheProxy.fmu").exists()


def test_a_parameter_that_no_datagram_holds_keeps_its_start_value(tmp_path, run):
    original = rewritten(native_fmus.build(tmp_path, version="2.0"), started("hang_at"))
    code, _, err = run(original, "-o", "TheProxy.fmu")
    assert code == 0
    assert "native.fmu: hang_at: INF at the start: left out\n" in err
    assert "hang_at" not in exchanged(Path("TheProxy.fmu"))


def test_a_proxy_of_a_proxy_has_no_names_left(fmus, proxy, run):
    code, _, err = run(proxy(fmus / "ProximitySensor.fmu"), "-o", "Second.fmu")
    assert code == 2
    assert "TheProxy.fmu: proxy.port: proxy. begins the names of a proxy's own" in err


# What is in it


def test_the_files_in_it(fmus, run):
    assert run(fmus / "GripperPlant.fmu", "-o", "P.fmu")[0] == 0
    files = read_members("P.fmu")
    assert [*files] == sorted(files)
    assert {"binaries/linux64/P.so", "sources/P.c", "sources/wire.h"} < {*files}
    assert files["model.png"] == icon("Proxy")
    page = files["documentation/index.html"].decode()
    ElementTree.fromstring(page)
    assert all(text in page for text in ("proxy.failsafe.gap[1]", "GRSP", "P.c -lm"))


def test_the_peers_side_as_a_c_header(fmus, run):
    """What it does: test_bench_header.py."""
    original = fmus / "GripperPlant.fmu"
    signature, _ = link_signature(read_interface(original))
    both = ("-o", "P.fmu", "--c-header", "sub/bench.h")
    assert run(original, *both)[:2] == (0, "P.fmu: new\nsub/bench.h: written\n")
    text = Path("sub/bench.h").read_text("ascii")
    found = exchanged(original)
    starts = {n: v.start_value for n, v in found.items() if v.start is not None}
    said = {n: v.description or "" for n, v in found.items()}
    assert text == bench_header("GripperPlant", signature, starts, said)
    Path("P.fmu").unlink()
    code, out, _ = run(original, "--c-header", "other.h", "--json")
    assert (code, json.loads(out)) == (0, {"notes": [], "c_header": "other.h"})
    assert Path("other.h").read_text("ascii") == text
    assert not Path("P.fmu").exists()


# Mistakes

SENSOR = "ProximitySensor.fmu"


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        ([SENSOR], "proxy: needs -o FILE.fmu or --c-header FILE, or both"),
        (["none.fmu", "-o", "P.fmu"], "none.fmu: no such FMU file"),
        ([SENSOR, "-o", "Grün.fmu"], "Grün.fmu: must be NAME.fmu, NAME of letters"),
        ([SENSOR, "-o", "P"], "P: must be NAME.fmu, NAME of letters"),
        ([SENSOR, "-o", f"./{SENSOR}"], "is the original; must be"),
        ([SENSOR, "-o", "P.fmu", "--c-header", "P.fmu"], "is the proxy; must be"),
        ([SENSOR, "-o", "P.fmu", "--timeout", "0"],
         "proxy.timeout = 0.0 s: must be from 1e-06 to 3600 s"),
        ([SENSOR, "-o", "P.fmu", "--host", "h" * 1024], "must have 0 to 1023 bytes"),
        ([SENSOR, "-o", "P.fmu", "--target", "vax"], "--target 'vax'"),
        ([SENSOR, "--c-header", "p.h", "--fmi", "3"], "--fmi needs -o FILE.fmu"),
    ],
)  # fmt: skip
def test_a_mistake_is_one_line(fmus, run, arguments, reason):
    shutil.copy(fmus / SENSOR, SENSOR)
    before = Path(SENSOR).read_bytes()
    code, out, err = run(*arguments)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert reason in err
    assert [p.name for p in Path().iterdir()] == [SENSOR]
    assert Path(SENSOR).read_bytes() == before
