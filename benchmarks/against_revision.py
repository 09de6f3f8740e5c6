"""What the FMUs' macro step costs against that of an earlier revision, in one run.

    python -m benchmarks.against_revision 0b702d1

Builds the FMUs of both revisions and runs them alternately, in short chunks, behind today's master,
compiled where there is a C compiler.
"""

import os
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path

from grasp_cosim import System, simulate
from grasp_cosim.grasp.presets import SYSTEM
from grasp_fmus.build import build

REPOSITORY = Path(__file__).parent.parent
SOURCES = ("plant", "sensor", "controller", "fmus", "orchestrator")
WARM_UP = 5
"""Steps before each measurement that bring the FMUs' code back into the processor's caches."""

STEPS = 25
CHUNKS = 800
STOP = 10.0
"""s of simulated time; no measurement reaches it."""

BUILD = "import sys, pathlib, grasp_fmus.build; grasp_fmus.build.build(pathlib.Path(sys.argv[1]))"


def build_revision(revision: str, tree: Path, out: Path) -> None:
    """The FMUs of a revision, built by its own sources."""
    git = ["git", "-C", str(REPOSITORY), "worktree"]
    subprocess.run([*git, "add", "--quiet", "--detach", str(tree), revision], check=True)
    try:
        path = os.pathsep.join(str(tree / source) for source in SOURCES)
        subprocess.run(
            [sys.executable, "-c", BUILD, str(out)],
            env={**os.environ, "PYTHONPATH": path},
            check=True,
        )
    finally:
        subprocess.run([*git, "remove", "--force", str(tree)], check=True)


def compare(before: Path, now: Path) -> None:
    """Print a macro step's time before and now, and the ratio, at the best and in the middle."""
    with ExitStack() as stack:
        sessions = [
            stack.enter_context(simulate.session(System.load(SYSTEM, folder), stop=STOP))
            for folder in (before, now)
        ]
        times: list[list[float]] = [[], []]
        for _ in range(CHUNKS):
            for session, measured in zip(sessions, times, strict=True):
                session.step(WARM_UP)
                start = time.perf_counter()
                session.step(STEPS)
                measured.append((time.perf_counter() - start) / STEPS)
    for label, share in (("best", 0.0), ("quartile", 0.25), ("median", 0.5)):
        old, new = (sorted(measured)[int(share * CHUNKS)] for measured in times)
        print(
            f"{label:9s} {1e6 * old:6.1f} us before, {1e6 * new:6.1f} us now: {new / old - 1:+.1%}"
        )


def main() -> None:
    """Compare with the revision named on the command line."""
    with tempfile.TemporaryDirectory() as folder:
        before, now = Path(folder, "before"), Path(folder, "now")
        build_revision(sys.argv[1], Path(folder, "tree"), before)
        build(now)
        compare(before, now)


if __name__ == "__main__":
    main()
