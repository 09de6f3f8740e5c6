"""A low-pass of first order by Euler backward: T·x_f' = x - x_f."""


def low_passed(previous: float, x: float, time_constant: float, h: float) -> float:
    """x_f h seconds later, x held, with T in s; x and x_f are in one unit."""
    return previous + h / (time_constant + h) * (x - previous)
