"""The values of the built-in cases, for tests that set them beside others."""

from grasp_cosim.grasp.presets import CASES as NUMBERS
from grasp_cosim.grasp.presets import built_in_presets

CASES = {n: built_in_presets()[f"case_{n}"] for n in NUMBERS}
