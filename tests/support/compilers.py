"""Compilers that may be missing, by whose names tests are skipped."""

import importlib.util
import shutil

import pytest

needs_gcc = pytest.mark.skipif(not shutil.which("gcc"), reason="NO gcc")
needs_zig = pytest.mark.skipif(not importlib.util.find_spec("ziglang"), reason="NO ziglang")
