"""String outputs are recorded like any other: in both engines, from any FMU, read back the same."""

import pytest
from grasp_cosim import System, load_run, simulate
from grasp_cosim.cli import main
from support.compiled import pack
from support.marks import engines, needs_compiler, slow
from support.mocks import Mock, Run, make_system
from support.native_fmus import TYPES, Model, _native, build, description, library_of, needs_gcc

ENGINES = ("python", "compiled")
STARTS = {"Boolean": "false", "String": "'at rest'", "Enumeration": "1"}
TEXTS = ("=1+1", 'a "b", c\r\n\\n', "\x1b[31mred\u202e", "", "ü\u2028", "@x", "1.5", "nan")
"""What a String may be changed to, one at each step."""


@engines
def test_a_text_that_changes_at_every_own_step(tmp_path, engine):
    mock = Mock(tmp_path, "a", lambda u, t: f"t = {t:g}", "String")
    run = Run(make_system([mock], [], own={"a": 200_000_000}), [mock], engine)
    first, second = "t = 0", "t = 0.2"
    texts = {"a.y": [first, first, second, second, "t = 0.4"]}
    assert run.to_the_end() == texts


def changing(folder, version, isolation, scheme="sequential"):
    """Two FMUs, from one of which a String goes to the other; it is another at every 0.1 s."""
    fmu = build(folder, version=version)
    system = ""
    for name, without in (("a", ""), ("b", "String")):
        inputs = [t for t in TYPES[version] if t != without]
        values = ", ".join(f"u_{t} = {STARTS.get(t, '0')}" for t in inputs)
        system += (
            f'[components.{name}]\nfmu = "{fmu.name}"\nisolation = "{isolation}"\n'
            f"values = {{ {values} }}\n"
        )
    for k, text in enumerate(TEXTS):
        escaped = "".join(f"\\U{ord(c):08x}" for c in text)
        system += f'[[events]]\nat = {0.1 * k:.1f}\nset = {{ "a.u_String" = "{escaped}" }}\n'
    path = folder / "changing.toml"
    path.write_text(
        'connections = ["a.y_String -> b.u_String"]\n[experiment]\nstep = 0.1\n'
        f'stop = {0.1 * len(TEXTS):.1f}\nscheme = "{scheme}"\n{system}',
        "utf-8",
    )
    return System.load(path)


@needs_compiler
@needs_gcc
@pytest.mark.parametrize("scheme", ["sequential", "jacobi"])
@pytest.mark.parametrize(
    ("version", "isolation"), [("2.0", "none"), ("3.0", "none"), slow("3.0", "process")]
)
def test_native_fmus_and_what_is_read_back(tmp_path, version, isolation, scheme):
    system = changing(tmp_path, version, isolation, scheme)
    for engine in ENGINES:
        result = simulate(system, engine=engine)
        result.to_csv(tmp_path / engine / "signals.csv")
        result.to_json(tmp_path / engine / "run.json")
        late = ["at rest"] * (scheme == "jacobi")
        assert result["a.y_String"].tolist() == ["at rest", *TEXTS]
        assert result["b.y_String"].tolist() == ["at rest", *late, *TEXTS][: len(result.time)]
        back = load_run(tmp_path / engine)
        assert list(back) == list(result)
        for name in result:
            assert back[name].dtype == result[name].dtype
            assert back[name].tolist() == result[name].tolist()
    one, two = ((tmp_path / engine / "signals.csv").read_bytes() for engine in ENGINES)
    assert one == two
    assert len(one.splitlines()) == 2 + len(TEXTS)


@needs_gcc
def test_a_session_has_the_text_of_now(tmp_path):
    with simulate.session(changing(tmp_path, "3.0", "none")) as session:
        assert session.text("b.y_String") == "at rest"
        assert session.step()
        assert session.text("b.y_String") == TEXTS[0]


@needs_gcc
def test_null_and_bytes_that_are_no_text(tmp_path):
    from grasp_cosim.fmi.loaded import _OF_KIND

    assert [_OF_KIND["String"](v) for v in (None, b"\xff", "x")] == ["", "\ufffd", "x"]


@pytest.fixture
def unrecordable(tmp_path):
    outputs = ("y_array", "y_clock")
    kept = [v for v in _native("3.0").variables if v.causality == "parameter" or v.name in outputs]
    xml = description("native", "3.0", Model(kept, stop=None), ["CoSimulation"], {}, "{native}")
    library = library_of("native", "3.0", complete=False)
    pack(tmp_path / "arrays.fmu", "3.0", "native", xml, library)
    path = tmp_path / "arrays.toml"
    path.write_text(
        '[experiment]\nstep = 0.01\nstop = 0.1\n[components.a]\nfmu = "arrays.fmu"\n', "utf-8"
    )
    return path


@needs_gcc
def test_a_run_that_records_nothing_is_no_success(unrecordable, tmp_path, capfd):
    pytest.importorskip("asammdf")
    out = tmp_path / "out"
    assert main(["run", str(unrecordable), "--out", str(out), "--json", "--plot", "--mdf"]) == 1
    said = capfd.readouterr()
    assert '"steps": 10,' in said.out
    lines = [line for line in said.err.splitlines() if "record" in line]
    assert lines == [
        "a.y_array is of type array of String: not recorded",
        "a.y_clock is of type Clock: not recorded",
        "arrays.toml: nothing is recorded; must have an output or a local that is a Real, Integer, "
        "Boolean or String, or name another such signal under [record]",
    ]
    assert [path.name for path in out.iterdir()] == ["run.json"]
    assert "nothing is recorded" in (out / "run.json").read_text("utf-8")
