"""Single cases of a parametrised test that the quick tests do without."""

from typing import Any

import pytest


def slow(*values: Any):
    """A case that only `make test-slow` runs."""
    return pytest.param(*values, marks=pytest.mark.slow)


def platforms(*values: Any):
    """A case that only `make platforms` runs."""
    return pytest.param(*values, marks=pytest.mark.platforms)


def interop(*values: Any):
    """A case that only `make interop` runs."""
    return pytest.param(*values, marks=pytest.mark.interop)
