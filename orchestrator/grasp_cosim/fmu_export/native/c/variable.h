/* What a block and its slave have in common: how a variable is declared, and a message in a buffer of
   its own. No stdio: that follows the locale of the host, and takes memory on small systems. */
#ifndef VARIABLE_H
#define VARIABLE_H

#include <stddef.h>
#include <stdint.h>
#include <string.h>

enum { KIND_REAL, KIND_BOOLEAN, KIND_INTEGER, KIND_STRING };
enum { INPUT, OUTPUT, PARAMETER };
enum { UNLIMITED, LIMITED, INFINITE };

typedef struct {
    const char *name;
    const char *in_unit;  /* as after a number: " kg" */
    int kind;
    int causality;
    int fixed;            /* 0: it may change at run time */
    int limited;          /* from low to high; for a String, the bytes it has at most are high */
                          /* INFINITE: any number, and inf */
    double low, high;
    double start;         /* of a String, its place among the texts */
} Variable;

#ifdef TEXT_NONE  /* no words: that something is refused is all that is told */

typedef struct {
    char none;
} Text;

#define text_put(text, more) ((void)(text), (void)(more))
#define text_number(text, v) ((void)(text), (void)(v))
#define text_general(text, v, digits) ((void)(text), (void)(v), (void)(digits))

#else

#include <stdarg.h>

#ifndef TEXT_CAPACITY
#define TEXT_CAPACITY 2048  /* bytes of a message with its NUL; what does not fit is cut off */
#endif
#define TEXT_DIGITS 800     /* no double has more */

typedef struct {
    size_t length;
    char at[TEXT_CAPACITY];
} Text;

static void text_clear(Text *text)
{
    text->length = 0;
    text->at[0] = '\0';
}

/* The bytes of a text in UTF-8 that `room` has place for, in whole characters */
static size_t text_fitting(const char *text, size_t room)
{
    size_t n = strlen(text);
    if (n > room) {
        for (n = room; n > 0 && ((unsigned char)text[n] & 0xc0) == 0x80; n--) {
        }
    }
    return n;
}

static void text_put_part(Text *text, const char *more, size_t n)
{
    size_t room = sizeof text->at - 1 - text->length;
    n = n <= room ? n : text_fitting(more, room);
    memcpy(text->at + text->length, more, n);
    text->length += n;
    text->at[text->length] = '\0';
}

static void text_put(Text *text, const char *more)
{
    text_put_part(text, more, strlen(more));
}

/* The digits d of m * 2^exponent, which is 0.d * 10^point, all of them; returns the point */
static int text_digits(char *digits, uint64_t m, int exponent)
{
    const uint32_t base = 1000000000;
    uint32_t words[TEXT_DIGITS / 9 + 4], place;  /* a number to that base, the lowest first */
    int factor = exponent < 0 ? 5 : 2;           /* half of it is five times it, a digit further */
    int left = exponent < 0 ? -exponent : exponent;
    int n = 3, length = 0, point, i;
    words[0] = (uint32_t)(m % base);
    words[1] = (uint32_t)(m / base % base);
    words[2] = (uint32_t)(m / base / base);
    for (; left > 0; left--) {
        uint64_t carry = 0;
        for (i = 0; i < n; i++) {
            carry += (uint64_t)words[i] * (uint64_t)factor;
            words[i] = (uint32_t)(carry % base);
            carry /= base;
        }
        if (carry > 0) {
            words[n++] = (uint32_t)carry;
        }
    }
    for (i = n - 1; i >= 0; i--) {
        for (place = base / 10; place > 0; place /= 10) {
            digits[length] = (char)('0' + words[i] / place % 10);
            length += length > 0 || digits[length] != '0';
        }
    }
    point = length + (exponent < 0 ? exponent : 0);
    while (length > 0 && digits[length - 1] == '0') {
        length--;
    }
    digits[length] = '\0';
    return point;
}

/* Round digits to so many, a half to the even one; returns the point, which may move */
static int text_rounded(char *digits, int point, int most)
{
    int n = (int)strlen(digits), up;
    if (n <= most) {
        return point;
    }
    up = digits[most] > '5'
         || (digits[most] == '5' && (n > most + 1 || (digits[most - 1] - '0') % 2 == 1));
    for (n = most; n > 0 && digits[n - 1] == (up ? '9' : '0'); n--) {
    }
    if (n == 0) {
        digits[n++] = '1';
        point++;
    } else {
        digits[n - 1] = (char)(digits[n - 1] + up);
    }
    digits[n] = '\0';
    return point;
}

