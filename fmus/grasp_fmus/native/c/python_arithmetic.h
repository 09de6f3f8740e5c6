/* Python's arithmetic in C99: what CPython computes, to the bit, and what it raises.

A number is a double. A whole number, an int of Python, is a double without a fraction, zero is +0.0.
A function that may raise takes a Fault: the first one stays, results after it do not matter.
Compile without contraction (-ffp-contract=off) and without folding calls of libm (-fno-builtin-exp
and so on).
*/
#ifndef PYTHON_ARITHMETIC_H
#define PYTHON_ARITHMETIC_H

#include <math.h>
#include <string.h>

#include "number_text.h"

#ifdef __clang__
#pragma STDC FP_CONTRACT OFF
#endif

enum {
    FAULT_NONE,
    FAULT_OWN,        /* ArithmeticError: a reason of the block's own */
    FAULT_ARITHMETIC, /* one of its kinds: ZeroDivisionError, OverflowError */
    FAULT_VALUE,      /* ValueError */
    FAULT_OTHER       /* any other exception */
};

typedef struct {
    int kind;
    const char *type; /* of the exception */
    char text[1024];
} Fault;

#define PY_PI 3.141592653589793
#define PY_TAU 6.283185307179586
#define PY_E 2.718281828459045
#define PY_INF ((double)HUGE_VAL)
#define PY_NAN ((double)NAN)
#define PY_WHOLE 9007199254740992.0 /* 2^53, up to which every int is a double */
#define PY_INDEX 9223372036854775808.0 /* 2^63, below which Python takes an int as an index */

/* Exceptions */

static void py_say(Fault *fault, const char *text)
{
    size_t used = strlen(fault->text), more = strlen(text);
    if (more > sizeof fault->text - 1 - used) {
        more = sizeof fault->text - 1 - used;
    }
    memcpy(fault->text + used, text, more);
    fault->text[used + more] = '\0';
}

/* repr(v) of a float */
static inline void py_say_repr(Fault *fault, double v)
{
    char text[32];
    text_repr(text, v);
    py_say(fault, text);
}

/* format(v, ".{digits}g") */
static inline void py_say_general(Fault *fault, double v, int digits)
{
    char text[800];
    old_text_general(text, v, digits);
    py_say(fault, text);
}

/* str(n) of an int, all its digits */
static inline void py_say_whole(Fault *fault, double n)
{
    char text[TEXT_SIZE];
    old_text_general(text, n, TEXT_WHOLE);
    py_say(fault, text);
}

/* True if this is the first fault: what it says follows. */
static int py_raise(Fault *fault, int kind, const char *type)
{
    if (fault->kind != FAULT_NONE) {
        return 0;
    }
    fault->kind = kind;
    fault->type = type;
    fault->text[0] = '\0';
    return 1;
}

static double py_fault(Fault *fault, int kind, const char *type, const char *text)
{
    if (py_raise(fault, kind, type)) {
        py_say(fault, text);
    }
    return 0.0;
}

static inline double py_no_division(Fault *fault, const char *text)
{
    return py_fault(fault, FAULT_ARITHMETIC, "ZeroDivisionError", text);
}

static inline double py_overflow(Fault *fault, const char *text)
{
    return py_fault(fault, FAULT_ARITHMETIC, "OverflowError", text);
}

static inline double py_domain(Fault *fault)
{
    return py_fault(fault, FAULT_VALUE, "ValueError", "math domain error");
}

/* Operators of floats */

static inline double py_divide(double a, double b, Fault *fault)
{
    return b == 0.0 ? py_no_division(fault, "float division by zero") : a / b;
}

/* a % b, with the sign of b */
static inline double py_modulo(double a, double b, Fault *fault)
{
    double rest;
    if (b == 0.0) {
        return py_no_division(fault, "float modulo");
    }
    rest = fmod(a, b);
    if (rest == 0.0) {
        return copysign(0.0, b);
    }
    return (b < 0.0) != (rest < 0.0) ? rest + b : rest;
}

/* a // b */
static inline double py_floor_divide(double a, double b, Fault *fault)
{
    double rest, quotient, down;
    if (b == 0.0) {
        return py_no_division(fault, "float floor division by zero");
    }
    rest = fmod(a, b);
    quotient = (a - rest) / b;
    if (rest != 0.0 && (b < 0.0) != (rest < 0.0)) {
        quotient -= 1.0;
    }
    if (quotient == 0.0) {
        return copysign(0.0, a / b);
    }
    down = floor(quotient);
    return quotient - down > 0.5 ? down + 1.0 : down;
}

static inline int py_odd(double y)
{
    return fmod(fabs(y), 2.0) == 1.0;
}

