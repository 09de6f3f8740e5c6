"""Names and texts of Python as C has them: ASCII, and no word that means something else there."""

import unicodedata

_WORDS = """
auto break case char const continue default do double else enum extern float for goto if inline int
long register restrict return short signed sizeof static struct switch typedef union unsigned void
volatile while _Bool _Complex _Imaginary alignas alignof bool constexpr false nullptr static_assert
thread_local true typeof typeof_unqual asm fortran
I complex imaginary unix linux i386 near far huge min max NULL NAN INFINITY HUGE_VAL HUGE_VALF
HUGE_VALL EOF errno assert stdin stdout stderr small interface IN OUT TRUE FALSE BOOL VOID ERROR
OVERFLOW UNDERFLOW DOMAIN SING PLOSS TLOSS FP_NAN FP_INFINITE FP_ZERO FP_SUBNORMAL FP_NORMAL
CHAR INT DELETE CONST OPTIONAL Fault fault
isnan isinf isfinite isnormal signbit fpclassify isgreater isless
sqrt floor ceil fabs copysign fmod atan sinh asinh cbrt exp2 tanh strlen memcpy frexp round pow
MAXFLOAT SNAN SNANF SNANL math_errhandling MATH_ERRNO MATH_ERREXCEPT SIZE_MAX RAND_MAX EXIT_SUCCESS
EXIT_FAILURE BIG_ENDIAN LITTLE_ENDIAN PDP_ENDIAN BYTE_ORDER BLOCK_NAME BLOCK_LONGEST_STEP
N_INPUTS N_OUTPUTS N_PARAMETERS N_VARIABLES N_STATE N_REFERENCES
atan2 ldexp log log2 log10 log1p exp expm1 sin cos tan asin acos acosh atanh cosh
"""
RESERVED = frozenset(_WORDS.split())
"""Keywords, macros, and the functions that python_arithmetic.h and the generated C call."""

_STARTS = """
py_ __ PY_ FAULT_ TEXT_ M_PI M_E M_LN M_LOG M_SQRT M_1_PI M_2_PI M_2_SQRTPI FP_
DBL_ FLT_ LDBL_ INT8_ INT16_ INT32_ INT64_ UINT8_ UINT16_ UINT32_ UINT64_
SLAVE_ BLAKE2B_ FMI fmi2 fmi3
"""
_BEGINNINGS = tuple(_STARTS.split())

_HEADERS = """
py python_arithmetic number_text text fault block slave blake2b tuples fmi2 fmi3 fmi2_interface
fmi3_interface main math string float limits errno signal time locale stdio stdlib stddef stdint
assert ctype setjmp stdarg complex fenv inttypes iso646 stdbool tgmath wchar wctype malloc memory
strings sys windows io variable variables kind input output parameter limit n
"""
TAKEN_MODULES = frozenset(_HEADERS.split())
"""Words that a module's C names may not begin with, as other files use them."""

_LETTERS = {"·": "*", "×": "x", "−": "-", "–": "-", "—": "-", "≤": "<=", "≥": ">=", "≠": "!="}
_LETTERS |= {"°": "deg", "µ": "u", "√": "sqrt", "∞": "inf", "→": "->", "←": "<-", "±": "+-"}
_LETTERS |= {"²": "^2", "³": "^3", "“": '"', "”": '"', "’": "'", "‘": "'", "…": "...", "≈": "~"}


def identifier(name: str) -> str:
    """A Python name as one of C, not yet told from its neighbours."""
    plain = "".join(c if c.isascii() else _word(c) for c in name)
    clashes = plain in RESERVED or plain.startswith(_BEGINNINGS)
    return f"{plain}_" if clashes else plain


def _word(c: str) -> str:
    return unicodedata.name(c, f"u{ord(c):x}").rpartition(" ")[2].lower()


def ascii_text(text: str) -> str:
    """A text for a comment: ASCII, and nothing that ends the comment."""
    plain = "".join(c if c.isascii() else _letter(c) for c in text)
    plain = "".join(c if c >= " " or c == "\n" else " " for c in plain)
    return (
        plain.replace("*/", "* /").replace("/*", "/ *").replace("??", "? ?").replace("\\\n", "\n")
    )


def _letter(c: str) -> str:
    if c in _LETTERS:
        return _LETTERS[c]
    base = unicodedata.normalize("NFKD", c).encode("ascii", "ignore").decode()
    if base:
        return base
    return _word(c) if c.isalpha() else "?"


def string(text: str) -> str:
    """A text as a C string of its bytes in UTF-8."""
    out = []
    for byte in text.encode():
        c = chr(byte)
        if c in '"\\?':
            out.append(f"\\{c}")
        elif " " <= c <= "~":
            out.append(c)
        else:
            out.append(f"\\{byte:03o}")
    return f'"{"".join(out)}"'


def real(value: float) -> str:
    """A float as C writes it, to the bit."""
    if value != value:
        return "PY_NAN"
    if value in (float("inf"), float("-inf")):
        return "PY_INF" if value > 0 else "-PY_INF"
    return repr(value)


def whole(value: int) -> str:
    """An int as a double of C."""
    if abs(value) < 10**16:
        return f"{int(value)}.0"
    return real(float(value))
