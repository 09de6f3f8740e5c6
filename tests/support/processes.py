"""Whether other processes are there."""

import os
import signal
import time
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
