"""The headers of native FMUs: none in a circle; each has what it needs, or says what it lacks."""

import re
import subprocess
from graphlib import TopologicalSorter
from pathlib import Path

import pytest
from support.native_fmus import needs_gcc

FOLDER = Path(__file__).parents[3] / "fmus/grasp_fmus/native/c"
HEADERS = {file.name: file.read_text("utf-8") for file in FOLDER.glob("*.h")}
INCLUDES = {
    name: [other for other in re.findall(r'#include "(.+)"', text) if other in HEADERS]
    for name, text in HEADERS.items()
}
COMPILER = ("gcc", "-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Wno-unused-function")


def lacks(name):
    """Whether a header, or one of those that it includes, says what must stand before it."""
    says = re.search(r"\bincluded\b", HEADERS[name].partition("*/")[0])
    return bool(says) or any(map(lacks, INCLUDES[name]))


def test_no_headers_include_each_other_in_a_circle():
    assert "slave.h" in INCLUDES["block_slave.h"]
    TopologicalSorter(INCLUDES).prepare()  # CycleError where there is one


@needs_gcc
@pytest.mark.parametrize("name", sorted(HEADERS))
def test_a_header_compiles_by_itself_or_says_what_it_lacks(name):
    options = ["-D_POSIX_C_SOURCE=200809L", f"-I{FOLDER / 'headers'}", "-fsyntax-only"]
    source = f'#include "{FOLDER / name}"\n'
    done = subprocess.run(
        [*COMPILER, *options, "-x", "c", "-"], input=source, text=True, stderr=subprocess.PIPE
    )
    assert (done.stderr != "") == lacks(name), done.stderr
