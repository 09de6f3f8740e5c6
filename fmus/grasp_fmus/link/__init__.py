"""The protocol between a proxy FMU and its peer, over UDP. To the byte: README.md in this folder.

Standard library only, without sockets: it is packed into the proxies, and used by the bench side.
"""