/* a ** b */
static inline double py_power(double a, double b, Fault *fault)
{
    int negative = 0;
    double result;
    if (b == 0.0) {
        return 1.0;
    }
    if (isnan(a)) {
        return a;
    }
    if (isnan(b)) {
        return a == 1.0 ? 1.0 : b;
    }
    if (isinf(b)) {
        a = fabs(a);
        return a == 1.0 ? 1.0 : (b > 0.0) == (a > 1.0) ? fabs(b) : 0.0;
    }
    if (isinf(a)) {
        if (b > 0.0) {
            return py_odd(b) ? a : fabs(a);
        }
        return py_odd(b) ? copysign(0.0, a) : 0.0;
    }
    if (a == 0.0) {
        if (b < 0.0) {
            return py_no_division(fault, "0.0 cannot be raised to a negative power");
        }
        return py_odd(b) ? a : 0.0;
    }
    if (a < 0.0) {
        if (b != floor(b)) { /* complex in Python */
            if (isinf(pow(-a, b))) {
                return py_overflow(fault, "complex exponentiation");
            }
            return py_fault(fault, FAULT_OTHER, "TypeError",
                            "a negative number to a fractional power is complex");
        }
        a = -a;
        negative = py_odd(b);
    }
    if (a == 1.0) {
        return negative ? -1.0 : 1.0;
    }
    result = pow(a, b);
    if (isinf(result)) {
        return py_overflow(fault, "(34, 'Numerical result out of range')");
    }
    return negative ? -result : result;
}

static inline double py_min(double a, double b)
{
    return b < a ? b : a;
}

static inline double py_max(double a, double b)
{
    return b > a ? b : a;
}

/* Whole numbers */

/* The result of an operation of ints, which must be exact. */
static inline double py_whole(double n, Fault *fault)
{
    if (!(n >= -PY_WHOLE && n <= PY_WHOLE)) {
        return py_overflow(fault, "whole number beyond 2^53");
    }
    return n + 0.0;
}

static inline double py_whole_divide(double a, double b, Fault *fault)
{
    return b == 0.0 ? py_no_division(fault, "division by zero") : a / b;
}

static inline double py_whole_modulo(double a, double b, Fault *fault)
{
    double rest;
    if (b == 0.0) {
        return py_no_division(fault, "integer modulo by zero");
    }
    rest = fmod(a, b);
    return py_whole(rest != 0.0 && (b < 0.0) != (rest < 0.0) ? rest + b : rest, fault);
}

static inline double py_whole_floor_divide(double a, double b, Fault *fault)
{
    double rest;
    if (b == 0.0) {
        return py_no_division(fault, "integer division or modulo by zero");
    }
    rest = py_whole_modulo(a, b, fault);
    return py_whole(py_whole(a - rest, fault) / b, fault);
}

/* n ** k for k >= 0 */
static inline double py_whole_power(double n, int k, Fault *fault)
{
    double result = 1.0;
    while (k-- > 0) {
        result = py_whole(result * n, fault);
    }
    return result;
}

/* A float without its fraction as an int; v is the float it came from. */
static inline double py_as_whole(double whole, Fault *fault)
{
    if (isinf(whole)) {
        return py_overflow(fault, "cannot convert float infinity to integer");
    }
    if (isnan(whole)) {
        return py_fault(fault, FAULT_VALUE, "ValueError", "cannot convert float NaN to integer");
    }
    return whole + 0.0;
}

static inline double py_floor(double v, Fault *fault)
{
    return py_as_whole(floor(v), fault);
}

static inline double py_ceil(double v, Fault *fault)
{
    return py_as_whole(ceil(v), fault);
}

static inline double py_int(double v, Fault *fault)
{
    return py_as_whole(v < 0.0 ? ceil(v) : floor(v), fault);
}

/* Halves go to the even one. */
static inline double py_round(double v, Fault *fault)
{
    double whole = round(v);
    if (fabs(v - whole) == 0.5) {
        whole = 2.0 * round(v / 2.0);
    }
    return py_as_whole(whole, fault);
}

/* The place in a tuple of so many items; negative ones count from its end. */
static inline int py_index(double n, int length, Fault *fault)
{
    double place = n < 0.0 ? n + length : n;
    if (!(place >= 0.0 && place < length)) {
        py_fault(fault, FAULT_OTHER, "IndexError",
                 n >= -PY_INDEX && n < PY_INDEX ? "tuple index out of range"
                                                : "cannot fit 'int' into an index-sized integer");
        return 0;
    }
    return (int)place;
}

/* math, as in CPython's mathmodule.c */

