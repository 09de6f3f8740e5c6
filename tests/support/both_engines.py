"""Tests in both engines, in the compiled one where there is a C compiler."""

import pytest
from grasp_cosim.master.compiled import has_compiler

needs_compiler = pytest.mark.skipif(not has_compiler(), reason="there is no C compiler")
ENGINES = ["python", pytest.param("compiled", marks=needs_compiler)]
engines = pytest.mark.parametrize("engine", ENGINES)
