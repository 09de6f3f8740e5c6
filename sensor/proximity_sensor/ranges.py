"""The check that a stage's parameters are within their declared ranges."""

from typing import Any, get_type_hints


def check(stage: str, params: Any) -> None:
    """Raise ValueError, naming stage, parameter, value and range, where one is out of its range."""
    for name, hint in get_type_hints(type(params), include_extras=True).items():
        unit, _, *limits = hint.__metadata__
        declared = getattr(params, name)
        in_unit = f" {unit}" if unit else ""
        for low, high in limits:
            for value in declared if isinstance(declared, tuple) else (declared,):
                if not low <= value <= high:
                    raise ValueError(
                        f"{stage}.{name} = {value!r}{in_unit}: must be from {low:g} to {high:g}"
                    )
