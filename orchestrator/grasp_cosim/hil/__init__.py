"""The other side of a proxy, and a bad network."""
