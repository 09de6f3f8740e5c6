/* What C99 lacks of Python's arithmetic. Every number is a double; an int of Python has no fraction,
   and its zero no sign. Where Python raises, these have the value of IEEE 754.

   Compile without contraction (-ffp-contract=off) and without working out calls of libm
   (-fno-builtin-exp and so on): then the values are Python's, to the bit.
*/
#ifndef ARITHMETIC_H
#define ARITHMETIC_H

#include <math.h>

#ifdef __clang__
#pragma STDC FP_CONTRACT OFF
#endif

#ifdef __GNUC__ /* a call with the same arguments need not be made again */
double atan2(double, double) __attribute__((const));
double cos(double) __attribute__((const));
double exp(double) __attribute__((const));
double expm1(double) __attribute__((const));
double log(double) __attribute__((const));
double pow(double, double) __attribute__((const));
double sin(double) __attribute__((const));
double tan(double) __attribute__((const));
double tanh(double) __attribute__((const));
#endif

/* max(a, b): the first of equals, and of what cannot be compared */
static inline double larger(double a, double b)
{
    return b > a ? b : a;
}

static inline double smaller(double a, double b)
{
    return b < a ? b : a;
}

/* floor(x) as an int, whose zero has no sign */
static inline double floored(double x)
{
    return floor(x) + 0.0;
}

static inline double ceiled(double x)
{
    return ceil(x) + 0.0;
}

static inline double truncated(double x)
{
    return trunc(x) + 0.0;
}

/* math.ldexp, whose exponent is any int */
static inline double scaled(double x, double exponent)
{
    int within = exponent > -9999.0 && exponent < 9999.0;
    return ldexp(x, within ? (int)exponent : exponent > 0.0 ? 9999 : -9999);
}

#endif