/* -1, 0, 1 as the number with these digits is below, at or above m * 2^exponent */
static int text_compare(const char *digits, int point, uint64_t m, int exponent)
{
    char other[TEXT_DIGITS];
    int at = text_digits(other, m, exponent), order = strcmp(digits, other);
    return point != at ? (point > at) - (point < at) : (order > 0) - (order < 0);
}

/* Whether digits are read as m * 2^exponent: nearer to it than to any other double, or even */
static int text_reads_back(const char *digits, int point, uint64_t m, int exponent)
{
    int narrow = m == (uint64_t)1 << 52 && exponent > -1074;  /* those below are twice as close */
    int odd = m % 2 == 1;
    return text_compare(digits, point, 2 * m + 1, exponent - 1) <= -odd
           && text_compare(digits, point, (narrow ? 4 : 2) * m - 1, exponent - 1 - narrow) >= odd;
}

/* Write digits, with an exponent where the point is not among the first `most` of them */
static void text_put_digits(Text *text, const char *digits, int point, int most)
{
    static const char zeros[] = "00000000000000000";
    int n = (int)strlen(digits), far = point <= -4 || point > most, whole = far ? 1 : point;
    int exponent = point > 0 ? point - 1 : 1 - point;
    char said[] = "e+000";
    if (whole <= 0) {
        text_put(text, "0.");
        text_put_part(text, zeros, (size_t)-whole);
        text_put(text, digits);
        return;
    }
    text_put_part(text, digits, (size_t)(whole < n ? whole : n));
    text_put_part(text, zeros, (size_t)(whole > n ? whole - n : 0));
    text_put(text, whole < n ? "." : "");
    text_put(text, whole < n ? digits + whole : "");
    if (far) {
        said[1] = point > 0 ? '+' : '-';
        said[2] = (char)('0' + exponent / 100);
        said[3] = (char)('0' + exponent / 10 % 10);
        said[4] = (char)('0' + exponent % 10);
        text_put_part(text, said, 2);
        text_put(text, said + (exponent < 100 ? 3 : 2));
    }
}

/* As format(v, ".{digits}g") of Python; 0: the fewest of 15 to 17 that are read as the same one */
static void text_general(Text *text, double v, int digits)
{
    char all[TEXT_DIGITS], found[TEXT_DIGITS];
    uint64_t bits, m;
    int exponent, point, at, most = digits > 0 ? digits : 15;
    memcpy(&bits, &v, sizeof bits);
    text_put(text, v == v && bits >> 63 ? "-" : "");
    if (v - v != 0.0 || v == 0.0) {
        text_put(text, v != v ? "nan" : v == 0.0 ? "0" : "inf");
        return;
    }
    exponent = (int)(bits >> 52 & 0x7ff);
    m = (bits & 0xfffffffffffff) | (exponent > 0 ? (uint64_t)1 << 52 : 0);
    exponent = exponent > 0 ? exponent - 1075 : -1074;
    point = text_digits(all, m, exponent);
    do {
        strcpy(found, all);
        at = text_rounded(found, point, most);
    } while (digits == 0 && most < 17 && most++ && !text_reads_back(found, at, m, exponent));
    text_put_digits(text, found, at, digits > 0 ? digits : 16);
}

/* A number that is read back as the same one, with a point or an exponent: -1.0 */
static void text_number(Text *text, double v)
{
    size_t from = text->length;
    text_general(text, v, 0);
    if (v - v == 0.0 && strcspn(text->at + from, ".e") == text->length - from) {
        text_put(text, ".0");
    }
}

/* As printf has it: %s, %d, %g, %%, and %.17g for text_number(); no others */
static void text_put_list(Text *text, const char *format, va_list list)
{
    const char *at;
    for (; (at = strchr(format, '%')) != NULL; format = at + (at[1] == '.' ? 5 : 2)) {
        text_put_part(text, format, (size_t)(at - format));
        switch (at[1]) {
        case 's':
            text_put(text, va_arg(list, const char *));
            break;
        case 'd':
            text_general(text, va_arg(list, int), 10);
            break;
        case 'g':
            text_general(text, va_arg(list, double), 6);
            break;
        case '.':
            text_number(text, va_arg(list, double));
            break;
        default:
            text_put(text, "%");
        }
    }
    text_put(text, format);
}

#ifndef TEXT_LIKE_PRINTF
#define TEXT_LIKE_PRINTF  /* an attribute for compilers that check formats */
#endif

TEXT_LIKE_PRINTF static inline void text_say(Text *text, const char *format, ...)
{
    va_list list;
    va_start(list, format);
    text_put_list(text, format, list);
    va_end(list);
}

#endif /* TEXT_NONE */

#endif
