"""Names that have moved, until all that imports them has followed."""

from .build import build_block as build_block
from .own_block import _parsed as _parsed
from .own_block import _run as _run
from .own_block import own_model as own_model
