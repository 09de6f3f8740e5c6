"""Archives that are wrong or ask for more than this master does: one line says what, and where."""

import re
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
from grasp_cosim import InputError, System
from grasp_cosim.interface import document
from grasp_cosim.ssp.to_archive import write_ssp
from ssp.hand_made import (
    archive,
    bind,
    changed,
    component,
    connect,
    fmu,
    parameter_set,
    structure,
    system,
)

A = fmu("output Real y - m", "input Real u 0.0 m")
ELEMENT = component("a", "output y Real; input u Real")
TOP = system("top", ELEMENT)


def message_of(path):
    """The error at loading the archive, without what holds on to its files."""
    try:
        System.load(path)
    except InputError as error:
        return str(error)
    pytest.fail(f"{path} loads")


def refused(folder, ssd, **more):
    text = message_of(archive(folder, ssd, {"a": A, **more}))
    assert "\n" not in text
    assert text.startswith("hand.ssp")
    return text


DICTIONARY = (
    '<ssd:SignalDictionaries><ssd:SignalDictionary name="d" source="resources/d.ssb"/>'
    "</ssd:SignalDictionaries></ssd:System>"
)
REFUSED = [
    (
        structure(TOP, version="3.0"),
        "SystemStructure.ssd:2: SSP version '3.0'; must be '1.0' or '2.0'",
    ),
    (structure(TOP).replace("ssd:Elements", "ssd:Element"), "against the schema: Element 'ssd:El"),
    (structure(TOP)[:-9], "SystemStructure.ssd: not readable as XML: "),
    (structure(TOP).replace("?>\n", "?>\n<!DOCTYPE x []>"), "has a document type; SSP has none"),
    ("<a/>", "SystemStructure.ssd:1: a: must be ssd:SystemStructureDescription"),
    (structure('<ssd:System name="top"/>'), "system 'top' has no components; must have some"),
    (
        structure(TOP.replace("</ssd:System>", DICTIONARY)),
        "'d': source 'resources/d.ssb': not in the archive; valid: none",
    ),
    (
        structure(system("top", '<ssd:SignalDictionaryReference name="r" dictionary="d"/>')),
        "'r': no signal dictionary 'd'; valid: none",
    ),
    (
        structure(system("top", component("a", type="text/x-modelica"))),
        "component 'a': type 'text/x-modelica' is not supported; valid: application/x-fmu-shared",
    ),
    (
        structure(system("top", component("a", implementation="ModelExchange"))),
        "component 'a': implementation 'ModelExchange': resources/a.fmu has none; must be CoSim",
    ),
    (structure(system("top", ELEMENT + ELEMENT)), "system 'top': two elements 'a'; must differ"),
    (
        structure(system("top", component("a", "output y; output y"))),
        "a: two connectors 'y'; must differ",
    ),
    (
        structure(system("top", component("a", "inout y"))),
        "connector 'y': kind 'inout' is not supported",
    ),
    (
        structure(system("top", component("a", "output y Binary"))),
        "connector 'y': type 'Binary' is not supported; valid: Real, Integer",
    ),
    (
        structure(system("top", component("a", "output y Integer"))),
        "a: connector 'y': Integer; the FMU has Real",
    ),
    (
        structure(system("top", component("a", "output z Real"))),
        "a: connector 'z': a.fmu has no output of that name; valid: y",
    ),
    (
        structure(system("top", component("a", "input y Real"))),
        "a: connector 'y': a.fmu has no input of that name; valid: u",
    ),
    (
        structure(system("top", component("a", "output y Real mm"))),
        "a: connector 'y': unit mm is not what the FMU declares, m; must mean the same",
    ),
    (
        structure(system("top", component("a", "output y Real cm"))),
        "'y': unit 'cm' is not defined; valid: m, mm",
    ),
    (
        structure(TOP, '<ssd:DefaultExperiment stopTime="-2"/>'),
        "stopTime = -2.0 s: must be a number greater than 0",
    ),
    (
        structure(TOP).replace('factor="0.001"', 'factor="0"'),
        "unit 'mm': factor = 0, offset = 0: must be finite, and the factor other than 0",
    ),
    (structure(TOP, ""), "no stopTime in a DefaultExperiment; give one: --set experiment.stop"),
    (
        structure(TOP, '<ssd:DefaultExperiment stopTime="0.00025"/>'),
        "none divides the stop of 0.00025 s; give one: --set experiment.step",
    ),
    (
        structure(
            system("top", "".join(component(n, source="resources/a.fmu") for n in ("a.b", "a_b")))
        ),
        "components a.b, a_b would all be 'a_b' here; must differ",
    ),
    (
        structure(system("top", component("b"))),
        "source 'resources/b.fmu': not in the archive; did you mean resources/a.fmu?",
    ),
    *(
        (
            structure(system("top", component("a", source=source))),
            f"component 'a': source '{source}': ",
        )
        for source in (
            "../a.fmu",
            "/etc/passwd",
            "file:///a.fmu",
            "resources/a.fmu#x",
            "C:/a.fmu",
            "http:///a.fmu",
        )
    ),
]


