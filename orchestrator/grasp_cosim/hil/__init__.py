"""Hardware in the loop: the other side of a proxy, and a bad network.

A served FMU behind a UDP port, and a relay that loses, delays and repeats datagrams.
"""
