"""What several tests share: the FMUs, built once, and the built-in system."""

import gc
import importlib
import os
import random
import shutil
import signal
import sys
import tempfile
from contextlib import contextmanager
from pathlib import Path

import fmpy
import pytest
from filelock import FileLock
from grasp_cosim import System, cli
from grasp_cosim.base import c_compilers
from grasp_cosim.fmu_export.build import build, build_native, shipped_twins
from grasp_cosim.fmu_export.shipped import SHIPPED
from grasp_cosim.grasp.presets import SYSTEM
from hypothesis import find, settings
from hypothesis import strategies as st
from support import kinds, marks
from support.fmi2 import Fmu
from support.marks import skip_without_pythonfmu

pytest_plugins = ("support.platforms",)

os.environ["XDG_CACHE_HOME"] = str(Path(sys.prefix, "cache_of_the_tests"))
"""Native FMUs are compiled once for all test processes and runs, too."""

_FMUS = Path(sys.prefix, "python_fmus_of_the_tests")

settings.register_profile("usual", deadline=None, derandomize=True, max_examples=25)
settings.register_profile(
    "explore", deadline=None, derandomize=False, max_examples=1000, print_blob=True
)  # a profile inherits what it leaves out, and where CI is set hypothesis derandomizes
settings.load_profile("usual")  # unless --hypothesis-profile names the other: make explore

if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
    # As in `sh -c 'make test &'`, and inherited: tests send Ctrl-C to themselves and to children.
    signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_addoption(parser):
    """What CI gives a new seed: a test must not need another one before it."""
    order = "run the files, and the tests of each, in an order drawn by this seed"
    parser.addoption("--shuffle", type=int, metavar="SEED", help=order)


def pytest_report_header(config):
    """The seed that draws the same order again."""
    seed = config.getoption("shuffle")
    return None if seed is None else f"order: --shuffle {seed}"


def pytest_configure(config):
    """Campaigns draw from the seed that hypothesis is given.

    Many tests read sources: each time after 700 nodes those that there are would be gone over.
    """
    marks.first_seed = int(config.getoption("hypothesis_seed") or 0)
    gc.set_threshold(50_000, 10, 10)


@pytest.hookimpl(tryfirst=True)  # before those that are slow are chosen, or left out
def pytest_collection_modifyitems(config, items):
    """The slow ones first: in the end no process waits for another for long."""
    if (seed := config.getoption("shuffle")) is not None:
        drawn_by = random.Random(seed)
        files = {item.path: drawn_by.random() for item in items}
        items.sort(key=lambda item: (files[item.path], drawn_by.random()))
    for item in items:
        drawn = getattr(getattr(item, "callspec", None), "params", {})
        kind, name = drawn.get("kind", "python"), str(drawn.get("name"))
        tier = kinds.tier(name, kind, "altered" in getattr(item, "fixturenames", ()))
        if tier != "quick" and not item.get_closest_marker("interop"):
            item.add_marker(tier)
    items.sort(key=lambda item: item.get_closest_marker("slow") is None)


def pytest_generate_tests(metafunc):
    """A test that loads FMUs runs on each kind that it, or its module, is marked with."""
    marker = metafunc.definition.get_closest_marker("kinds")
    if marker and "kind" in metafunc.fixturenames:
        metafunc.parametrize("kind", marker.args, indirect=True, scope="module")


@pytest.fixture(scope="module")
def kind(request, folder_of):
    """The kind of FMUs that load and altered give, built; by default those that Python runs."""
    chosen = getattr(request, "param", "python")
    folder_of(chosen)
    return chosen


@pytest.fixture(scope="session", autouse=True)
def _used_hypothesis():
    """It makes its generator at its first use, and complains if what holds that is frozen."""
    find(st.booleans(), bool)


@pytest.fixture(autouse=True)
def _no_lines_of_progress(monkeypatch):
    """On a loaded machine what is short may take 10 s, after which a line says that it goes on."""
    monkeypatch.setattr("grasp_cosim.base.progress.EVERY", 3600.0)


_collections = -1
"""How many there had been of all objects when it was last looked what is not frozen, if it was."""


@pytest.fixture(autouse=True)
def _frozen():
    """All that thousands of tests are made of is no garbage, nor to be looked at for some: a paced
    run, which collects it before it begins, would take half a second, and thaws it at its end.
    """
    global _collections
    collections = gc.get_stats()[2]["collections"]
    if collections != _collections:
        if _collections < 0 or len(gc.get_objects(generation=2)) > 100_000:
            gc.freeze()
        _collections = collections


@pytest.fixture(scope="session", autouse=True)
def _unpacked_once(tmp_path_factory):
    """Of the FMUs that Python runs, one and the same file is unpacked once per test process; what
    unpacks it again is given links: to make 20 files takes longer than most runs.

    The binary is copied, as the system loads a file once, whatever its paths.
    """
    kept = {}
    unpack = fmpy.extract

    def place(source, target):
        (shutil.copyfile if source.endswith((".so", ".dylib")) else os.link)(source, target)

    def extract(path, folder, *include):
        if path.parent != _FMUS or not include:
            unpack(path, folder, *include)
            return
        if path not in kept:
            kept[path] = tmp_path_factory.mktemp("unpacked")
            unpack(path, kept[path], *include)
        shutil.copytree(kept[path], folder, copy_function=place, dirs_exist_ok=True)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("fmpy.extract", extract)
        yield