@pytest.mark.parametrize(("ssd", "message"), REFUSED)
def test_what_is_refused(tmp_path, ssd, message):
    assert message in refused(tmp_path, ssd)


def test_an_error_names_the_line(tmp_path):
    text = structure(TOP).replace("<ssd:Component", "\n\n<ssd:Component").replace("kind=", "kid=")
    assert "SystemStructure.ssd:4: against the schema: Element 'ssd:Connector'" in refused(
        tmp_path, text
    )


def test_an_fmu_that_is_none(tmp_path):
    text = refused(tmp_path, structure(TOP), a=b"<x/>")
    assert "component 'a': resources/a.fmu: not a readable FMU: " in text


def test_a_model_exchange_fmu_is_integrated(tmp_path):
    exchange = A.replace(b"CoSimulation", b"ModelExchange")
    (part,) = System.load(archive(tmp_path, structure(TOP), {"a": exchange})).components
    assert part.integrated


def test_an_fmu_of_no_kind_of_its_version(tmp_path):
    scheduled = A.replace(b"CoSimulation", b"ScheduledExecution")
    assert "resources/a.fmu: declares no kind of FMU; ask" in refused(
        tmp_path, structure(TOP), a=scheduled
    )


def truncated(path):
    data = path.read_bytes()
    path.write_bytes(data[: len(data) // 2])


def not_a_zip(path):
    path.write_text("[experiment]")


def without_structure(path):
    with zipfile.ZipFile(path, "w") as file:
        file.writestr("resources/a.fmu", b"")


def damaged(path):
    data = bytearray(path.read_bytes())
    data[data.index(b"ssd:System ")] ^= 1  # inside the content, which is stored as it is
    path.write_bytes(data)


def encrypted(path):
    """Say of each entry, in both of its headers, that it is."""
    data = bytearray(path.read_bytes())
    for header, flags in ((b"PK\3\4", 6), (b"PK\1\2", 8)):
        for found in re.finditer(re.escape(header), data):
            data[found.start() + flags] |= 1
    path.write_bytes(data)


def missing(path):
    path.unlink()


def folder(path):
    path.unlink()
    path.mkdir()


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (truncated, "not readable as an SSP archive"),
        (not_a_zip, "not readable as an SSP archive"),
        (without_structure, "no SystemStructure.ssd in it; must be an SSP archive"),
        (damaged, "SystemStructure.ssd: not readable: Bad CRC-32"),
        (encrypted, "SystemStructure.ssd: not readable: File 'SystemStructure.ssd' is encrypted"),
        (missing, "no such system file"),
        (folder, "is a folder; must be a system, a .toml or .ssp file"),
    ],
)
def test_wrong_files(tmp_path, spoil, message):
    path = archive(tmp_path, structure(TOP), {"a": A})
    spoil(path)
    text = message_of(path)
    assert text.startswith(str(path))
    assert message in text


def test_an_archive_has_its_own_fmus(grasp, fmus, tmp_path):
    write_ssp(grasp, tmp_path / "grasp.ssp")
    with pytest.raises(InputError, match="has its own FMUs"):
        System.load(tmp_path / "grasp.ssp", fmus)


def test_an_entity_is_not_followed(tmp_path):
    secret = tmp_path / "secret"
    secret.write_text("told")
    entity = f'<!DOCTYPE x [<!ENTITY e SYSTEM "{secret.as_uri()}">]>'
    text = structure(TOP).replace("?>\n", f"?>\n{entity}").replace('name="top"', 'name="&e;"')
    assert "told" not in refused(tmp_path, text)


def test_an_entry_that_leads_out_of_the_archive_is_not_written(tmp_path):
    path = archive(tmp_path, structure(TOP), {"a": A}, {"../evil": "x", "/tmp/evil": "x"})
    assert System.load(path).components[0].fmu.name == "a.fmu"
    assert not (tmp_path.parent / "evil").exists()


