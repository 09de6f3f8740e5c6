"""Run as a program: starts processes that serve an FMU in lockstep, fast, as each is a copy of one
in which the FMU has been tried out and all is imported.

For each line on standard input it starts one, and prints its process id and its port. A process
that is not wanted any more is killed by its id; all end with this one's standard input.
"""

import os
import signal
import sys
import tempfile
from pathlib import Path

from grasp_cosim.hil.served import ServedFmu, Service
from grasp_cosim.hil.server import Server
from grasp_cosim.interface.read import read_interface


def main(fmu):
    interface = read_interface(Path(fmu))
    served = ServedFmu(interface, Service(lockstep=True))
    children = []
    for line in sys.stdin:
        if line.startswith("end "):
            child = int(line[4:])
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
            children.remove(child)
            print(child, "ended", flush=True)  # noqa: T201
            continue
        reading, writing = os.pipe()
        child = os.fork()
        if not child:
            with Server(served) as server:
                os.write(writing, str(server.address[1]).encode())
                server.serve()
            os._exit(0)
        os.close(writing)
        port = os.read(reading, 16).decode()
        os.close(reading)
        children.append(child)
        print(child, port, flush=True)  # noqa: T201
    for child in children:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:  # who is killed removes nothing
        tempfile.tempdir = folder
        main(sys.argv[1])
