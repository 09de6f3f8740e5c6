"""Compilers that may be missing, by whose names tests are skipped."""

import importlib.util

import pytest

needs_zig = pytest.mark.skipif(not importlib.util.find_spec("ziglang"), reason="NO ziglang")
