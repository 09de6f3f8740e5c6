"""Native FMUs: blocks as C, compiled, which need no Python. The page: README.md."""
