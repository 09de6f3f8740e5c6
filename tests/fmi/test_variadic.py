"""Messages of FMI 2.0: a format with its arguments, as C passes and prints them."""

import ctypes
import subprocess
import sys

import pytest
from grasp_cosim.fmi.variadic import CONVENTION, formatted, logger_type
from support.compiled import shared_library
from support.native_fmus import needs_gcc

here = pytest.mark.skipif(CONVENTION is None, reason="NO va_list of this processor is known")

C = """
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
typedef void (*logger)(void *, const char *, int, const char *, const char *, ...);
char wanted[50][1000];
int said;
#define SAY(...) do { \\
    snprintf(wanted[said++], 1000, __VA_ARGS__); log(0, "part", 3, "why", __VA_ARGS__); \\
} while (0)
void say(logger log) {
    SAY("none");
    SAY("100 %% of it");
    SAY("the %s is broken", "lamp");
    SAY("%d %i %u %x %#X %o %c %p", -1, 2, 3u, 0xabc, 0xABC, 8, 'c', (void *)wanted);
    SAY("%ld %lld %zu %hd %hhd %jd %td %lu", -1L, -2LL, (size_t)3, (short)-4, (signed char)-5,
        (intmax_t)6, (ptrdiff_t)7, ~0UL);
    SAY("%f %e %g %G %a %g", 1.5, -2.5e300, 0.1, 1e-7, 3.0, 1.0 / 0.0);
    SAY("%5d|%-8s|%08.3f|%+d|%.*f|%*d|%.3s", 42, "ab", 3.14159, 7, 2, 2.71828, 6, 9, "abcdef");
    SAY("%2$s %1$d", 5, "second");
    SAY("%d %d %d %d %d %d %d %d %d %d %d %d", 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12);
    SAY("%g %g %g %g %g %g %g %g %g %g %g %g %s",
        1., 2., 3., 4., 5., 6., 7., 8., 9., 10., 11., 12., "end");
    SAY("%g %d %g %s %g %d %g %s %g %d %g %s %g %d %g %s %g %d %g %s %g %d",
        1., 1, 2., "a", 3., 2, 4., "b", 5., 3, 6., "c", 7., 4, 8., "d", 9., 5, 10., "e", 11., 6);
}
"""


def said(library):
    """What the logger made of all that is said, and what C's own printf did."""
    found = []

    def log(environment, name, status, why, form, *passed):
        assert (environment, name, status, why) == (None, b"part", 3, b"why")
        found.append(formatted(form, passed))

    logger = logger_type()(log)
    library.say(logger)
    wanted = (ctypes.c_char * 1000 * 50).in_dll(library, "wanted")
    return found, [text.value for text in wanted[: len(found)]]


@needs_gcc
@here
@pytest.mark.parametrize("level", ["-O0", "-O2"])
def test_arguments_are_printed_as_by_c(tmp_path, level):
    file = tmp_path / "say.so"
    file.write_bytes(shared_library(code=C, options=(level,)))
    found, wanted = said(ctypes.CDLL(str(file)))
    assert found == wanted
    assert found[2] == b"the lamp is broken"
    assert len(found) == 11


@needs_gcc
@here
@pytest.mark.parametrize("form", ["%Lf, %d", "%.3Lg", "%d " * 33])
def test_what_cannot_be_told_stays_as_it_comes(tmp_path, form):
    begin, end = C.split("    SAY", 1)[0], f'log(0, "part", 3, "why", "{form}", 1.0L, 5); }}'
    file = tmp_path / "say.so"
    file.write_bytes(shared_library(code=begin + end))
    assert said(ctypes.CDLL(str(file)))[0] == [form.encode()]


def test_fmpys_own_logger_is_not_used_and_what_it_prints_is_not_seen():
    """Where FMPy has none for a processor, it says so on standard output."""
    code = """
import sys, types
sys.modules["fmpy.logging"] = logging = types.ModuleType("fmpy.logging")
logging.addLoggerProxy = lambda _: print("none such") or print("asked", file=sys.stderr)
import grasp_cosim.fmi.fmi2
"""
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True)
    assert (done.stdout, done.stderr.split()) == (b"", [b"asked"] * 2)  # by FMPy: FMI 1.0 and 2.0
