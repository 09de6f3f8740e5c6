"""What a process that has loaded FMUs does at its end."""

import subprocess
import sys
from zipfile import ZipFile

from support.native_fmus import needs_gcc, talker

RUN = """if True:
    import sys
    from pathlib import Path
    from grasp_cosim.fmi.load import load
    from grasp_cosim.system.parts import Component
    load(Component("a", Path(sys.argv[1]), {})).close()
    print("closed")
"""


@needs_gcc
def test_binaries_of_pythonfmu_let_go_of_python_before_it_is_gone(tmp_path):
    """By themselves they do it afterwards, in memory that was freed.

    The first of them that a process loads stays, and its file is gone by then.
    """
    function = tmp_path / "finalize.h"
    function.write_text(
        "#include <stdio.h>\n__attribute__((weak)) void finalizePythonInterpreter(void);\n"
        'void finalizePythonInterpreter(void) { puts("let go"); fflush(stdout); }\n'
    )
    fmu = talker(tmp_path, f"-include{function}", "-Wl,-z,nodelete")
    with ZipFile(fmu, "a") as archive:
        archive.writestr("resources/slavemodule.txt", "any")
    done = subprocess.run([sys.executable, "-c", RUN, fmu], capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (0, "closed\nlet go\n", "")
