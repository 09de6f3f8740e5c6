"""Addresses of UDP sockets, and sockets that listen there."""

import ipaddress
import socket

from ..errors import InputError

Address = tuple[str, int]
"""IPv4 address and port."""


def resolved(host: str, port: int, lowest_port: int = 0) -> Address:
    """IPv4 address and port; InputError where the host has none or the port is out of range."""
    if not lowest_port <= port <= 65_535:
        raise InputError(f"{text((host, port))}: port must be from {lowest_port} to 65535")
    try:
        found = socket.getaddrinfo(host, port, socket.AF_INET, socket.SOCK_DGRAM)
    except (OSError, UnicodeError) as error:
        raise InputError(
            f"{text((host, port))}: no such host; must be an IPv4 address or a name that has one"
        ) from error
    return str(found[0][4][0]), port


def text(address: Address) -> str:
    """As in a command line, 127.0.0.1:5501."""
    return f"{address[0]}:{address[1]}"


def is_loopback(address: Address) -> bool:
    """Whether only this machine can send there."""
    return ipaddress.ip_address(address[0]).is_loopback


def listening(address: Address) -> socket.socket:
    """A socket that receives there, and does not block; InputError where there can be none."""
    receiving = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        receiving.bind(address)
    except OSError as error:
        receiving.close()
        raise InputError(
            f"{text(address)}: cannot listen there: {error.strerror}; must be an address of this"
            " machine and a free port, or 0"
        ) from error
    receiving.setblocking(False)
    return receiving
