"""How many mutants of a package its tests kill: make mutants FILES=plant/gripper_plant/contact.py.

A mutant is a module with one operator, number, name or condition changed, as cosmic-ray makes
it, in a copy of the checkout. It meets the quick tests that reach the changed line until one fails:
those of the folder that mirrors the package come first, and of these the quickest. Which tests
reach a line is known from one run of them all under coverage, which `--reach FOLDER` keeps. A line
that runs only while its module is imported, or in another process, meets all tests of that folder.

A change inside of functions goes into a fork of a pytest that has imported all tests and run none
of them. Any other change is met by a new pytest.

The output has the mutants that survived, as they would stand in a change, and the score of each
package. Of a large package a sample is drawn, the same one for the same seed. Type annotations are
not run: changes of them are no mutants. Nor is a change that does not compile without a warning.
"""

import argparse
import ast
import compileall
import difflib
import gc
import multiprocessing
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import accumulate
from multiprocessing.connection import Connection
from pathlib import Path
from py_compile import PycInvalidationMode
from types import CodeType, FunctionType
from typing import Any
from xml.etree import ElementTree

import pytest
from cosmic_ray.commands.init import _all_work_items
from cosmic_ray.mutating import mutate_code
from cosmic_ray.plugins import get_operator
from cosmic_ray.work_item import MutationSpec
from coverage import CoverageData

ROOT = Path(__file__).parents[1]
ROOTS = ("plant", "sensor", "controller", "fmus", "orchestrator", "tests", "docs", ".")
MEASURED = ("plant", "sensor", "controller", "fmus", "orchestrator")
"""Folders of sources whose lines are measured."""
UNIMPORTANT = ("module-not-imported", "no-data-collected", "module-not-measured", "no-sysmon")
"""Warnings of coverage, which would fail tests."""
QUICK = "not slow and not platforms and not interop"
MAX_TEST_SECONDS = 40.0
"""How long the tests that one mutant meets took without it, at most: enough for some hundreds."""
MAX_SECONDS = 300
"""How long these may take, on a loaded machine; a mutant that needs longer hangs, and is killed."""
WORKERS = 2
NO_TEST = 5
"""The exit code of pytest where all tests that were named are left out."""
IS_FUNCTION = 0x1
"""The flag CO_OPTIMIZED of code: its names are those of a function, not of a class or a module."""


@dataclass(frozen=True)
class Mutant:
    """A changed module, and the tests that it meets."""

    package: str
    module: Path
    source: str
    changed: str
    tests: list[str]

    @property
    def compiles(self) -> bool:
        """Whether it does without a warning: what does not is a mistake that nobody overlooks."""
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            try:
                compile(self.changed, self.module, "exec")
            except (SyntaxError, SyntaxWarning):
                return False
        return True

    @property
    def difference(self) -> str:
        """How it differs from the module, as a change is printed."""
        names = (f"a/{self.module}", f"b/{self.module}")
        lines = self.source.splitlines(), self.changed.splitlines()
        return "\n".join(difflib.unified_diff(*lines, *names, "", "", 3, ""))


def tests_of(package: str) -> str:
    """The folder of tests that mirrors a module's or a package's own: tests/plant, tests/ssp."""
    parts = [p for p in Path(package).with_suffix("").parts if not p.startswith("grasp_")]
    inner = [p for p in parts if p not in ("orchestrator", "gripper_plant", "proximity_sensor")]
    folder = Path("tests", *inner)
    while not (ROOT / folder).is_dir():
        folder = folder.parent
    return folder.as_posix()


def copy_checkout(tree: Path) -> None:
    """Copy the checkout, compiled; what is compiled is told from what is stale by its content."""
    ignored = shutil.ignore_patterns(".venv", ".git", "__pycache__", "results", "dist", ".*_cache")
    shutil.copytree(ROOT, tree, ignore=ignored)
    by_content = PycInvalidationMode.CHECKED_HASH
    compileall.compile_dir(tree, quiet=2, workers=0, invalidation_mode=by_content)


