"""`python -m grasp_cosim` is `grasp-cosim`."""

from .cli import main

main()
