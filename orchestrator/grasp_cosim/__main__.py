"""`python -m grasp_cosim` is `grasp-cosim`."""

from .cli import entry

if __name__ == "__main__":
    entry()
