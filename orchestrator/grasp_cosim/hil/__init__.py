"""The other side of a proxy, and a bad network between the two."""
