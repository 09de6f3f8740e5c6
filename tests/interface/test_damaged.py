"""Damaged system files, FMUs and archives end in a verdict: an exit code, one line, no new file."""

import io
import re
import zipfile

import pytest
from grasp_cosim.cli import main
from grasp_cosim.grasp.presets import SYSTEM
from grasp_cosim.ssp.to_archive import write_ssp
from hypothesis import HealthCheck, given
from hypothesis import strategies as st
from support.marks import examples

WORDS = st.sampled_from(
    [
        *(
            "",
            "x",
            "../x",
            "plant.gap[1]",
            "a -> b",
            "\x1b[2J",
            "\u202e",
            "x" * 5000,
            "%s%n",
            "nan",
        ),
        *("1e999", "-1", "4294967296", "9" * 5000, "1e-320", "true", "none", "process", "Real"),
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
