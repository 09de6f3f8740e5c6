/* Numbers as Python writes them: repr(float) and format(float, ".{digits}g"), to the byte.

   Exact arithmetic in whole numbers of up to 1280 bits, so that every digit is right; no stdio,
   which would follow the locale. The digits are found as Steele and White have it: a value is
   numerator/denominator, and each digit is the whole part of ten times what is left. */
#ifndef NUMBER_TEXT_H
#define NUMBER_TEXT_H

#include <stddef.h>
#include <stdint.h>
#include <string.h>

#define TEXT_WORDS 40         /* 1280 bits: a double needs 1130 of them */
#define OLD_TEXT_DIGITS 768       /* no double has more */
#define TEXT_WHOLE 310        /* the largest double, as a whole number, has 309 */
#define TEXT_SIZE 340         /* what a text with up to so many digits needs, with its NUL */

typedef struct {
    uint32_t words[TEXT_WORDS];  /* the lowest first */
} TextNumber;

static void text_multiply(TextNumber *a, uint32_t by)
{
    uint64_t carry = 0;
    int i;
    for (i = 0; i < TEXT_WORDS; i++) {
        carry += (uint64_t)a->words[i] * by;
        a->words[i] = (uint32_t)carry;
        carry >>= 32;
    }
}

/* The number m * 2**shift, for a shift from 0 */
static TextNumber text_shifted(uint64_t m, int shift)
{
    TextNumber a;
    int word = shift / 32, bits = shift % 32;
    memset(&a, 0, sizeof a);
    a.words[word] = (uint32_t)(m << bits);
    a.words[word + 1] = (uint32_t)(m >> 32 << bits);
    if (bits > 0) {
        a.words[word + 1] |= (uint32_t)((m & 0xffffffffu) >> (32 - bits));
        a.words[word + 2] = (uint32_t)(m >> 32 >> (32 - bits));
    }
    return a;
}

/* -1, 0, 1 as a + b is below, equal to or above c */
static int old_text_compare(const TextNumber *a, const TextNumber *b, const TextNumber *c)
{
    int64_t difference = 0;  /* of the words from i up, in units of the word i */
    int i;
    for (i = TEXT_WORDS - 1; i >= 0; i--) {
        difference = difference * 4294967296 + a->words[i] + (int64_t)b->words[i] - c->words[i];
        if (difference > 2 || difference < -2) {
            return difference > 0 ? 1 : -1;  /* what is below cannot make up for it */
        }
    }
    return difference > 0 ? 1 : difference < 0 ? -1 : 0;
}

static void text_subtract(TextNumber *a, const TextNumber *b)
{
    int64_t borrow = 0;
    int i;
    for (i = 0; i < TEXT_WORDS; i++) {
        borrow += (int64_t)a->words[i] - b->words[i];
        a->words[i] = (uint32_t)borrow;
        borrow = borrow < 0 ? -1 : 0;
    }
}

/* Add one to the last digit; 1 if the number was all nines and is now 1, a digit further left */
static int text_round_up(char *digits, int n)
{
    while (n > 0 && digits[n - 1] == '9') {
        digits[--n] = '0';
    }
    if (n > 0) {
        digits[n - 1]++;
        return 0;
    }
    digits[0] = '1';
    return 1;
}

/* The digits d of a number above 0, which is 0.d * 10**point; returns the point. `most` digits,
   correctly rounded, ties to even; where it is 0, the fewest that are read as the same double, of
   those the closest. Zeros at the end are left out. */
