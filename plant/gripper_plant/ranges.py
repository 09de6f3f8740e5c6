"""The check that parameters are within their declared ranges."""

from typing import Any, get_type_hints


def check(params: Any, prefix: str = "") -> None:
    """Raise ValueError, naming parameter, value and range, where a number is out of its range.

    prefix stands before the name. What is no number checks itself.
    """
    for name, hint in get_type_hints(type(params), include_extras=True).items():
        if not hasattr(hint, "__metadata__"):
            continue
        unit, _, *limits = hint.__metadata__
        declared = getattr(params, name)
        for low, high in limits:
            for value in declared if isinstance(declared, tuple) else (declared,):
                if not low <= value <= high:
                    raise ValueError(
                        f"{prefix}{name} = {value!r} {unit}: must be from {low:g} to {high:g}"
                    )
