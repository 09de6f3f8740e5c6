"""number_text.h writes numbers as Python does, and blake2b.h hashes as hashlib does."""

import ctypes
import math
import struct
from ctypes import c_double
from hashlib import blake2b

import pytest
from grasp_fmus.native.sources import C
from hypothesis import example, given
from hypothesis import strategies as st
from support.compiled import compile_c
from support.examples import examples
from support.native_fmus import needs_gcc

pytestmark = needs_gcc

SOURCE = """
#include "number_text.h"
#include "blake2b.h"
size_t as_repr(char *to, double v) { return text_repr(to, v); }
size_t as_general(char *to, double v, int digits) { return text_general(to, v, digits); }
void hash(const void *data, size_t size, size_t half, unsigned char *digest)
{
    Blake2b s;
    blake2b_begin(&s);
    blake2b_add(&s, data, half);
    blake2b_add(&s, (const char *)data + half, size - half);
    blake2b_end(&s, digest);
}
"""


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    folder = tmp_path_factory.mktemp("text")
    (folder / "text.c").write_text(SOURCE, "utf-8")
    strict = ["-std=c99", "-O2", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-shared", "-fPIC"]
    text = compile_c(["gcc", *strict, f"-I{C}", folder / "text.c"], folder / "text.so")
    return ctypes.CDLL(str(text))


def general(library: ctypes.CDLL, v: float, digits: int) -> str:
    text = ctypes.create_string_buffer(800)
    length = library.as_general(text, c_double(v), digits)
    assert length == len(text.value)
    return text.value.decode()


def as_repr(library: ctypes.CDLL, v: float) -> str:
    text = ctypes.create_string_buffer(26)
    text[25] = b"!"  # written by no more than 25
    length = library.as_repr(text, c_double(v))
    assert length == len(text.value)
    assert text.raw[25:] == b"!"
    return text.value.decode()


bits = st.integers(0, 2**64 - 1).map(lambda n: float(struct.unpack("<d", struct.pack("<Q", n))[0]))
short = st.tuples(st.integers(-(10**17), 10**17), st.integers(-330, 310)).map(
    lambda pair: float(f"{pair[0]}e{pair[1]}")
)
anything = st.one_of(st.floats(), bits, short)


@given(anything)
@examples(500)
def test_repr(library: ctypes.CDLL, v: float) -> None:
    assert as_repr(library, v) == repr(v)


@given(anything, st.integers(1, 40))
@examples(500)
@example(0.5, 1)
@example(2.5, 1)
@example(9.5, 1)
@example(999999.5, 6)
@example(0.000099999995, 6)
@example(5e-324, 800)
@example(math.nextafter(2**-1022, 0.0), 790)
def test_general(library: ctypes.CDLL, v: float, digits: int) -> None:
    assert general(library, v, digits) == format(v, f".{digits}g")


@given(st.integers(-(2**53), 2**53), st.integers(0, 970))
def test_whole_numbers(library: ctypes.CDLL, m: int, exponent: int) -> None:
    assert general(library, float(m * 2**exponent), 310) == str(m * 2**exponent)


def test_powers_of_two_and_ten_and_their_neighbours(library: ctypes.CDLL) -> None:
    """Where the doubles below are closer than those above, and where the digits become more."""
    for v in [*(2.0**n for n in range(-1074, 1024)), *(float(f"1e{n}") for n in range(-323, 309))]:
        for near in (math.nextafter(v, 0.0), v, math.nextafter(v, math.inf)):
            assert as_repr(library, near) == repr(near)
            assert general(library, near, 6) == f"{near:g}"


@given(st.binary(max_size=400), st.integers(0, 400))
@example(b"", 0)
@example(bytes(128), 128)
@example(bytes(129), 128)
@example(bytes(256), 1)
def test_blake2b(library: ctypes.CDLL, data: bytes, half: int) -> None:
    digest = ctypes.create_string_buffer(16)
    size = ctypes.c_size_t
    library.hash(data, size(len(data)), size(min(half, len(data))), digest)
    assert digest.raw == blake2b(data, digest_size=16).digest()