def test_extracted_fmus_are_gone_when_the_process_ends(grasp, tmp_path):
    write_ssp(grasp, tmp_path / "grasp.ssp")
    program = (
        "import sys; from grasp_cosim import System; "
        "s = System.load(sys.argv[1]); t = System.load(sys.argv[1]); assert s == t; "
        "print(s.components[0].fmu.exists(), s.components[0].fmu)"
    )
    done = subprocess.run(
        [sys.executable, "-c", program, str(tmp_path / "grasp.ssp")],
        capture_output=True,
        text=True,
        check=True,
    )
    existed, _, path = done.stdout.rstrip("\n").partition(" ")
    assert existed == "True"
    assert not Path(path).parents[1].exists()


def test_a_forked_process_leaves_the_fmus_of_its_parent(grasp, tmp_path):
    write_ssp(grasp, tmp_path / "grasp.ssp")
    program = (
        "import os, sys; from grasp_cosim import System; "
        "s = System.load(sys.argv[1]); child = os.fork(); "
        "child or sys.exit(); os.waitpid(child, 0); "
        "print(s.components[0].fmu.exists())"
    )
    command = [sys.executable, "-c", program, str(tmp_path / "grasp.ssp")]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout == "True\n"


def test_all_may_read_what_is_unpacked_from_an_archive(grasp, tmp_path):
    write_ssp(grasp, tmp_path / "grasp.ssp")
    with zipfile.ZipFile(tmp_path / "grasp.ssp") as file:
        modes = {(entry.create_system, entry.external_attr >> 16) for entry in file.infolist()}
    assert modes == {(3, 0o644)}


def test_comments_and_processing_instructions_are_passed_over(tmp_path):
    plain = System.load(archive(tmp_path, structure(TOP), {"a": A}))
    for noise in ("<?tool of another maker?>", "<!-- by hand -->"):
        noisy = structure(TOP.replace("<ssd:Component", f"{noise}<ssd:Component"))
        assert System.load(archive(tmp_path, noisy, {"a": A})) == plain


def step_of(folder, *steps, start="0", stop="1"):
    names = "abc"[: len(steps)]
    fmus = {n: fmu("parameter Real p 1.0", step=s) for n, s in zip(names, steps, strict=True)}
    experiment = f'<ssd:DefaultExperiment startTime="{start}" stopTime="{stop}"/>'
    ssd = structure(system("top", "".join(map(component, names))), experiment)
    return System.load(archive(folder, ssd, fmus)).step_ns


def test_the_step_is_the_smallest_of_the_fmus_that_divides_the_stop(tmp_path):
    assert step_of(tmp_path, "0.01", "0.001", "") == 1_000_000
    assert step_of(tmp_path, "0.01", "0.0003") == 10_000_000
    assert step_of(tmp_path, "0.01", "0.0003", stop="0.9") == 300_000
    assert step_of(tmp_path, "0.01", "0.0003", start="0.1", stop="1") == 300_000
    assert step_of(tmp_path, "-1", "1e-20", "0.5") == 500_000_000
    assert step_of(tmp_path, "1.4e-9", "0.5") == 500_000_000  # no whole nanosecond


def test_a_step_and_a_stop_can_be_given(tmp_path):
    path = archive(
        tmp_path, structure(TOP, ""), {"a": fmu("output Real y -", "input Real u 0.0", step="")}
    )
    loaded = System.load(path, step=0.25, stop=2.0)
    assert (loaded.step_ns, loaded.stop_ns) == (250_000_000, 2_000_000_000)


def test_execution_follows_the_flow_of_the_data(tmp_path):
    elements = "".join(component(n, "input u; output y") for n in ("sink", "twin", "mid", "source"))
    links = connect("source/y", "mid/u") + connect("mid/y", "twin/u") + connect("twin/y", "sink/u")
    fmus = dict.fromkeys(("sink", "twin", "mid", "source"), A)
    loaded = System.load(archive(tmp_path, structure(system("top", elements, links)), fmus))
    assert [c.name for c in loaded.components] == ["source", "mid", "twin", "sink"]
    assert "order of execution: source, mid, twin, sink" in loaded.notes


def test_in_a_loop_the_order_of_the_file_holds(tmp_path):
    names = ("after", "x", "y", "before")
    elements = "".join(component(n, "input u; output y") for n in names)
    links = connect("before/y", "after/u") + connect("x/y", "y/u") + connect("y/y", "x/u")
    loaded = System.load(
        archive(tmp_path, structure(system("top", elements, links)), dict.fromkeys(names, A))
    )
    assert [c.name for c in loaded.components] == ["x", "y", "before", "after"]


