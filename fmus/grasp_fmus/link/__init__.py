"""What a proxy FMU and its peer say to each other over UDP. To the byte: README.md, beside this.

Standard library only, without sockets: it is packed into the proxies, and used by the bench side.
"""
