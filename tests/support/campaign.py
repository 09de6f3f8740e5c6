"""How large a campaign is: a tenth in the slow tests, whole and with new seeds in `make explore`.

The profile of hypothesis says which of them, and its option for a seed where seeds begin. Tests
that ask here are marked with campaign, by which `make explore` finds them.
"""

import pytest
from hypothesis import settings

first_seed = 0
"""Where seeds begin: what --hypothesis-seed says, see conftest.py."""


def exploring():
    """Whether this is `make explore`."""
    return settings.get_current_profile_name() == "explore"


def part(whole):
    """How much of a campaign that many large is done."""
    return whole if exploring() else -(-whole // 10)


def seeds(whole):
    """The seeds of a campaign with that many: the same ones in each run of the slow tests."""
    return range(first_seed, first_seed + part(whole))


def only_whole(why):
    """For what cannot be done in part, and takes longer than all slow tests may."""
    return pytest.mark.skipif(not exploring(), reason=f"{why}: make explore")
