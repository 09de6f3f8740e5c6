"""What the shell completes."""

import os
import subprocess
import sys

import pytest

SOURCE, ASKED = "bash_source", "bash_complete"


@pytest.mark.parametrize(
    ("instruction", "line", "found"),
    [
        (SOURCE, "", "_grasp_cosim_completion"),
        (ASKED, "grasp-cosim r", "plain,relay\nplain,report\nplain,run\n"),
        (ASKED, "grasp-cosim run --sch", "plain,--scheme\n"),
        (ASKED, "grasp-cosim run --scheme j", "plain,jacobi\n"),
        (ASKED, "grasp-cosim report ou", "file,ou\n"),
    ],
)
def test_what_fits_is_completed(instruction, line, found):
    asks = {"_GRASP_COSIM_COMPLETE": instruction, "COMP_WORDS": line}
    done = subprocess.run(
        [sys.executable, "-P", "-m", "grasp_cosim"],
        env={**os.environ, **asks, "COMP_CWORD": str(line.count(" "))},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    assert found in done.stdout if instruction == SOURCE else found == done.stdout
