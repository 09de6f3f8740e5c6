"""The protocol between a proxy FMU and its peer, without sockets. To the byte: README.md."""