static int old_text_digits(char *digits, int *count, double v, int most)
{
    TextNumber zero, left, whole, above, below;
    uint64_t bits, m;
    int exponent, point = 0, n = 0, low = 0, high = 0, even, half;
    memcpy(&bits, &v, sizeof bits);
    exponent = (int)(bits >> 52 & 0x7ff);
    m = bits & 0xfffffffffffff;
    m |= exponent > 0 ? (uint64_t)1 << 52 : 0;
    even = m % 2 == 0;
    exponent = exponent > 0 ? exponent - 1075 : -1074;  /* v = m * 2**exponent */

    /* v = left/whole; below and above are half the distances to the next doubles, as numerators */
    memset(&zero, 0, sizeof zero);
    left = text_shifted(m, exponent > 0 ? exponent + 2 : 2);
    whole = text_shifted(1, exponent > 0 ? 2 : 2 - exponent);
    above = text_shifted(2, exponent > 0 ? exponent : 0);
    below = above;
    if (m == (uint64_t)1 << 52 && exponent > -1074) {  /* the doubles below are twice as close */
        below = text_shifted(1, exponent > 0 ? exponent : 0);
    }
    if (most > 0) {
        above = below = zero;  /* the digits do not depend on them */
    }
    while (old_text_compare(&left, &above, &whole) >= (most == 0 && !even)) {
        text_multiply(&whole, 10);
        point++;
    }
    for (;;) {
        text_multiply(&left, 10);
        text_multiply(&above, 10);
        text_multiply(&below, 10);
        if (old_text_compare(&left, &above, &whole) >= (most == 0 && !even)) {
            break;
        }
        point--;
    }
    for (;;) {
        digits[n] = '0';
        while (old_text_compare(&left, &zero, &whole) >= 0) {
            text_subtract(&left, &whole);
            digits[n]++;
        }
        n++;
        if (most == 0) {
            low = old_text_compare(&left, &zero, &below) < even;  /* these digits are close enough */
            high = old_text_compare(&left, &above, &whole) >= !even;  /* one more in the last is */
        }
        if (low || high || n == most || old_text_compare(&left, &zero, &zero) == 0) {
            break;
        }
        text_multiply(&left, 10);
        text_multiply(&above, 10);
        text_multiply(&below, 10);
    }
    half = old_text_compare(&left, &left, &whole);
    if (low != high ? high : half > 0 || (half == 0 && (digits[n - 1] - '0') % 2 == 1)) {
        point += text_round_up(digits, n);
    }
    while (n > 1 && digits[n - 1] == '0') {
        n--;
    }
    *count = n;
    return point;
}

/* Write the digits as Python does: with an exponent where the point is far away */
static size_t text_placed(char *to, const char *digits, int n, int point, int most)
{
    char *at = to;
    int i, exponent = point - 1;
    if (exponent < -4 || point > most) {
        *at++ = digits[0];
        if (n > 1) {
            *at++ = '.';
            memcpy(at, digits + 1, (size_t)n - 1);
            at += n - 1;
        }
        *at++ = 'e';
        *at++ = exponent < 0 ? '-' : '+';
        exponent = exponent < 0 ? -exponent : exponent;
        if (exponent >= 100) {
            *at++ = (char)('0' + exponent / 100);
        }
        *at++ = (char)('0' + exponent / 10 % 10);
        *at++ = (char)('0' + exponent % 10);
    } else {
        if (point <= 0) {
            *at++ = '0';
        }
        for (i = point < 0 ? point : 0; i < n || i < point; i++) {
            if (i == point || (point <= 0 && i == (point < 0 ? point : 0))) {
                *at++ = '.';
            }
            *at++ = i < 0 || i >= n ? '0' : digits[i];
        }
    }
    *at = '\0';
    return (size_t)(at - to);
}

/* What is no number or has no digits; NULL for all others */
static const char *text_special(double v)
{
    return v != v ? "nan" : v - v != 0.0 ? "inf" : v == 0.0 ? "0" : NULL;
}

/* With `most` significant digits, no zeros at the end; the fewest that identify v for 0 */
static inline size_t old_text_number(char *to, double v, int most)
{
    char digits[OLD_TEXT_DIGITS];
    const char *special = text_special(v);
    int n, point;
    uint64_t bits;
    size_t sign = 0;
    memcpy(&bits, &v, sizeof bits);
    if (v == v && bits >> 63) {
        to[sign++] = '-';
        bits &= ~((uint64_t)1 << 63);
        memcpy(&v, &bits, sizeof bits);
    }
    if (special) {
        strcpy(to + sign, special);
        return sign + strlen(special);
    }
    point = old_text_digits(digits, &n, v, most);
    return sign + text_placed(to + sign, digits, n, point, most > 0 ? most : 16);
}

/* repr(float): at most 25 bytes with the NUL */
static size_t text_repr(char *to, double v)
{
    size_t n = old_text_number(to, v, 0);
    if (v - v == 0.0 && strcspn(to, ".e") == n) {
        strcpy(to + n, ".0");
        n += 2;
    }
    return n;
}

/* format(v, ".{digits}g"), digits from 1; TEXT_WHOLE writes out a whole number of any size */
static inline size_t old_text_general(char *to, double v, int digits)
{
    return old_text_number(to, v, digits);
}

#endif
