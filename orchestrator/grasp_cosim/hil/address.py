"""Addresses of UDP sockets, and sockets that listen there."""

import ipaddress
import re
import socket
from collections.abc import Callable

from ..base.errors import InputError

Address = tuple[str, int]
"""IPv4 address and port."""


def resolved(host: str, port: int, lowest_port: int = 0) -> Address:
    """Return IPv4 address and port; InputError where the host has none or the port is wrong."""
    if not lowest_port <= port <= 65_535:
        raise InputError(f"{text((host, port))}: port must be from {lowest_port} to 65535")
    try:
        found = socket.getaddrinfo(host, port, socket.AF_INET, socket.SOCK_DGRAM)
    except (OSError, UnicodeError) as error:
        raise InputError(
            f"{text((host, port))}: no such host; must be an IPv4 address or a name that has one"
        ) from error
    return str(found[0][4][0]), port


def read_address(place: str, given: str) -> Address:
    """The address that a text says, HOST:PORT, or PORT of this machine; place says whose.

    InputError where it is none.
    """
    found = re.fullmatch(r"(?:(.+):)?([0-9]{1,5})", given)
    if not found:
        raise InputError(f"{place} {given!r}: must be HOST:PORT, as in 127.0.0.1:5501, or PORT")
    return found[1] or "127.0.0.1", int(found[2])


def text(address: Address) -> str:
    """Return an address as in a command line, 127.0.0.1:5501."""
    return f"{address[0]}:{address[1]}"


def is_loopback(address: Address) -> bool:
    """Return True if only this machine can send there."""
    return ipaddress.ip_address(address[0]).is_loopback


def listening(address: Address) -> socket.socket:
    """Return a socket that receives at `address`; InputError where there can be none."""
    wrong = "cannot listen there: {}; must be an address of this machine and a free port, or 0"
    return _socket(socket.socket.bind, address, wrong)


def connected(peer: Address) -> socket.socket:
    """Return a socket that receives from the peer alone; InputError where there is no way to it."""
    return _socket(socket.socket.connect, peer, "no way to the peer: {}")


def _socket(
    attach: Callable[[socket.socket, Address], None], address: Address, wrong: str
) -> socket.socket:
    """Return a socket that does not block, attached to `address`; `wrong` is said if it cannot."""
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        attach(made, address)
    except OSError as error:
        made.close()
        raise InputError(f"{text(address)}: {wrong.format(error.strerror)}") from error
    made.setblocking(False)
    return made
