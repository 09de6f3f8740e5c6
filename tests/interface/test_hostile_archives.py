"""Archives and descriptions that are damaged, or made to do harm, are refused in one line."""

import io
import re
import struct
import zipfile
from contextlib import suppress

import pytest
from grasp_cosim.base.errors import InputError
from grasp_cosim.cli import main
from grasp_cosim.grasp.presets import SYSTEM
from grasp_cosim.inspection.declarations import inspect_fmu
from grasp_cosim.inspection.loading import examine, unpack
from grasp_cosim.interface import attributes, model_description
from grasp_cosim.interface.read import describe, read_interface
from grasp_cosim.ssp.to_archive import write_ssp
from hypothesis import HealthCheck, given
from hypothesis import strategies as st
from ssp.hand_made import described
from support.marks import examples

HEAD = '<fmiModelDescription fmiVersion="2.0" modelName="M" guid="{1}">'
TAIL = '<CoSimulation modelIdentifier="m"/></fmiModelDescription>'
PLAIN = f"{HEAD}<ModelVariables/>{TAIL}"


@pytest.fixture
def write(tmp_path):
    """Writes an FMU of a description."""
    return lambda description: described(tmp_path / "x.fmu", description)


def refused(path, *words):
    """By every reader, in one line that begins with the file."""
    for reader in (describe, read_interface, inspect_fmu, examine):
        with pytest.raises(InputError) as caught:
            reader(path)
        assert str(caught.value).startswith(f"{path}: not a readable FMU: "), caught.value
        assert len(str(caught.value).splitlines()) == 1
        assert all(word in str(caught.value) for word in words), caught.value


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("modelDescription.xml", "modelDescription.xml has 2000000 bytes; must have at most"),
        ("resources/zeros", f"its files have {2_000_000 + len(PLAIN)} bytes unpacked; must have"),
    ],
)
def test_what_is_too_large_is_not_unpacked(tmp_path, monkeypatch, name, message):
    files = {"modelDescription.xml": PLAIN, name: bytes(2_000_000)}
    with zipfile.ZipFile(tmp_path / "x.fmu", "w", zipfile.ZIP_DEFLATED) as archive:
        for entry, content in files.items():
            archive.writestr(entry, content)
    monkeypatch.setattr(model_description, "MAX_DESCRIPTION_BYTES", 1_000_000)
    monkeypatch.setattr(model_description, "MAX_UNPACKED_BYTES", 1_000_000)
    monkeypatch.setattr(zipfile.ZipFile, "open", None)
    refused(tmp_path / "x.fmu", message)


def test_a_directory_that_lies_yields_no_more_than_it_says(write):
    """A zip file whose directory has a small size for a description that unpacks to more."""
    path = write(PLAIN + " " * 10_000)
    data = bytearray(path.read_bytes())
    for signature, offset in ((b"PK\x01\x02", 24), (b"PK\x03\x04", 22)):
        at = data.index(signature) + offset
        assert struct.unpack_from("<I", data, at)[0] == len(PLAIN) + 10_000
        struct.pack_into("<I", data, at, 100)
    path.write_bytes(bytes(data))
    refused(path)


def variable(attributes, type_="Real"):
    return f"<ScalarVariable {attributes}><{type_}/></ScalarVariable>"


def declared(*variables):
    return f"{HEAD}<ModelVariables>{''.join(variables)}</ModelVariables>{TAIL}"


def declared_3(*variables):
    return declared(*variables).replace('"2.0"', '"3.0"').replace("guid", "instantiationToken")


def nested(depth):
    return f"{HEAD}{'<a>' * (depth - 1)}{'</a>' * (depth - 1)}<ModelVariables/>{TAIL}"


LAUGHS = "".join(f'<!ENTITY a{i + 1} "{f"&a{i};" * 10}">' for i in range(9))
LAUGHS = f'<!DOCTYPE d [<!ENTITY a0 "ha">{LAUGHS}]>' + PLAIN.replace('"M"', '"&a9;"')
UTF_16 = f'<?xml version="1.0" encoding="utf-16"?><!DOCTYPE d SYSTEM "file:///a">{PLAIN}'
REFERENCES = (str(2**32), "-1", "1.0", "1_0", "\u0663", "9" * 5000)
ENTITY = "has a document type 'd', which may define entities"
SAME = (f'<Float64 name="{n}" valueReference="7"/>' for n in "ab")
REFUSED = [
    *(
        (nested(n), f"more than {model_description.MAX_DEPTH} elements deep")
        for n in (257, 200_000)
    ),
    (LAUGHS, ENTITY),
    (UTF_16.encode("utf-16"), ENTITY),
    *(
        (
            declared(variable(f'name="a" valueReference="{r}"')),
            f"variable 'a': valueReference = '{r}': must be a whole number from 0 to",
        )
        for r in REFERENCES
    ),
    (declared(variable('name="a"')), "variable 'a': valueReference = missing"),
    *(
        (declared(variable(f'name="a{c}b" valueReference="1"')), "must have no control characters")
        for c in ("&#10;", "\x7f", "\x9b", "\u2028")
    ),
    (
        declared(variable(f'name="{"x" * 2001}" valueReference="1"')),
        f"2001 characters; must have at most {attributes.MAX_NAME_LENGTH}",
    ),
    (declared_3(*SAME), "variables 'a' and 'b' have the valueReference 7 both; must be unique"),
]


