"""What the tests of all plants share: the gripper from behind, its parameters' ranges."""

from math import inf

import pytest
from support.declared import parameters


def swapped(pair):
    """What is on the right, seen from behind."""
    first, second = pair
    return -second, -first


def assert_ranges_are_checked(part, prefix="", but=()):
    """Every number outside its range is refused by name; but names what depends on others."""
    checked = [p for p in parameters(part) if p.name not in but]
    assert checked
    for parameter in checked:
        assert -inf < parameter.low < parameter.high < inf
        for number, value in parameter.invalid():
            with pytest.raises(ValueError, match=r".+") as caught:
                part(**{parameter.name: value})
            text = str(caught.value)
            assert text.startswith(f"{prefix}{parameter.name} = {number!r} {parameter.unit}: ")
            assert text.endswith(parameter.valid)
