"""Single cases of a parametrised test that take more than about a second."""

from typing import Any

import pytest


def slow(*values: Any) -> Any:
    """A case that only `make test-slow` runs."""
    return pytest.param(*values, marks=pytest.mark.slow)
