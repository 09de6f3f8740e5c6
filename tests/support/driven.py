"""An instance that is stepped under inputs that change."""

from math import sin

from .fmi2 import OK

H = 1e-3
"""A step in s."""


def drive(instance, first, last, h=H):
    """Steps from first to last with inputs that change; returns all outputs."""
    seen = []
    for k in range(first, last):
        inputs = instance.fmu.names("input")
        scale = -2.0 if "force[1]" in inputs else 0.05
        values = {n: scale * sin(0.1 * k + i) + 0.06 for i, n in enumerate(inputs)}
        assert instance.set(values) == OK
        assert instance.step(k * h, h) == OK
        seen += instance.outputs()
    return seen
