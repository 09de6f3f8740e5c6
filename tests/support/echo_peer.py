"""A real peer over loopback that sends back whatever it gets."""

import socket
import threading


class EchoPeer:
    """Echoes in a thread until the with statement ends; received holds (sender's port, data)."""

    def __init__(self, port=0):
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", port))
        self.address = self.socket.getsockname()
        self.received = []
        self._thread = threading.Thread(target=self._echo)

    def _echo(self):
        while True:
            data, sender = self.socket.recvfrom(65_535)
            if sender == self.address:
                return
            self.received.append((sender[1], data))
            self.socket.sendto(data, sender)

    def __enter__(self):
        self._thread.start()
        return self

    def __exit__(self, kind, error, trace):
        self.socket.sendto(b"", self.address)
        self._thread.join()
        self.socket.close()


def client():
    """A socket on loopback whose recv() gives up in the end."""
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    made.bind(("127.0.0.1", 0))
    made.settimeout(30.0)
    return made
