"""The motion of a damped oscillator in decimal arithmetic, with far more digits than it needs."""

from decimal import Decimal, localcontext

Rows = tuple[Decimal, Decimal, Decimal, Decimal]

IDENTITY = (Decimal(1), Decimal(0), Decimal(0), Decimal(1))


def oscillator(m, d, k, h):
    """What m·e'' + d·e' + k·e = 0 does to (e, e') in h seconds, row by row."""
    with localcontext() as context:
        context.prec = 120
        mass, time = Decimal(m), Decimal(h)
        a = _exponential((Decimal(0), time, -Decimal(k) / mass * time, -Decimal(d) / mass * time))
        return float(a[0]), float(a[1]), float(a[2]), float(a[3])


def _exponential(a):
    """Taylor's series of the matrix scaled down to nearly nothing, squared up again."""
    squarings = 0
    while max(abs(entry) for entry in a) > Decimal("1e-6"):
        a, squarings = _times(a, Decimal("0.5")), squarings + 1
    power = result = IDENTITY
    for n in range(1, 16):
        power = _times(_product(power, a), 1 / Decimal(n))
        result = _sum(result, power)
    for _ in range(squarings):
        result = _product(result, result)
    return result


def _times(a, factor):
    return a[0] * factor, a[1] * factor, a[2] * factor, a[3] * factor


def _sum(a, b):
    return a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3]


def _product(a, b):
    return (
        a[0] * b[0] + a[1] * b[2],
        a[0] * b[1] + a[1] * b[3],
        a[2] * b[0] + a[3] * b[2],
        a[2] * b[1] + a[3] * b[3],
    )
