"""Native FMUs: a block as C, which needs no Python. See README.md."""
