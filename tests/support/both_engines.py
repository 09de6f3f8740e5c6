"""Tests in both engines, in the compiled one where there is a C compiler."""

import pytest
from grasp_cosim.master.compiled import compiler

needs_compiler = pytest.mark.skipif(compiler() is None, reason="there is no C compiler")
ENGINES = ["python", pytest.param("compiled", marks=needs_compiler)]
engines = pytest.mark.parametrize("engine", ENGINES)