def test_what_has_no_bearing_is_said(tmp_path):
    annotation = '<ssd:Annotations><ssc:Annotation type="com.maker"/></ssd:Annotations>'
    ssd = structure(TOP, annotations=annotation)
    notes = System.load(archive(tmp_path, ssd, {"a": A}, {"VariantB.ssd": ssd, "A.ssd": ssd})).notes
    for variant in ("VariantB.ssd", "A.ssd"):
        assert f"variant {variant} is not used; SystemStructure.ssd is" in notes
    assert "annotations of type 'com.maker' are not used (1)" in notes


def test_notes_are_no_part_of_what_a_system_is(tmp_path):
    quiet = archive(tmp_path, structure(TOP), {"a": A})
    first = System.load(quiet)
    loud = bind(parameter_set("none Real 1"))
    second = System.load(
        archive(tmp_path, structure(system("top", ELEMENT, bindings=loud)), {"a": A})
    )
    assert first.notes != second.notes
    assert first == second


ANNOTATED = [
    ('"scheme": "sequential"', '"scheme": "best"', "'best': must be one of sequential, jacobi"),
    ('"step_ns": 100000', '"step_ns": "fast"', "'fast': must be of type int"),
    ('"step_ns": 100000', '"step": 100000', "unknown entry 'step'; did you mean step_ns?"),
    ('"events": []', '"events": [', "not as it was written: Expecting"),
    ('"sensor_1": {', '"sensor_3": {', "annotation 'grasp-cosim' is about other components"),
    ('"step_ns": 100000', '"step_ns": 700000', "step = 0.0007 s does not divide stop = 3 s"),
]


@pytest.mark.parametrize(("before", "after", "message"), ANNOTATED)
def test_a_spoilt_annotation(grasp, tmp_path, before, after, message):
    write_ssp(grasp, tmp_path / "grasp.ssp")

    def spoil(ssd):
        assert before.encode() in ssd
        return ssd.replace(before.encode(), after.encode(), 1)

    changed(tmp_path / "grasp.ssp", spoil)
    text = message_of(tmp_path / "grasp.ssp")
    assert message in text
    assert "\n" not in text


def test_an_archive_of_which_more_would_be_unpacked_than_there_is(tmp_path, monkeypatch):
    path = archive(tmp_path, structure(TOP), {"a": A})
    with zipfile.ZipFile(path, "a", zipfile.ZIP_DEFLATED) as file:
        file.writestr("resources/zeros", bytes(1_000_000))
    monkeypatch.setattr(document, "LARGEST_UNPACKED", 100_000)
    message = message_of(path)
    assert re.search(r"its files have \d+ bytes unpacked; must have at most \d+$", message)
    assert len(message.splitlines()) == 1


def test_an_archive_whose_names_are_no_text(tmp_path):
    path = archive(tmp_path, structure(TOP), {"a": A})
    with zipfile.ZipFile(path, "a") as file:
        file.writestr("grün", b"")
    path.write_bytes(path.read_bytes().replace("grün".encode(), b"gr\xff\xffn"))
    assert "not readable as an SSP archive" in message_of(path)


@pytest.mark.parametrize(
    "ssd",
    [
        structure(system("x" * 11_000_000, ELEMENT)),
        structure(TOP.replace("<ssd:Elements>", "<ssd:Elements>" + "<a>" * 20_000)),
    ],
)
def test_what_the_parser_does_not_take_is_one_line(tmp_path, ssd):
    assert "SystemStructure.ssd: not readable as XML: " in refused(tmp_path, ssd)


def test_an_annotation_deeper_than_the_stack(tmp_path):
    text = f'<g:System xmlns:g="grasp-cosim:system">{"[" * 100_000}</g:System>'
    entry = f'<ssc:Annotation type="grasp-cosim">{text}</ssc:Annotation>'
    end = "</ssd:SystemStructureDescription>"
    ssd = structure(TOP).replace(end, f"<ssd:Annotations>{entry}</ssd:Annotations>{end}")
    assert "annotation 'grasp-cosim': not as it was written" in refused(tmp_path, ssd)


@pytest.mark.parametrize("value", ["p Real 1e999", f"k Integer {'9' * 5000}", "p Real NaN"])
def test_a_number_that_none_is(tmp_path, value):
    numbers = fmu("output Real y - m", "parameter Real p 1.0", "parameter Integer k 1")
    ssd = structure(system("top", component("a", bindings=bind(parameter_set(value)))))
    text = message_of(archive(tmp_path, ssd, {"a": numbers}))
    assert len(text.splitlines()) == 1
