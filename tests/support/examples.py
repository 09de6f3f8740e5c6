"""How many examples a property is tried on: more where new ones are looked for."""

from hypothesis import settings

USUAL = 100
"""Examples of a property that asks for no other count, four times those of `make test`."""


def examples(count=USUAL, **more):
    """The settings of a test with `count` examples, as many times more as the profile has."""
    return settings(max_examples=max(1, count * settings().max_examples // USUAL), **more)
