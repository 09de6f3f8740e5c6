"""Instances of FMUs behind calls that are bound once.

FMI 2.0 and 3.0, in this process or in one of their own; instance.py is what the master needs.
"""

import io
from contextlib import redirect_stdout

with redirect_stdout(io.StringIO()):  # FMPy says there that its logger, not used here, is for x86
    import fmpy as fmpy