def enter(tree: Path) -> None:
    """Have this process, and those that it starts, import from a copy of the checkout."""
    paths = [str(tree / root) for root in ROOTS]
    os.chdir(tree)
    sys.path[:0] = paths
    os.environ |= {"PYTHONPATH": os.pathsep.join(paths), "OPENBLAS_NUM_THREADS": "1", "CI": ""}
    os.environ["PYTEST_DEBUG_TEMPROOT"] = str(tree.parent)


def run_tests(*arguments: str, seconds: float | None = None) -> int:
    """The exit code of a separate pytest; 1 where it takes longer than allowed."""
    command = [sys.executable, "-m", "pytest", "-q", "-m", QUICK, *arguments]
    try:
        return subprocess.run(command, capture_output=True, timeout=seconds, check=False).returncode
    except subprocess.TimeoutExpired:
        return 1


class Reach:
    """Which tests reach which lines, and how long each of them takes."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def measure(self) -> None:
        """Run all quick tests under coverage, in the current folder."""
        self._folder.mkdir(parents=True)
        settings = self._folder / "settings"
        options = {
            "source": ", ".join(MEASURED),
            "relative_files": "true",
            "data_file": self._folder / "lines",
            "disable_warnings": ", ".join(UNIMPORTANT),
        }
        lines = [f"{option} = {value}" for option, value in options.items()]
        settings.write_text("\n".join(["[run]", *lines]), encoding="utf-8")
        coverage = ("--cov", f"--cov-config={settings}", "--cov-context=test", "--cov-report=")
        times = f"--junitxml={self._folder / 'times'}"
        if code := run_tests("-n", str(WORKERS), "--dist", "worksteal", times, *coverage):
            raise SystemExit(f"the tests fail without a mutant (pytest exits with {code})")

    def read(self) -> "Reach":
        """Read what was measured."""
        self._lines = CoverageData(str(self._folder / "lines"))
        self._lines.read()
        self._seconds: dict[tuple[str, str], float] = {}
        times = ElementTree.parse(self._folder / "times")  # noqa: S314 - pytest has written it
        for case in times.iter("testcase"):
            key = case.get("classname", "").replace(".", "/"), case.get("name", "")
            self._seconds[key] = float(case.get("time", 0.0))
        return self

    def seconds(self, test: str) -> float:
        """How long a test took, in s."""
        file, _, name = test.partition("::")
        return self._seconds.get((file.removesuffix(".py"), name.rpartition("::")[2]), 1.0)

    def tests(self, module: Path, lines: range, folder: str) -> list[str]:
        """The tests that reach these lines, the best ones first; the folder where none does."""
        files = self._lines.measured_files()
        file = next((f for f in files if f.endswith(module.as_posix())), module.as_posix())
        contexts_by_line = self._lines.contexts_by_lineno(file)
        contexts = {c for line in lines for c in contexts_by_line.get(line, ())}
        tests = {context.rpartition("|")[0] for context in contexts} - {""}
        best = sorted(tests, key=lambda t: (not t.startswith(f"{folder}/"), self.seconds(t), t))
        until = accumulate(map(self.seconds, best))
        in_time = [test for test, end in zip(best, until, strict=True) if end < MAX_TEST_SECONDS]
        return in_time or best[:1] or [folder]


def annotations(tree: ast.AST) -> list[tuple[tuple[int, int], tuple[int, int]]]:
    """The spans of type annotations, and of blocks that only a checker of types reads."""
    nodes: list[ast.expr | ast.stmt] = []
    for node in ast.walk(tree):
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            nodes.append(node)
        if isinstance(node, ast.arg | ast.AnnAssign) and node.annotation:
            nodes.append(node.annotation)
        if isinstance(node, ast.FunctionDef) and node.returns:
            nodes.append(node.returns)
    return [((n.lineno, n.col_offset), (n.end_lineno or 0, n.end_col_offset or 0)) for n in nodes]


def statement_lines(tree: ast.AST, line: int) -> range:
    """The lines of the statement around a line; of one that has a body, those of its head."""
    lines = range(line, line + 1)
    for node in ast.walk(tree):  # the inner ones come later
        if isinstance(node, ast.stmt) and node.lineno <= line <= (node.end_lineno or 0):
            body = getattr(node, "body", None)
            lines = range(node.lineno, body[0].lineno if body else (node.end_lineno or 0) + 1)
    return lines if line in lines else range(line, line + 1)


def mutations(package: Path) -> list[MutationSpec]:
    """All mutations of a module, or of the modules of a package, that change code that runs."""
    modules = [package] if package.is_file() else sorted(package.rglob("*.py"))
    spans = {m: annotations(ast.parse(m.read_text(encoding="utf-8"))) for m in modules}
    every = [mutation for item in _all_work_items(modules, {}) for mutation in item.mutations]
    return [
        mutation
        for mutation in every
        if not any(start <= mutation.start_pos < end for start, end in spans[mutation.module_path])
    ]


def mutant(package: str, mutation: MutationSpec, reach: Reach, folder: str) -> Mutant:
    """The mutant that a mutation makes."""
    module = mutation.module_path
    source = module.read_text(encoding="utf-8")
    operator = get_operator(mutation.operator_name)(**(mutation.operator_args or {}))
    changed = mutate_code(source, operator, mutation.occurrence)
    lines = statement_lines(ast.parse(source), mutation.start_pos[0])
    return Mutant(package, module, source, changed, reach.tests(module, lines, folder))


def outer_functions(code: CodeType) -> list[CodeType]:
    """The code of the functions of a module and its classes, without those inside of others."""
    functions = []
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            is_function = constant.co_flags & IS_FUNCTION
            functions += [constant] if is_function else outer_functions(constant)
    return functions


def without_functions(code: CodeType) -> tuple[Any, ...]:
    """What a module or a class executes itself, to compare."""
    constants = [
        (without_functions(c) if not c.co_flags & IS_FUNCTION else c.co_name)
        if isinstance(c, CodeType)
        else (type(c), repr(c))
        for c in code.co_consts
    ]
    return code.co_code, code.co_names, constants


def take_in(mutant: Mutant) -> bool:
    """Put the code of a mutant into the functions that are there; False where that cannot do."""
    path = str(mutant.module.absolute())
    original = compile(mutant.source, path, "exec")
    changed = compile(mutant.changed, path, "exec")
    if without_functions(original) != without_functions(changed):
        return False
    pairs = zip(outer_functions(original), outer_functions(changed), strict=True)
    new_code = {old: new for old, new in pairs if old != new}
    functions = [
        function
        for function in gc.get_objects()
        if isinstance(function, FunctionType) and function.__code__ in new_code
    ]
    if len({function.__code__ for function in functions}) < len(new_code):
        return False
    for function in functions:
        function.__code__ = new_code[function.__code__]
    return True


@dataclass
class Trial:
    """A plugin of pytest: forks that have imported all tests meet one mutant each."""

    mutants: list[Mutant]
    results: Connection

    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        """In the place of running the tests that were collected."""
        for mutant in self.mutants:
            with self._written(mutant):
                killed = self._in_fork(session, mutant)
                if killed is None:
                    code = run_tests("-x", "-p", "no:xdist", *mutant.tests, seconds=MAX_SECONDS)
                    killed = code not in (0, NO_TEST)
            self.results.send((mutant, killed))
        return True

    @contextmanager
    def _written(self, mutant: Mutant) -> Iterator[None]:
        """For processes that a test starts the mutant is in the file of its module."""
        mutant.module.write_text(mutant.changed, encoding="utf-8")
        yield
        mutant.module.write_text(mutant.source, encoding="utf-8")

    def _in_fork(self, session: pytest.Session, mutant: Mutant) -> bool | None:
        """Whether a mutant is killed in a fork; None where it cannot be met there."""
        items = [
            item
            for test in mutant.tests
            for item in session.items
            if item.nodeid == test or item.nodeid.startswith((f"{test}/", f"{test}::"))
        ]
        if not items:
            return None
        if sys.platform == "win32":
            raise SystemExit("mutants meet tests in forks, which Windows does not have")
        process = os.fork()
        if not process:
            os.setpgid(0, 0)
            try:
                os._exit(self._meet(session, mutant, items))
            finally:  # where a mutant ends even what runs the tests
                os._exit(1)
        deadline = time.monotonic() + MAX_SECONDS
        while True:
            ended, status = os.waitpid(process, os.WNOHANG)
            if ended:
                break
            if time.monotonic() > deadline:
                os.killpg(process, signal.SIGKILL)
            time.sleep(0.02)
        code = os.waitstatus_to_exitcode(status)
        return None if code == NO_TEST else code != 0

    def _meet(self, session: pytest.Session, mutant: Mutant, items: list[pytest.Item]) -> int:
        """Run tests on a mutant, until one fails; the exit code of the fork."""
        if not take_in(mutant):
            return NO_TEST
        for item, following in zip(items, [*items[1:], None], strict=True):
            item.config.hook.pytest_runtest_protocol(item=item, nextitem=following)
            if session.testsfailed:
                return 1
        return 0


def work(tree: Path, mutants: list[Mutant], results: Connection) -> None:
    """Meet mutants, one after the other, in its own process."""
    enter(tree)
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, 1)
    os.dup2(null, 2)
    tests = sorted({test.partition("::")[0] for mutant in mutants for test in mutant.tests})
    options = ["-q", "-m", QUICK, "-p", "no:xdist", "-p", "no:cov"]
    pytest.main([*options, *tests], plugins=[Trial(mutants, results)])
    results.close()


def outcomes(trees: list[Path], mutants: list[Mutant]) -> list[tuple[Mutant, bool]]:
    """Each mutant, and whether it was killed, by a process for each tree."""
    context = multiprocessing.get_context("spawn")

    def share(worker: int) -> list[tuple[Mutant, bool]]:
        receiver, sender = context.Pipe(duplex=False)
        own = mutants[worker :: len(trees)]
        process = context.Process(target=work, args=(trees[worker], own, sender))
        process.start()
        sender.close()
        done = []
        try:
            while True:
                done.append(receiver.recv())
        except EOFError:
            process.join()
        if len(done) < len(own):
            raise SystemExit(f"a worker ended after {len(done)} of {len(own)} mutants")
        return done

    with ThreadPoolExecutor(len(trees)) as pool:
        return [outcome for part in pool.map(share, range(len(trees))) for outcome in part]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("packages", nargs="+", help="modules or packages, by path in the checkout")
    parser.add_argument("--tests", help="what to run first [the folder that mirrors the package]")
    parser.add_argument(
        "--sample", type=int, default=200, help="mutants of a package at most [200]"
    )
    parser.add_argument("--seed", type=int, default=1, help="which of them [1]")
    parser.add_argument("--reach", type=Path, help="keep there what the tests reach, or take it")
    arguments = parser.parse_args()
    for package in arguments.packages:
        if not (ROOT / package).exists():
            parser.error(f"{package}: must be a module or a package, like plant/gripper_plant")
    os.chdir(ROOT)
    with tempfile.TemporaryDirectory(prefix="grasp_mutants_") as name:
        trees = [Path(name, str(worker), "tree") for worker in range(WORKERS)]
        for tree in trees:
            copy_checkout(tree)
        folder = (arguments.reach or Path(name, "reach")).absolute()
        if not folder.exists():
            enter(trees[0])
            Reach(folder).measure()
            os.chdir(ROOT)
        reach = Reach(folder).read()
        for package in arguments.packages:
            every = mutations(Path(package))
            draw = random.Random(arguments.seed)  # noqa: S311 - no secret
            drawn = draw.sample(every, min(arguments.sample, len(every)))
            first = arguments.tests or tests_of(package)
            mutants = [mutant(package, mutation, reach, first) for mutation in drawn]
            mutants = [mutant for mutant in mutants if mutant.compiles]
            results = outcomes(trees, mutants)
            survivors = [m for m, killed in results if not killed]
            print(*(m.difference for m in survivors), sep="\n")
            killed = len(results) - len(survivors)
            score = f"{killed} of {len(results)} mutants killed, {killed / len(results):.1%}"
            print(f"{package}: {score} (of {len(every)} that could be made; seed {arguments.seed})")
            sys.stdout.flush()


if __name__ == "__main__":
    main()
