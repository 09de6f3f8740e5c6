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
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path
from py_compile import PycInvalidationMode

from cosmic_ray.work_db import WorkDB, use_db
from cosmic_ray.work_item import TestOutcome, WorkerOutcome, WorkResult

ROOT = Path(__file__).parents[1]
ROOTS = ("plant", "sensor", "controller", "fmus", "orchestrator", "tests", "docs", ".")
QUICK = "not slow and not platforms and not interop"
CONFIG = """[cosmic-ray]
module-path = "{room}"
timeout = {timeout}
test-command = "{command}"
[cosmic-ray.distributor]
name = "local"
"""


def tests_of(room: str) -> str:
    """The folder of tests that mirrors a module's or a package's own: tests/plant, tests/ssp."""
    parts = [p for p in Path(room).with_suffix("").parts if not p.startswith("grasp_")]
    inner = [p for p in parts if p not in ("orchestrator", "gripper_plant", "proximity_sensor")]
    folder = Path("tests", *inner)
    while not (ROOT / folder).is_dir():
        folder = folder.parent
    return folder.as_posix()


def sample(db: WorkDB, number: int, seed: int) -> int:
    """Leave no more than number mutants to try, those of the seed. Returns how many there were."""
    items = sorted(db.pending_work_items, key=lambda item: str(item.mutations))
    drawn = random.Random(seed).sample(items, min(number, len(items)))  # noqa: S311
    left = {item.job_id for item in drawn}
    for item in items:
        if item.job_id not in left:
            db.set_result(item.job_id, WorkResult(WorkerOutcome.SKIPPED))
    return len(items)


def outcome(db: WorkDB) -> tuple[int, list[str]]:
    """How many mutants were tried, and the changes that no test noticed."""
    results = [result for _, result in db.results if result.worker_outcome != WorkerOutcome.SKIPPED]
    survived = [r.diff or "" for r in results if r.test_outcome == TestOutcome.SURVIVED]
    return len(results), survived


def copied(folder: Path) -> dict[str, str]:
    """Put a copy of the checkout in folder, compiled; returns the environment to test it in.

    Compiled modules are told from stale ones by what they say, as a mutant may be as long and as
    old as what it replaces.
    """
    ignored = shutil.ignore_patterns(".venv", ".git", "__pycache__", "results", "dist", ".*_cache")
    shutil.copytree(ROOT, folder, ignore=ignored)
    compileall.compile_dir(
        folder, quiet=2, workers=0, invalidation_mode=PycInvalidationMode.CHECKED_HASH
    )
    paths = os.pathsep.join(str(folder / root) for root in ROOTS)
    return {**os.environ, "PYTHONPATH": paths, "OPENBLAS_NUM_THREADS": "1", "CI": ""}


def run(command: str, folder: Path, env: Mapping[str, str]) -> None:
    """Run a command in the copy. SystemExit with what it printed if it fails."""
    done = subprocess.run(command.split(), cwd=folder, env=env, capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(f"{command}: exit code {done.returncode}\n{done.stdout}{done.stderr}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("room", help="a module or a package, from the top of the checkout")
    parser.add_argument("--tests", help="what to run [tests of the folder that mirrors it]")
    parser.add_argument("--sample", type=int, default=200, help="at most so many mutants [200]")
    parser.add_argument("--seed", type=int, default=1, help="which of them [1]")
    given = parser.parse_args()
    if not (ROOT / given.room).exists():
        parser.error(f"{given.room}: must be a module or a package, like plant/gripper_plant")
    tests = given.tests or tests_of(given.room)
    with tempfile.TemporaryDirectory(prefix="grasp_mutants_") as name:
        folder, session = Path(name, "tree"), Path(name, "session.sqlite")
        env = copied(folder)
        command = f"{sys.executable} -m pytest -x -q -p no:xdist -m '{QUICK}' {tests}"
        start = time.monotonic()
        plain = f"{sys.executable} -m cosmic_ray.cli"
        config = Path(name, "config.toml")
        config.write_text(CONFIG.format(room=given.room, timeout=600, command=command))
        run(f"{plain} baseline {config}", folder, env)
        allowed = 10 + 5 * (time.monotonic() - start)
        config.write_text(CONFIG.format(room=given.room, timeout=allowed, command=command))
        run(f"{plain} init {config} {session}", folder, env)
        with use_db(session, WorkDB.Mode.open) as db:
            number = sample(db, given.sample, given.seed)
        run(f"{plain} exec {config} {session}", folder, env)
        with use_db(session, WorkDB.Mode.open) as db:
            tried, survived = outcome(db)
    print(*survived, sep="\n")
    score = 100 * (1 - len(survived) / tried)
    print(f"{given.room}: {tried - len(survived)} of {tried} mutants killed by {tests}, ", end="")
    print(f"{score:.1f} % (of {number} that could be made; seed {given.seed})")


if __name__ == "__main__":
    main()