@pytest.mark.parametrize(("description", "message"), REFUSED)
def test_a_description_that_is_refused(write, description, message):
    refused(write(description), message)


@pytest.mark.parametrize(
    ("description", "names"),
    [
        (nested(model_description.MAX_DEPTH), []),
        (declared(variable(f'name="a" valueReference="{2**32 - 1}"')), ["a"]),
        (declared(variable('name="Größe.圧力[1]" valueReference="1"')), ["Größe.圧力[1]"]),
        (PLAIN.replace('"m"', '"Größe-1.0 b"'), []),  # the name of its binary
    ],
)
def test_a_description_that_is_taken(write, description, names):
    assert list(read_interface(write(description)).by_name) == names


@pytest.mark.parametrize("alias", ["x", "y"])
def test_an_alias_of_a_name_that_is_taken(write, alias):
    """A dependency on it would be on one of them, unsaid on which."""
    x = f'<Float64 name="x" valueReference="0"><Alias name="{alias}"/></Float64>'
    found = read_interface(write(declared_3(x, '<Float64 name="y" valueReference="1"/>')))
    assert found.ambiguous == (alias,)
    assert alias not in found.by_name


def test_more_elements_than_an_fmu_has(write, monkeypatch):
    monkeypatch.setattr(model_description, "MAX_XML_ELEMENTS", 100)
    assert read_interface(write(f"{HEAD}{'<a/>' * 97}<ModelVariables/>{TAIL}")).identifier == "m"
    refused(write(f"{HEAD}{'<a/>' * 98}<ModelVariables/>{TAIL}"), "more than 100 elements")


def two(one, other, type_="Real"):
    return declared(
        variable(f'name="a" valueReference="7" causality="{one}"'),
        variable(f'name="b" valueReference="7" causality="{other}"', type_),
    )


def start(type_, text):
    return declared_3(f'<{type_} name="a" valueReference="7" causality="input" start="{text}"/>')


BOTH = "the valueReference 7 both; one of them at most may be set"
BINARIES = ("", "../../tmp/evil", "a\\b", "C:evil", "..", "a&#10;b")
NOT_RUN = [
    *((PLAIN.replace('"m"', f'"{name}"'), "must be the name of its binary") for name in BINARIES),
    (two("input", "input"), BOTH),  # setting one would set the other
    (two("input", "parameter"), BOTH),
    (two("parameter", "parameter"), ""),
    (two("input", "output"), ""),  # two names of one
    (two("input", "input", "Integer"), ""),  # the references of a type are its own
    (start("Float64", "abc"), "variable 'a': start = 'abc': must be a number"),
    (start("Int8", "127"), ""),
    (start("Int8", "128"), "variable 'a': start = 128: must be from -128 to 127, as Int8 is"),
    (start("UInt64", "-1"), "start = -1: must be from 0 to 18446744073709551615"),
    (start("Int32", "1.5"), "variable 'a': start = '1.5': must be a whole number"),
    (start("Int64", "9" * 5000), "99': must be a whole number"),
]


@pytest.mark.parametrize(("description", "message"), NOT_RUN)
def test_what_no_master_takes(write, description, message):
    path = write(description)
    assert bool(describe(path).flaw) == bool(message)
    if message:
        with pytest.raises(InputError, match=re.escape(message)):
            read_interface(path)


@pytest.mark.parametrize("name", ["binaries/../../x", "/tmp/x"])
def test_an_entry_that_leads_out_of_the_folder_is_refused(name, write):
    path = write(PLAIN)
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr(name, "")
    refused(path, f"{name} leads out of the archive; must be the path of a file in it")


@pytest.mark.parametrize("name", ["../../x", "C:\\x", "a\\..\\..\\x", "x\0y", "~/x"])
def test_no_entry_leads_out_of_the_folder(tmp_path, name, write):
    path, inside = write(PLAIN), tmp_path / "out" / "side" / "folder"
    with zipfile.ZipFile(path, "a") as archive:
        info = zipfile.ZipInfo("x")
        info.filename, info.external_attr = name, 0o120777 << 16
        archive.writestr(info, "/etc/passwd")
    before = {p for p in tmp_path.rglob("*") if inside not in p.parents}
    inside.mkdir(parents=True)
    with suppress(InputError):
        unpack(path, inside)
    left = {p for p in tmp_path.rglob("*") if inside not in p.parents} - before
    assert left == {inside, *inside.parents} - {tmp_path, *tmp_path.parents}
    assert not any(p.is_symlink() for p in inside.rglob("*"))


