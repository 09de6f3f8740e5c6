"""Archives and descriptions made to do harm, or to deceive, are refused in one line."""

import struct
import zipfile
from contextlib import suppress

import pytest
from grasp_cosim.base.errors import InputError
from grasp_cosim.inspection.inspection import inspect_fmu
from grasp_cosim.inspection.loading import examine, unpack
from grasp_cosim.interface import document, read
from grasp_cosim.interface.read import describe, read_interface
from support.marks import slow

HEAD = '<fmiModelDescription fmiVersion="2.0" modelName="M" guid="{1}">'
TAIL = '<CoSimulation modelIdentifier="m"/></fmiModelDescription>'
PLAIN = f"{HEAD}<ModelVariables/>{TAIL}"
GIGABYTE = 1 << 30


@pytest.fixture
def write(tmp_path):
    """Writes an FMU of a description."""

    def fmu(description):
        with zipfile.ZipFile(tmp_path / "x.fmu", "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr("modelDescription.xml", description)
        return tmp_path / "x.fmu"

    return fmu


def refused(path, *words):
    """By every reader, in one line that begins with the file."""
    for reader in (describe, read_interface, inspect_fmu, examine):
        with pytest.raises(InputError) as caught:
            reader(path)
        assert str(caught.value).startswith(f"{path}: not a readable FMU: "), caught.value
        assert len(str(caught.value).splitlines()) == 1
        assert all(word in str(caught.value) for word in words), caught.value


def of_zeros(path, name, size, description=""):
    """An FMU with a file of that many zeros, and the description if one is given."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        if description:
            archive.writestr("modelDescription.xml", description)
        with archive.open(name, "w", force_zip64=True) as file:
            chunk = bytes(1 << 20)
            for _ in range(size >> 20):
                file.write(chunk)
    return path


@pytest.mark.slow
def test_a_description_of_a_gigabyte_is_not_unpacked(tmp_path, monkeypatch):
    path = of_zeros(tmp_path / "x.fmu", "modelDescription.xml", GIGABYTE)
    assert path.stat().st_size < 6_000_000
    monkeypatch.setattr(zipfile.ZipFile, "open", None)
    refused(path, f"modelDescription.xml has {GIGABYTE} bytes; must have at most 100000000")


@pytest.mark.slow
def test_a_gigabyte_in_all_is_not_unpacked(tmp_path, monkeypatch):
    path = of_zeros(tmp_path / "x.fmu", "resources/zeros", GIGABYTE, PLAIN)
    assert path.stat().st_size < 6_000_000
    monkeypatch.setattr(zipfile.ZipFile, "open", None)
    refused(path, f"its files have {GIGABYTE + len(PLAIN)} bytes unpacked; must have at most 5")


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


@pytest.mark.parametrize("depth", [document.DEEPEST + 1, 200_000])
def test_elements_too_deep(write, depth):
    inside = depth - 1
    deep = f"{HEAD}{'<a>' * inside}{'</a>' * inside}<ModelVariables/>{TAIL}"
    refused(write(deep), f"more than {document.DEEPEST} elements deep")


def test_elements_as_deep_as_allowed(write):
    inside = document.DEEPEST - 1
    deep = f"{HEAD}{'<a>' * inside}{'</a>' * inside}<ModelVariables/>{TAIL}"
    assert read_interface(write(deep)).identifier == "m"


LAUGHS = "".join(f'<!ENTITY a{i + 1} "{f"&a{i};" * 10}">' for i in range(9))


@pytest.mark.parametrize(
    "doctype",
    [
        f'<!DOCTYPE d [<!ENTITY a0 "ha">{LAUGHS}]>',
        '<!DOCTYPE d SYSTEM "file:///etc/passwd">',
        '<!DOCTYPE d [<!ENTITY a9 SYSTEM "file:///etc/hostname">]>',
        "<!DOCTYPE d []>",
    ],
)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
def test_a_document_type_is_refused(write, doctype, encoding):
    named = PLAIN.replace('modelName="M"', 'modelName="&a9;"') if "a9" in doctype else PLAIN
    text = f'<?xml version="1.0" encoding="{encoding}"?>{doctype}{named}'
    refused(write(text.encode(encoding)), "has a document type 'd', which may define entities")


def test_an_encrypted_archive(write):
    path = write(PLAIN)
    data = bytearray(path.read_bytes())
    for signature, offset in ((b"PK\x01\x02", 8), (b"PK\x03\x04", 6)):
        data[data.index(signature) + offset] |= 1
    path.write_bytes(bytes(data))
    refused(path, "encrypted")


def variable(attributes):
    return f"<ScalarVariable {attributes}><Real/></ScalarVariable>"


def described(*variables):
    return f"{HEAD}<ModelVariables>{''.join(variables)}</ModelVariables>{TAIL}"


def test_two_variables_of_one_name(write):
    twice = [variable(f'name="a" valueReference="{i}"') for i in range(2)]
    found = read_interface(write(described(*twice, variable('name="b" valueReference="2"'))))
    assert found.ambiguous == ("a",)
    assert [v.name for v in found.variables] == ["b"]


@pytest.mark.parametrize("alias", ["x", "y"])
def test_an_alias_of_a_name_that_is_taken(write, alias):
    text = described(
        f'<Float64 name="x" valueReference="0"><Alias name="{alias}"/></Float64>',
        '<Float64 name="y" valueReference="1"/>',
    )
    path = write(text.replace('"2.0"', '"3.0"').replace("guid", "instantiationToken"))
    found = read_interface(path)
    assert found.ambiguous == (alias,)
    assert alias not in found.by_name


@pytest.mark.parametrize(
    "reference", [str(2**32), "-1", "x", "", "1.0", "1_0", "\u0663", "9" * 5000]
)
def test_a_value_reference_of_more_than_32_bits(write, reference):
    path = write(described(variable(f'name="a" valueReference="{reference}"')))
    refused(path, f"variable 'a': valueReference = '{reference}': must be a whole number from 0 to")


def test_no_value_reference(write):
    refused(write(described(variable('name="a"'))), "variable 'a': valueReference = missing")


def test_the_largest_value_reference(write):
    path = write(described(variable(f'name="a" valueReference="{2**32 - 1}"')))
    assert read_interface(path).by_name["a"].reference == 2**32 - 1


@pytest.mark.parametrize("character", ["&#10;", "&#9;", "&#13;", "\x7f", "\x9b", "\u2028"])
def test_a_control_character_in_a_name(write, character):
    path = write(described(variable(f'name="a{character}b" valueReference="1"')))
    refused(path, "must have no control characters")


def test_names_in_other_scripts_are_names(write):
    name = "Größe.圧力[1]"
    path = write(described(variable(f'name="{name}" valueReference="1"')))
    assert list(read_interface(path).by_name) == [name]


def test_more_elements_than_an_fmu_has(write, monkeypatch):
    monkeypatch.setattr(document, "MOST_ELEMENTS", 100)
    assert read_interface(write(f"{HEAD}{'<a/>' * 97}<ModelVariables/>{TAIL}")).identifier == "m"
    refused(write(f"{HEAD}{'<a/>' * 98}<ModelVariables/>{TAIL}"), "more than 100 elements")


@pytest.mark.slow
def test_millions_of_elements(write):
    refused(write(f"{HEAD}{'<a/>' * 3_000_000}<ModelVariables/>{TAIL}"), "1000000 elements")


@pytest.mark.parametrize("length", [read.LONGEST_NAME + 1, slow(10_000_000)])
def test_a_name_that_nobody_reads(write, length):
    path = write(described(variable(f'name="{"x" * length}" valueReference="1"')))
    refused(path, f"{length} characters; must have at most {read.LONGEST_NAME}")


@pytest.mark.parametrize(
    "identifier", ["", "../../tmp/evil", "/tmp/evil", "a\\b", "C:evil", "..", "a&#10;b"]
)
def test_a_binary_that_is_not_in_the_fmu(write, identifier):
    path = write(PLAIN.replace('modelIdentifier="m"', f'modelIdentifier="{identifier}"'))
    with pytest.raises(InputError, match=r"modelIdentifier = .*: must be the name of its binary"):
        read_interface(path)


def test_a_binary_with_a_name_of_its_tool(write):
    path = write(PLAIN.replace('modelIdentifier="m"', 'modelIdentifier="Größe-1.0 b"'))
    assert read_interface(path).identifier == "Größe-1.0 b"


def test_a_value_reference_that_two_variables_of_fmi_3_have(write):
    """A dependency on it would be on one of them, unsaid on which."""
    text = described(*(f'<Float64 name="{n}" valueReference="7"/>' for n in "ab"))
    path = write(text.replace('"2.0"', '"3.0"').replace("guid", "instantiationToken"))
    refused(path, "variables 'a' and 'b' have the valueReference 7 both; must be unique")


@pytest.mark.parametrize(
    ("one", "other", "type_", "valid"),
    [
        ("input", "input", "Real", False),
        ("input", "parameter", "Real", False),
        ("parameter", "input", "Real", False),
        ("parameter", "parameter", "Real", True),
        ("input", "output", "Real", True),  # two names of one
        ("output", "output", "Real", True),
        ("input", "input", "Integer", True),  # the references of a type are its own
    ],
)
def test_a_value_reference_of_two_inputs(write, one, other, type_, valid):
    """Setting one would set the other, too."""
    text = described(
        variable(f'name="a" valueReference="7" causality="{one}"'),
        variable(f'name="b" valueReference="7" causality="{other}"').replace("Real", type_),
    )
    if valid:
        assert len(read_interface(write(text)).variables) == 2
    else:
        with pytest.raises(InputError, match="the valueReference 7 both; one of them at most"):
            read_interface(write(text))


@pytest.mark.parametrize(
    ("type_", "start", "what"),
    [
        ("Float64", "abc", "must be a number"),
        ("Int8", "128", "must be from -128 to 127, as Int8 is"),
        ("UInt64", "-1", "must be from 0 to 18446744073709551615"),
        ("Int32", "1.5", "must be a whole number"),
        ("Int64", "9" * 5000, "must be a whole number"),
    ],
)
def test_a_start_value_beyond_its_type(write, type_, start, what):
    text = described(f'<{type_} name="a" valueReference="7" causality="input" start="{start}"/>')
    path = write(text.replace('"2.0"', '"3.0"').replace("guid", "instantiationToken"))
    with pytest.raises(InputError, match=f"variable 'a': start = .*{start}.*: {what}"):
        read_interface(path)


@pytest.mark.parametrize("name", ["../x", "binaries/../../x", "/tmp/x"])
def test_an_entry_that_leads_out_of_the_folder_is_refused(name, write):
    path = write(PLAIN)
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr(name, "")
    refused(path, f"{name} leads out of the archive; must be the path of a file in it")


@pytest.mark.parametrize(
    "name",
    ["../x", "../../x", "/tmp/x", "C:\\x", "a\\..\\..\\x", "binaries/../../x", "x\0y", "~/x"],
)
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
