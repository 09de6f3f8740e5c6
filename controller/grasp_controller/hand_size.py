"""N, the number of fingers of a hand: the parameter of its build.

The arrays of a hand are of this size. The build writes this file into an FMU of another number.
"""

FINGERS = 3
