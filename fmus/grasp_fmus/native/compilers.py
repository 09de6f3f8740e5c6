"""What c_compilers has, for those that still look for it here."""

from c_compilers import BITS, LIBM, CompilerError

__all__ = ["BITS", "LIBM", "CompilerError"]