@pytest.fixture
def ctrl_c():
    """SIGINT raises KeyboardInterrupt, here and in processes started here, even if it was ignored.

    A shell has background jobs ignore it, as in `make test &`, and processes inherit that.
    """
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture(scope="session")
def made_once(tmp_path_factory):
    """A folder that is filled once for all test processes: by its name, and what fills it."""
    base = tmp_path_factory.getbasetemp()
    base = base.parent if "PYTEST_XDIST_WORKER" in os.environ else base

    def folder(name, fill):
        with FileLock(base / f"{name}.lock"):
            if not (base / name).exists():
                part = tmp_path_factory.mktemp(name)
                fill(part)
                part.rename(base / name)
        return base / name

    return folder


@pytest.fixture(scope="session")
def folder_of():
    """The folder with the FMUs of these sources, by kind: built once for all test processes.

    What is not of these sources, or was altered, is made anew.
    """
    done = {}

    def folder(kind):
        if kind not in done:
            at = _FMUS.with_name(_FMUS.name.replace("python", kind.replace(" ", "_")))
            plan = None if kind == "python" else kinds.plan(kind)
            at.mkdir(exist_ok=True)
            with FileLock(at.parent / f"{at.name}.lock"):
                if plan is None:
                    build(at)
                else:
                    build_native(at, plan)
                for file in at.iterdir():  # of a block that is no longer there
                    if not file.name.startswith(tuple(f"{n}{c}" for n in SHIPPED for c in "._")):
                        file.unlink()
            done[kind] = at
        return done[kind]

    return folder


@pytest.fixture(scope="session")
def fmus(folder_of):
    """The folder with the FMUs that Python runs."""
    return folder_of("python")


@pytest.fixture(scope="session")
def natives(folder_of):
    """The folder with the native FMUs, for FMI 2.0."""
    return folder_of("native")


@pytest.fixture(scope="session")
def load_as(folder_of, tmp_path_factory):
    """An FMU by its name and kind, as an FMI host loads it, once per test process."""
    loaded = {}

    def fmu(name, kind):
        if kind == "python":
            skip_without_pythonfmu()
        if (name, kind) not in loaded:
            folder = tmp_path_factory.mktemp(name)
            own = name in kinds.OWN
            path = kinds.build_own(name, kind, folder) if own else folder_of(kind) / f"{name}.fmu"
            loaded[name, kind] = Fmu(path, folder / "unpacked")
        return loaded[name, kind]

    return fmu


@pytest.fixture(scope="module")
def load(load_as, kind):
    """An FMU by its name, of the kind that the test is run on."""
    return lambda name: load_as(name, kind)


@pytest.fixture(scope="session")
def grasp(fmus):
    """The built-in grasp, of the FMUs in Python."""
    return System.load(SYSTEM, fmus).natively(False)


@pytest.fixture
def built_in(grasp, monkeypatch):
    """Commands take the FMUs of the tests instead of building them into their folder."""
    monkeypatch.setattr("grasp_cosim.grasp.system.as_named", lambda: grasp)


@pytest.fixture
def command(monkeypatch, capsys, built_in, tmp_path):
    """Runs a command line in an empty folder; exit code, standard output, standard error."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments):
        code = cli.main([*map(str, arguments)])
        out, err = capsys.readouterr()
        return code, out, err

    return run


@pytest.fixture
def no_compiler(monkeypatch, tmp_path):
    """A machine without a compiler, on which nothing was built yet."""
    monkeypatch.setenv("PATH", str(tmp_path / "nothing"))
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setattr(c_compilers, "find_zig", lambda: None)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    shipped_twins.cache_clear()
    yield
    shipped_twins.cache_clear()


@pytest.fixture
def unpack_in(tmp_path, monkeypatch):
    """Has FMUs unpacked in a new folder of the given name; returns it."""

    def choose(name):
        folder = tmp_path / name
        folder.mkdir()
        monkeypatch.setattr(tempfile, "tempdir", str(folder))
        return folder

    return choose


@pytest.fixture
def altered(tmp_path, kind):
    """Builds the FMU of a script with one place in one source file changed."""
    return lambda *change: alter(tmp_path, kind, *change)


def alter(folder, kind, script, source, before, after):
    """Build in the folder the FMU of a script with one place in one source file changed."""
    if kind == "python":
        skip_without_pythonfmu()
    package = source.partition("/")[0]
    sources = folder / "sources"
    shutil.rmtree(sources, ignore_errors=True)
    original = Path(importlib.import_module(package).__file__ or "").parent
    shutil.copytree(original, sources / package, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(original.parent / "README.md", sources)
    text = (sources / source).read_text("utf-8")
    assert text.count(before) == 1
    (sources / source).write_text(text.replace(before, after), "utf-8")
    with _imported_from(sources, package):
        return kinds.build_shipped(script, kind, folder / "altered")


@contextmanager
def _imported_from(folder, package):
    """The package is the one in the folder."""

    def taken_out():
        names = [n for n in sys.modules if n.partition(".")[0] == package]
        return {n: sys.modules.pop(n) for n in names}

    ours = taken_out()
    sys.path.insert(0, str(folder))
    importlib.invalidate_caches()
    try:
        yield
    finally:
        sys.path.remove(str(folder))
        taken_out()
        sys.modules.update(ours)


@pytest.fixture
def checkout(tmp_path, fmus, built_in, monkeypatch):
    """A folder like the repository, as far as its pages need it, and the current one."""
    for name in ("orchestrator", "docs", "modelica", "ros2"):
        (tmp_path / name).symlink_to(Path(__file__).parents[1] / name)
    shutil.copytree(fmus, tmp_path / "fmus/build")
    monkeypatch.chdir(tmp_path)
    return tmp_path