WORDS = st.sampled_from(
    [
        *("", "x", "../x", "plant.gap[1]", "a -> b", "\x1b[2J", "\u202e", "x" * 5000, "%s%n"),
        *(
            "nan",
            "1e999",
            "-1",
            "4294967296",
            "9" * 5000,
            "1e-320",
            "true",
            "none",
            "process",
            "Real",
        ),
    ]
)
NAMES = st.sampled_from(
    [
        *("../outside", "/tmp/outside", "C:\\outside", "a\\b", "x" * 300, "a/" * 200 + "b", "\x01"),
        *("modelDescription.xml", "./modelDescription.xml", "SystemStructure.ssd", ""),
    ]
)


@st.composite
def texts(draw, text):
    """A text some of whose words, numbers and values are others."""
    places = [m.span() for m in re.finditer(r'(?<=")[^"\n]*(?=")|[\w.+-]+', text)]
    for _ in range(draw(st.integers(1, 3))):
        start, end = draw(st.sampled_from(places))
        text = text[:start] + draw(WORDS) + text[end:]
    return text


@st.composite
def damaged(draw, data):
    """A file with bytes that were changed, lost, doubled or put in, or without its end."""
    for _ in range(draw(st.integers(1, 3))):
        at = draw(st.integers(0, len(data)))
        length = draw(st.sampled_from([1, 2, 8, 100]))
        put = draw(st.sampled_from([b"", b"\0", b"\xff" * 8, data[at : at + length] * 2]))
        data = data[:at] + put + data[at + length :]
    return data[: draw(st.integers(0, len(data)))] if draw(st.integers(0, 9)) == 0 else data


@st.composite
def archives(draw, data):
    """An archive with its bytes, its entries, their names or their texts changed."""
    if draw(st.booleans()):
        return draw(damaged(data))
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        entries = [(info.filename, archive.read(info)) for info in archive.infolist()]
    place = draw(st.integers(0, len(entries) - 1))
    texts_of = [i for i, (name, _) in enumerate(entries) if name.endswith((".xml", ".ssd", ".ssv"))]
    name, content = entries[place]
    match draw(st.integers(0, 3)):
        case 0:
            del entries[place]
        case 1:
            entries.append((draw(NAMES), content))
        case 2:
            entries[place] = (name, draw(damaged(content)))
        case 3:
            place = draw(st.sampled_from(texts_of))
            name, content = entries[place]
            entries[place] = (name, draw(texts(content.decode())).encode())
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        for name, content in entries:
            archive.writestr(name or ".", content)
    return out.getvalue()


@pytest.fixture(scope="module")
def sound(grasp, fmus, tmp_path_factory):
    """The contents of a system file, an FMU and an archive."""
    archive = tmp_path_factory.mktemp("sound") / "grasp.ssp"
    write_ssp(grasp, archive)
    text = SYSTEM.read_text("utf-8").replace('fmu = "', f'fmu = "{fmus}/')
    fmu = (fmus / "ProximitySensor.fmu").read_bytes()
    return {"toml": text, "fmu": fmu, "ssp": archive.read_bytes()}


COMMANDS = {
    "toml": ["run", "--step", "1e-3", "--stop", "1e-3"],
    "fmu": ["inspect"],
    "ssp": ["run", "--step", "1e-3", "--stop", "1e-3", "--set", "components.plant.isolation=none"],
}


@pytest.mark.filterwarnings("ignore:Duplicate name")
@pytest.mark.parametrize("kind", ["toml", "fmu", "ssp"])
@examples(60, suppress_health_check=list(HealthCheck), deadline=None)
@given(data=st.data())
def test_a_damaged_file_ends_in_a_verdict(kind, data, sound, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    content = sound[kind]
    strategy = texts(content) if kind == "toml" else archives(content)
    file = tmp_path / f"damaged.{kind}"
    made = data.draw(strategy)
    file.write_bytes(made.encode("utf-8", "replace") if kind == "toml" else made)
    code = main([COMMANDS[kind][0], file.name, *COMMANDS[kind][1:]])
    said = [s for s in capsys.readouterr().err.splitlines() if s.startswith("grasp-cosim: ")]
    assert code in (0, 1, 2, 3)
    assert len(said) == (code >= 2), said
    assert not any("--debug shows where" in line or "Traceback" in line for line in said)
    assert [path.name for path in tmp_path.iterdir()] == [file.name]
