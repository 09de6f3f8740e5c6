"""What goes to another process: also what a script defines, where cloudpickle is there."""

import pickle
import subprocess
import sys

import pytest
from grasp_cosim.base.pickles import as_bytes

SCRIPT = """
import pickle, sys
from grasp_cosim.base.pickles import as_bytes

SCALE = 3

class Twice:
    def of(self, x):
        return 2 * x

def own(x):
    return SCALE * Twice().of(x)

sys.modules.update({NAME: None} if (NAME := "".join(sys.argv[1:])) else {})
try:
    sys.stdout.buffer.write(as_bytes((own, [1, "a"])))
except pickle.PicklingError as error:
    print(error)
"""


def written(tmp_path, *without):
    (tmp_path / "script.py").write_text(SCRIPT)
    program = [sys.executable, tmp_path / "script.py", *without]
    return subprocess.run(program, capture_output=True, check=True).stdout


def test_what_a_script_defines_goes_by_its_value(tmp_path):
    own, rest = pickle.loads(written(tmp_path))
    assert (own(7), rest) == (42, [1, "a"])


def test_without_cloudpickle_it_is_refused_here_rather_than_there(tmp_path):
    assert written(tmp_path, "cloudpickle") == b"own is of a script or a notebook\n"


def test_what_is_found_there_goes_by_its_name():
    assert b"cloudpickle" not in as_bytes(subprocess.run)
    assert pickle.loads(as_bytes(subprocess.run)) is subprocess.run
    with pytest.raises(TypeError, match="cannot pickle"):
        as_bytes(sys.stdout)
