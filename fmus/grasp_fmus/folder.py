"""Names that have moved, until all that imports them has followed."""

from .package import Built as Built
from .package import write_file as write_file
