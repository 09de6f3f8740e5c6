"""Forms of archives and documents in circulation, which mean the same as those by the book."""

from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from grasp_cosim import InputError, System
from grasp_cosim.system.parts import Connection, Port
from hypothesis import given
from hypothesis import strategies as st
from lxml import etree  # type: ignore[import-untyped]
from ssp.hand_made import (
    UNITS,
    archive,
    bind,
    component,
    connect,
    entries_of,
    fmu,
    parameter_set,
    structure,
    system,
    zipped,
)
from support.marks import examples

FMU = fmu("input Real u 0.5 m", "output Real y - m", "parameter Real k 1.0 m", "output Boolean b -")
PARTS = component("a", "output y Real") + component("b", "input u Real")
TOP = system("top", PARTS, connect("a/y", "b/u"))
Y_TO_U = (Connection(Port("a", "y"), Port("b", "u")),)


def load(folder, ssd, files=None):
    path = archive(folder, structure(TOP), {"a": FMU, "b": FMU}, files)
    return rewritten(path, lambda name, data: (name, of_bytes(ssd) if ".ssd" in name else data))


def of_bytes(text):
    return text if isinstance(text, bytes) else text.encode()


def rewritten(path, edit):
    """The archive loaded with its entries edited, names and content."""
    return System.load(zipped(path, dict(edit(*entry) for entry in entries_of(path).items())))


def other_prefixes(text):
    return text.replace("ssd:", "ns0:").replace("xmlns:ssd", "xmlns:ns0").replace("ssc:", "q:")


DOCUMENTS = {
    "BOM": lambda text: b"\xef\xbb\xbf" + text.encode(),
    "UTF-16": lambda text: text.replace("UTF-8", "UTF-16").encode("utf-16"),
    "prefixes": lambda text: other_prefixes(text).replace("xmlns:ssc", "xmlns:q"),
    "comments": lambda text: text.replace("<ssd:E", "<!-- x --><?y z?><ssd:E"),
    "version 1.0.1": lambda text: text.replace('"hand" version="1.0"', '"hand" version="1.0.1"'),
}


@pytest.mark.parametrize("form", DOCUMENTS)
def test_forms_of_xml(tmp_path, form):
    loaded = load(tmp_path, DOCUMENTS[form](structure(TOP)))
    assert loaded.connections == Y_TO_U
    assert loaded.stop_ns == 1_000_000_000
    assert loaded.notes == load(tmp_path, structure(TOP)).notes


FULL = structure(
    system(
        "top",
        component("a", "output y Real m", bind(parameter_set("k Real 2", UNITS)))
        + component("b", "input u Real"),
        connect("a/y", "b/u") + connect("p", "b/k"),
        "parameter p Real",
        bind(parameter_set("p Real 3 mm")),
    )
)


@examples(20)
@given(st.randoms(use_true_random=False))
def test_any_order_of_elements_means_the_same(chance):
    """But for the order in a list, which counts."""
    root = etree.fromstring(FULL.encode())
    for element in root.iter("{*}SystemStructureDescription", "{*}System", "{*}Component"):
        element[:] = chance.sample(list(element), len(element))
    with TemporaryDirectory() as folder:
        loaded = System.load(
            archive(Path(folder), etree.tostring(root).decode(), {"a": FMU, "b": FMU})
        )
        assert loaded.connections == Y_TO_U
        values = {c.name: dict(c.values) for c in loaded.components}
    assert values == {"a": {"k": 2.0, "u": 0.5}, "b": {"k": 0.003}}


def in_folder(name):
    return f"My system/{name}"


ARCHIVES = {
    "folder": (in_folder, "all of it is in My system/, which is read as the top"),
    "backslashes": (
        lambda name: name.replace("/", "\\"),
        "its entries have backslashes, which are read as slashes",
    ),
}


@pytest.mark.parametrize("form", ARCHIVES)
def test_forms_of_archives(tmp_path, form):
    rename, said = ARCHIVES[form]
    files = {"extra/org.other/a.xml": "<a/>", "documentation/index.html": "<p>"}
    path = archive(tmp_path, structure(TOP), {"a": FMU, "b": FMU}, files)
    loaded = rewritten(path, lambda name, data: (rename(name), data))
    assert loaded.connections == Y_TO_U
    assert f"hand.ssp: {said}" in loaded.notes


def test_two_folders_with_a_structure_are_no_archive(tmp_path):
    path = archive(tmp_path, structure(TOP), {"a": FMU, "b": FMU}, {"x/SystemStructure.ssd": ""})
    with pytest.raises(InputError, match=r"no SystemStructure.ssd in it; must be an SSP archive"):
        rewritten(path, lambda name, data: (name if "/" in name else f"y/{name}", data))


def test_sources_in_folders_and_above_are_of_the_archive(tmp_path):
    parts = component("a", source="fmus/x y.fmu") + component("b", source="c.fmu")
    files = {"fmus/x y.fmu": "", "c.fmu": ""}
    path = archive(tmp_path, structure(system("top", parts)), {"a": FMU}, files)
    data = entries_of(path)["resources/a.fmu"]
    loaded = rewritten(path, lambda name, old: (name, data if name in files else old))
    assert [c.fmu.name for c in loaded.components] == ["x y.fmu", "c.fmu"]


SOURCES = {
    "from the top": ("/resources/a.fmu", "resources/a.fmu"),
    "other capitals": ("Resources/A.FMU", "resources/a.fmu"),
}


@pytest.mark.parametrize("form", SOURCES)
def test_a_source_may_be_written_otherwise_if_only_one_can_be_meant(tmp_path, form):
    source, entry = SOURCES[form]
    ssd = structure(system("top", component("a", source=source)))
    loaded = System.load(archive(tmp_path, ssd, {"a": FMU}))
    assert loaded.components[0].fmu.name == "a.fmu"
    said = f"component 'a': source '{source}' is taken to be {entry}"
    assert any(note.endswith(said) for note in loaded.notes)


def test_an_archive_in_an_archive_may_go_without_its_type(tmp_path):
    (tmp_path / "inner").mkdir()
    inner = archive(tmp_path / "inner", structure(TOP), {"a": FMU, "b": FMU}).read_bytes()
    ssd = structure(system("top", component("sub", source="resources/sub.ssp")))
    loaded = System.load(archive(tmp_path, ssd, {}, {"resources/sub.ssp": inner}))
    assert [c.name for c in loaded.components] == ["sub_a", "sub_b"]
    said = "names no type; resources/sub.ssp is taken as application/x-ssp-package"
    assert any(note.endswith(said) for note in loaded.notes)


@pytest.mark.parametrize(
    ("kind", "name"),
    [
        *((f"{sign}Int{bits}", "n") for sign in ("", "U") for bits in (8, 16, 32, 64)),
        *((f"Float{bits}", "u") for bits in (32, 64)),
    ],
)
def test_types_of_ssp_2_are_those_of_ssp_1(tmp_path, kind, name):
    """In a connector, in a value, and in a connector of the system."""
    described = fmu("input Real u 0.5", "input Integer n 3")
    value = bind(parameter_set(f"{name} {kind} 7"))
    top = system("top", component("a", f"input {name} {kind}", value))
    loaded = System.load(archive(tmp_path, structure(top), {"a": described}))
    assert loaded.start(f"a.{name}") == 7
    outer = system(
        "top", component("a"), connect("In", f"a/{name}"), f"input In {kind}",
        bind(parameter_set(f"In {kind} 9")),
    )  # fmt: skip
    assert (
        System.load(archive(tmp_path, structure(outer), {"a": described})).start(f"a.{name}") == 9
    )