/* What a function of one argument gives for x: an error where x gave no number, or too large a one. */
static inline double py_checked(double x, double result, Fault *fault)
{
    if ((isnan(result) && !isnan(x)) || (isinf(result) && !isnan(x) && !isinf(x))) {
        return py_domain(fault);
    }
    return result;
}

static inline double py_checked_range(double x, double result, Fault *fault)
{
    if (isinf(result) && !isnan(x) && !isinf(x)) {
        return py_overflow(fault, "math range error");
    }
    return py_checked(x, result, fault);
}

static inline double py_atan(double x) { return atan(x); }
static inline double py_asinh(double x) { return asinh(x); }
static inline double py_tanh(double x) { return tanh(x); }
static inline double py_sqrt(double x, Fault *fault) { return py_checked(x, sqrt(x), fault); }
static inline double py_sin(double x, Fault *fault) { return py_checked(x, sin(x), fault); }
static inline double py_cos(double x, Fault *fault) { return py_checked(x, cos(x), fault); }
static inline double py_tan(double x, Fault *fault) { return py_checked(x, tan(x), fault); }
static inline double py_asin(double x, Fault *fault) { return py_checked(x, asin(x), fault); }
static inline double py_acos(double x, Fault *fault) { return py_checked(x, acos(x), fault); }
static inline double py_acosh(double x, Fault *fault) { return py_checked(x, acosh(x), fault); }
static inline double py_atanh(double x, Fault *fault) { return py_checked(x, atanh(x), fault); }
static inline double py_exp(double x, Fault *fault) { return py_checked_range(x, exp(x), fault); }
static inline double py_sinh(double x, Fault *fault) { return py_checked_range(x, sinh(x), fault); }
static inline double py_cosh(double x, Fault *fault) { return py_checked_range(x, cosh(x), fault); }

static inline double py_expm1(double x, Fault *fault)
{
    return py_checked_range(x, expm1(x), fault);
}

static inline double py_log(double x, Fault *fault)
{
    return x <= 0.0 ? py_domain(fault) : log(x);
}

static inline double py_log2(double x, Fault *fault)
{
    return x <= 0.0 ? py_domain(fault) : log2(x);
}

static inline double py_log10(double x, Fault *fault)
{
    return x <= 0.0 ? py_domain(fault) : log10(x);
}

static inline double py_log1p(double x, Fault *fault)
{
    return x == 0.0 ? x : x <= -1.0 ? py_domain(fault) : log1p(x);
}

static inline double py_atan2(double y, double x)
{
    if (isnan(x) || isnan(y)) {
        return PY_NAN;
    }
    if (isinf(y)) {
        return copysign(isinf(x) ? (x > 0.0 ? 0.25 : 0.75) * PY_PI : 0.5 * PY_PI, y);
    }
    if (isinf(x) || y == 0.0) {
        return copysign(copysign(1.0, x) == 1.0 ? 0.0 : PY_PI, y);
    }
    return atan2(y, x);
}

static inline double py_fmod(double x, double y, Fault *fault)
{
    double result;
    if (isinf(y) && !isinf(x) && !isnan(x)) {
        return x;
    }
    result = fmod(x, y);
    return isnan(result) && !isnan(x) && !isnan(y) ? py_domain(fault) : result;
}

/* math.pow, which is not ** */
static inline double py_pow(double x, double y, Fault *fault)
{
    double result;
    if (isnan(x)) {
        return y == 0.0 ? 1.0 : x;
    }
    if (isnan(y)) {
        return x == 1.0 ? 1.0 : y;
    }
    if (isinf(x)) {
        int odd = !isinf(y) && py_odd(y);
        if (y == 0.0) {
            return 1.0;
        }
        if (y > 0.0) {
            return odd ? x : fabs(x);
        }
        return odd ? copysign(0.0, x) : 0.0;
    }
    if (isinf(y)) {
        return fabs(x) == 1.0 ? 1.0 : (y > 0.0) == (fabs(x) > 1.0) ? fabs(y) : 0.0;
    }
    result = pow(x, y);
    if (isnan(result) || (isinf(result) && x == 0.0)) {
        return py_domain(fault);
    }
    return isinf(result) ? py_overflow(fault, "math range error") : result;
}

/* math.ldexp with a whole exponent */
static inline double py_ldexp(double x, double exponent, Fault *fault)
{
    double result;
    if (x == 0.0 || isinf(x) || isnan(x)) {
        return x;
    }
    if (exponent > 2147483647.0) {
        return py_overflow(fault, "math range error");
    }
    if (exponent < -2147483648.0) {
        return copysign(0.0, x);
    }
    result = ldexp(x, (int)exponent);
    return isinf(result) ? py_overflow(fault, "math range error") : result;
}

#endif
