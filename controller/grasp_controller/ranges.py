"""The check that a layer's parameters are within their declared ranges."""

from typing import Any, get_type_hints


def check(params: Any) -> None:
    """Raise ValueError, naming layer, value and range, where a parameter is out of its range."""
    layer = type(params).__module__.rpartition(".")[2]
    for name, hint in get_type_hints(type(params), include_extras=True).items():
        unit, _, *limits = hint.__metadata__
        declared = getattr(params, name)
        for low, high in limits:
            for value in declared if isinstance(declared, tuple) else (declared,):
                if not low <= value <= high:
                    raise ValueError(
                        f"{layer}.{name} = {value!r} {unit}: must be from {low:g} to {high:g}"
                    )
