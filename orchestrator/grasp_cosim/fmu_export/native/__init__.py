"""Native FMUs: a block as C, which needs no Python. Card: README.md."""
