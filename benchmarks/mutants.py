"""How many mutants of a module its tests kill: make mutants ROOM=plant/gripper_plant/contact.py.

cosmic-ray changes one operator, number, name or condition at a time, in a copy of the checkout, and
runs the quick tests of the folder that mirrors the module's own. Printed are the mutants that
survived, as they would stand in a change, and the score. Of a large module a sample is drawn, the
same one for the same seed.
"""

import argparse
import compileall
import os
import random
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from py_compile import PycInvalidationMode

from cosmic_ray.commands.init import _all_work_items
from cosmic_ray.mutating import mutate_and_test
from cosmic_ray.work_item import TestOutcome

ROOT = Path(__file__).parents[1]
ROOTS = ("plant", "sensor", "controller", "fmus", "orchestrator", "tests", "docs", ".")
QUICK = "not slow and not platforms and not interop"


def tests_of(room: str) -> str:
    """The folder of tests that mirrors a module's or a package's own: tests/plant, tests/ssp."""
    parts = [p for p in Path(room).with_suffix("").parts if not p.startswith("grasp_")]
    inner = [p for p in parts if p not in ("orchestrator", "gripper_plant", "proximity_sensor")]
    folder = Path("tests", *inner)
    while not (ROOT / folder).is_dir():
        folder = folder.parent
    return folder.as_posix()


def enter_copy(folder: Path) -> None:
    """Go into a copy of the checkout, compiled.

    Compiled modules are told from stale ones by what they say, as a mutant may be as long and as
    old as what it replaces.
    """
    ignored = shutil.ignore_patterns(".venv", ".git", "__pycache__", "results", "dist", ".*_cache")
    shutil.copytree(ROOT, folder, ignore=ignored)
    compileall.compile_dir(
        folder, quiet=2, workers=0, invalidation_mode=PycInvalidationMode.CHECKED_HASH
    )
    os.chdir(folder)
    paths = os.pathsep.join(str(folder / root) for root in ROOTS)
    os.environ |= {"PYTHONPATH": paths, "OPENBLAS_NUM_THREADS": "1", "CI": ""}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("room", help="a module or a package, from the top of the checkout")
    parser.add_argument("--tests", help="what to run [tests of the folder that mirrors it]")
    parser.add_argument("--sample", type=int, default=200, help="at most so many mutants [200]")
    parser.add_argument("--seed", type=int, default=1, help="which of them [1]")
    given = parser.parse_args()
    if not (ROOT / given.room).exists():
        parser.error(f"{given.room}: must be a module or a package, like plant/gripper_plant")
    room, tests = Path(given.room), given.tests or tests_of(given.room)
    command = f"{sys.executable} -m pytest -x -q -p no:xdist -m '{QUICK}' {tests}"
    with tempfile.TemporaryDirectory(prefix="grasp_mutants_") as name:
        enter_copy(Path(name, "tree"))
        start = time.monotonic()
        subprocess.run(shlex.split(command), check=True)
        allowed = 10 + 5 * (time.monotonic() - start)
        modules = [room] if room.is_file() else sorted(room.rglob("*.py"))
        every = [item.mutations for item in _all_work_items(modules, {})]
        draw = random.Random(given.seed)  # noqa: S311 - no secret
        chosen = draw.sample(every, min(given.sample, len(every)))
        found = [mutate_and_test(mutations, command, allowed) for mutations in chosen]
        os.chdir(ROOT)
    survived = [result.diff for result in found if result.test_outcome == TestOutcome.SURVIVED]
    print(*survived, sep="\n")
    killed = len(found) - len(survived)
    score = f"{killed} of {len(found)} mutants killed by {tests}, {100 * killed / len(found):.1f} %"
    print(f"{given.room}: {score} (of {len(every)} that could be made; seed {given.seed})")


if __name__ == "__main__":
    main()
