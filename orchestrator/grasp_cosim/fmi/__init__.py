"""Instances of FMUs behind calls that are bound once.

FMI 2.0 and 3.0, in this process or in one of their own; instance.py is what the master needs.
"""

from .fmpy_import import fmpy as fmpy
