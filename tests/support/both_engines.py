"""Tests in both engines, in the compiled one where numba is installed."""

import pytest
from grasp_cosim.master.engine import has_numba

needs_numba = pytest.mark.skipif(not has_numba(), reason="numba is not installed")
engines = pytest.mark.parametrize("engine", ["python", pytest.param("compiled", marks=needs_numba)])
