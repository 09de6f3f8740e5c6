"""Other processes: whether they are there, and UDP ports that are told to them before."""

import os
import signal
import socket
import time
from contextlib import contextmanager
from itertools import count
from pathlib import Path


def alive(pid):
    """Whether there is a process of that number that is no zombie."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False


def ends(pid):
    """Whether a process ends within 20 s, as a killed one does in its turn; else it is ended."""
    end = time.monotonic() + 20.0
    while alive(pid):
        if time.monotonic() > end:
            os.kill(pid, signal.SIGKILL)
            return False
        time.sleep(0.01)
    return True


LOWEST, COUNT = 20_000, 10_000
"""Below those that a system gives to who asks for any: on Linux from 32,768 on."""


@contextmanager
def kept_port():
    """A UDP port of 127.0.0.1 that stays ours while nobody has bound it.

    Whoever keeps it has the TCP port of the same number.
    """
    for k in count(os.getpid()):
        port = LOWEST + k % COUNT
        with socket.socket() as token, socket.socket(type=socket.SOCK_DGRAM) as trial:
            try:
                token.bind(("127.0.0.1", port))
                trial.bind(("127.0.0.1", port))
            except OSError:
                continue
            trial.close()
            yield port
            return
