"""A host that steps a bench once a millisecond with forces of 2.5 N, as a proxy would.

    python host.py PORT NAME

Without a word on SIGUSR1 it sends no more; on SIGUSR2 it receives no more, and goes on sending.
After an answer that tells of a trip it goes on as well: the bench must look after itself.
"""

import signal
import socket
import sys
import time

from grasp_cosim.fmu_export.link import (
    INITIALISE,
    OUTPUTS,
    STEP,
    WELCOME,
    Codec,
    Message,
    Sealer,
    pack_hello,
)
from support.observed.plant import SIGNATURE, START

PERIOD = 0.001
FORCE = 2.5


class Host:
    def __init__(self, port, name):
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.connect(("127.0.0.1", port))
        self.codec, self.sealer = Codec(SIGNATURE.request), Sealer()
        self.cookie = self.sequence = self.answered = 0
        self.sends = self.hears = True
        self.name = name
        signal.signal(signal.SIGUSR1, self.send_no_more)
        signal.signal(signal.SIGUSR2, self.hear_no_more)

    def send_no_more(self, *_):
        self.sends = False

    def hear_no_more(self, *_):
        self.hears = False

    def send(self, kind, body, time_s=0.0, step=0.0):
        counted = self.sequence - 1 - self.answered if kind in (INITIALISE, STEP) else 0
        m = Message(kind, 0, SIGNATURE.hash, 7, self.cookie, self.sequence, time_s, step, 0, body)
        self.socket.send(self.sealer.pack(m._replace(counted=counted)))

    def hear(self, timeout):
        self.socket.settimeout(timeout)
        try:
            m = self.sealer.open(self.socket.recv(65536))
        except (TimeoutError, BlockingIOError, ConnectionError):
            return None
        if m.kind == OUTPUTS:
            self.answered = max(self.answered, m.sequence)
        return m

    def ask(self, kind, body):
        for _ in range(100):
            self.send(kind, body)
            m = self.hear(0.2)
            if m is not None and m.kind in (WELCOME, OUTPUTS):
                return m
        raise SystemExit("no answer")

    def values(self, first, second):
        return self.codec.pack(*[{**START, "force[1]": first, "force[2]": second}[v.name]
                                 for v in SIGNATURE.request])  # fmt: skip

    def run(self):
        first_part = SIGNATURE.parts()[0]  # enough for a peer whose signature has the same hash
        self.cookie = self.ask(1, pack_hello(self.name, first_part)).cookie
        self.sequence = 1
        self.ask(INITIALISE, self.values(0.0, 0.0))
        begin, k = time.monotonic(), 0
        sys.stdout.write("stepping\n")
        sys.stdout.flush()
        body = self.values(-FORCE, FORCE)
        while True:
            if self.sends:
                self.sequence += 1
                self.send(STEP, body, k * PERIOD, PERIOD)
            if self.hears:
                self.hear(PERIOD / 2)
            k += 1
            time.sleep(max(0.0, begin + k * PERIOD - time.monotonic()))


if __name__ == "__main__":
    Host(int(sys.argv[1]), sys.argv[2]).run()
