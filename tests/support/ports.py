"""UDP ports for what has to be told of one before anybody listens there, or comes back to one."""

import os
import socket
from contextlib import contextmanager
from itertools import count

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
