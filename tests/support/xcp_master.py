"""A master of XCP of a few lines, for tests of single commands and of what no good master sends."""

import socket
import struct
from contextlib import suppress

OK, ERROR = 0xFF, 0xFE
ERRORS = {
    "synch": 0x00,
    "daq active": 0x11,
    "unknown": 0x20,
    "syntax": 0x21,
    "out of range": 0x22,
    "access denied": 0x24,
    "mode": 0x27,
    "sequence": 0x29,
    "daq config": 0x2A,
    "memory": 0x30,
}


class RefusedError(Exception):
    """The slave's error, in the words of ERRORS."""


class XcpMaster:
    """Sends commands to a UDP port; keeps messages with measured values, and how many lack."""

    def __init__(self, port):
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 22)
        self.socket.connect(("127.0.0.1", port))
        self.socket.settimeout(10.0)
        self.measured = []
        self.missing, self._next = 0, None
        self._count = 0

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.socket.close()

    def send(self, packet):
        """Send a command in its frame."""
        self.socket.send(struct.pack("<HH", len(packet), self._count & 0xFFFF) + packet)
        self._count += 1

    def receive(self):
        """One message: an answer, or measured values, which are kept too."""
        size, counter = struct.unpack_from("<HH", datagram := self.socket.recv(65536))
        assert size == len(datagram) - 4
        if self._next is not None:
            self.missing += (counter - self._next) & 0xFFFF
        self._next = (counter + 1) & 0xFFFF
        message = datagram[4:]
        if message[0] < 0xFC:
            self.measured.append(message)
        return message

    def __call__(self, code, *octets, data=b""):
        """What the slave answers to a command, behind the first byte."""
        self.send(bytes([code, *octets]) + data)
        while (answer := self.receive())[0] not in (OK, ERROR):
            pass
        if answer[0] == ERROR:
            raise RefusedError(next(word for word, code in ERRORS.items() if code == answer[1]))
        return answer[1:]

    def connect(self):
        """Begin a session."""
        self._next = None
        return self(0xFF, 0)

    def read(self, address, size):
        """Bytes of memory."""
        return self(0xF4, size, 0, 0, data=struct.pack("<I", address))

    def write(self, address, data):
        """Write bytes."""
        self(0xF6, 0, 0, 0, data=struct.pack("<I", address))
        self(0xF0, len(data), data=data)

    def measure(self, *lists, prescaler=1):
        """Begin to measure: of each list the ODTs, of each of these the (address, size)."""
        self(0xD6)
        self(0xD5, 0, len(lists), 0)
        for number, odts in enumerate(lists):
            self(0xD4, 0, number, 0, len(odts))
        for number, odts in enumerate(lists):
            for i, entries in enumerate(odts):
                self(0xD3, 0, number, 0, i, len(entries))
        for number, odts in enumerate(lists):
            for i, entries in enumerate(odts):
                self(0xE2, 0, number, 0, i, 0)
                for address, size in entries:
                    self(0xE1, 0xFF, size, 0, data=struct.pack("<I", address))
            self(0xE0, 0x10, number, 0, 0, 0, prescaler, 0)
            self(0xDE, 2, number, 0)
        self(0xDD, 1)

    def wait_for(self, messages):
        """Receive until so many messages with values have come in all."""
        while len(self.measured) < messages:
            self.receive()

    def drain(self):
        """Receive what is there."""
        self.socket.setblocking(False)
        with suppress(BlockingIOError):
            while True:
                self.receive()
        self.socket.settimeout(10.0)
