"""Names, units, descriptions and messages of an FMU that mean mischief are shown, never obeyed."""

import csv
import json
import zipfile
from html import escape

import pytest
from grasp_cosim import load_run
from grasp_cosim.cli import main
from support.marks import slow
from support.native_fmus import TYPES, build, needs_gcc

NAMES = {
    "y_Float64": "=cmd|' /C calc'!A0",
    "x": '@SUM(1,1)\r\nb "q"',
    "now": "</script><img src=x onerror=alert(1)>",
    "steps": "\u202egnp.\x9b2J\u2028$mathtext_{$",
    "y_String": "-1+1\t\\",
    "y_array": "one\ngrasp-cosim: two",
}
"""The FMU's own names, and those under which they are recorded."""

STARTS = {"u_Boolean": "false", "u_String": '"=1+1\\n</script>\\u001b[2J"', "u_Enumeration": "1"}
BAD = {*map(chr, [*range(9), *range(11, 32), *range(127, 160)]), "\u202e", "\u2028"}


@pytest.fixture
def folder(tmp_path):
    fmu = build(tmp_path, "hostile", units={"x": "m"})
    with zipfile.ZipFile(fmu) as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    xml = files["modelDescription.xml"].decode()
    text = "&#13;&#10;&lt;/script&gt;&lt;b&gt;&#155;31m&#8238;"
    xml = xml.replace('name="x"', f'name="x" description="{text}"')
    xml = xml.replace('unit="m"', 'unit="=&lt;u&gt;&#155;"').replace('"native"', f'"{text}"', 1)
    with zipfile.ZipFile(fmu, "w") as archive:
        for name, data in files.items():
            archive.writestr(name, xml if name == "modelDescription.xml" else data)
    inputs = [f"u_{fmi_type}" for fmi_type in TYPES["3.0"]]
    values = "\n".join(f"{name} = {STARTS.get(name, '0')}" for name in inputs)
    rename = "\n".join(f"{json.dumps(new)} = {json.dumps(own)}" for own, new in NAMES.items())
    (tmp_path / "system.toml").write_text(
        '[experiment]\nstep = 0.1\nstop = 0.5\n[components."=2+5"]\nfmu = "hostile.fmu"\n'
        f'[components."=2+5".values]\n{values}\n[components."=2+5".rename]\n{rename}\n',
        "utf-8",
    )
    return tmp_path


@pytest.mark.slow
@needs_gcc
def test_every_writer(folder, capsys):
    pytest.importorskip("matplotlib")
    out = folder / "out"
    assert main(["run", str(folder / "system.toml"), "--out", str(out), "--plot"]) == 0
    with (out / "signals.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.reader(file))
    assert len(rows) == 7 == len((out / "signals.csv").read_bytes().splitlines())
    assert not [cell for row in rows for cell in row if cell[:1] in {"=", "@", "+", "\t", "\r"}]
    assert not [cell for cell in rows[0] if cell[:1] == "-"]

    assert "\ngrasp-cosim" not in capsys.readouterr().err  # one line is not made two
    result = load_run(out)
    recorded = {f"=2+5.{name}" for own, name in NAMES.items() if own != "y_array"}
    assert recorded <= set(result)
    assert result[f"=2+5.{NAMES['y_String']}"][0] == "=1+1\n</script>\x1b[2J"
    assert result.units[f"=2+5.{NAMES['x']}"] == "=<u>\x9b"

    assert main(["report", str(out)]) == 0
    page = (out / "report.html").read_text("utf-8")
    assert "<img" not in page
    assert "<b>\x9b" not in page
    assert "<u>" not in page
    assert escape(NAMES["now"]) in page
    said = capsys.readouterr()
    assert not BAD & set(said.out + said.err)


@needs_gcc
@pytest.mark.parametrize("more", [[], slow(["--load"])])
def test_what_is_printed(folder, more, capsys):
    main(["inspect", str(folder / "hostile.fmu"), *more])
    said = capsys.readouterr()
    assert "\\x9b" in said.out
    assert not BAD & set(said.out + said.err)
    main(["inspect", str(folder / "hostile.fmu"), *more, "--json"])
    json.loads(capsys.readouterr().out)


@needs_gcc
def test_an_error_that_names_one(folder, capsys):
    assert main(["run", str(folder / "system.toml"), "--set", "=2+5.\x1b[2J\r\n=1"]) == 2
    said = capsys.readouterr().err
    assert not BAD & set(said)
    assert said.count("\n") == 1
