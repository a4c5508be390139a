/// See decimal.h. The C library rounds correctly in both directions, so digits are added until the
/// text reads back as the same number. At a power of two the nearest decimal of a length can fail
/// although another one of that length succeeds, because doubles above it are twice as far apart
/// as below. There the next larger decimal is tried, too.
#include "decimal.h"

#include <assert.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum {
    DIGITS_MAX = 17,      // enough for every double
    DIGITS_MAX_FLOAT = 9,
    DIGITS_SURE = 15,     // a normal double represents every decimal of this many digits
    DIGITS_SURE_FLOAT = 6,
    FIXED_FROM = -4,      // powers of ten written without an exponent
    FIXED_BELOW = 16,
};

/// d.ddd * 10^exponent; the first digit is not 0 unless the number is.
typedef struct decimal {
    char digits[DIGITS_MAX + 1]; ///< without the zeros at their end, at least one
    int  exponent;
} decimal;

typedef bool reads_back(const decimal* self, double value);

static void shortest(decimal* self, double value, int least, int most, reads_back* same);
static void spell(const decimal* self, bool negative, char text[DECIMAL_SIZE]);

static bool same_double(const decimal* self, double value);
static bool same_float(const decimal* self, double value);

void decimal_from_double(double value, char text[DECIMAL_SIZE])
{
    assert(isfinite(value));
    decimal found;
    const int least = fpclassify(value) == FP_NORMAL ? DIGITS_SURE : 1;
    shortest(&found, fabs(value), least, DIGITS_MAX, same_double);
    spell(&found, value < 0.0, text);
}

void decimal_from_float(float value, char text[DECIMAL_SIZE])
{
    assert(isfinite(value));
    decimal found;
    const int least = fpclassify(value) == FP_NORMAL ? DIGITS_SURE_FLOAT : 1;
    shortest(&found, fabs((double)value), least, DIGITS_MAX_FLOAT, same_float);
    spell(&found, value < 0.0f, text);
}

static void nearest(decimal* self, double value, int digits);
static bool step_up(decimal* self, int digits);
static void strip(decimal* self);

/// least: a number that has a shorter decimal has the same decimal, with zeros, at this length.
static void shortest(decimal* self, double value, int least, int most, reads_back* same)
{
    int ignored;
    const bool power_of_two = frexp(value, &ignored) == 0.5;
    for (int digits = least; digits <= most; ++digits) {
        nearest(self, value, digits);
        if (same(self, value) || digits == most) {
            break;
        }
        if (power_of_two && step_up(self, digits) && same(self, value)) {
            break;
        }
    }
    strip(self);
}

/// The correctly rounded decimal of this many digits. The decimal separator of the locale is
/// skipped.
static void nearest(decimal* self, double value, int digits)
{
    char text[64];
    snprintf(text, sizeof text, "%.*e", digits - 1, value);
    int         count = 0;
    const char* c = text;
    for (; *c != 'e'; ++c) {
        if (*c >= '0' && *c <= '9') {
            self->digits[count++] = *c;
        }
    }
    assert(count == digits);
    self->digits[count] = '\0';
    self->exponent = atoi(c + 1);
}

/// The next larger decimal of this many digits. False: it is a power of ten, which is shorter.
static bool step_up(decimal* self, int digits)
{
    int at = digits - 1;
    while (at > 0 && self->digits[at] == '9') {
        self->digits[at--] = '0';
    }
    if (self->digits[at] == '9') {
        return false;
    }
    ++self->digits[at];
    return true;
}

static void strip(decimal* self)
{
    size_t count = strlen(self->digits);
    while (count > 1 && self->digits[count - 1] == '0') {
        self->digits[--count] = '\0';
    }
}

/// As an integer with an exponent, which is read alike in every locale.
static void as_integer(const decimal* self, char text[DECIMAL_SIZE])
{
    const int last = self->exponent - (int)strlen(self->digits) + 1;
    snprintf(text, DECIMAL_SIZE, "%se%d", self->digits, last);
}

static bool same_double(const decimal* self, double value)
{
    char text[DECIMAL_SIZE];
    as_integer(self, text);
    return strtod(text, NULL) == value;
}

static bool same_float(const decimal* self, double value)
{
    char text[DECIMAL_SIZE];
    as_integer(self, text);
    return (double)strtof(text, NULL) == value;
}

static char* put_zeros(char* at, int count)
{
    memset(at, '0', (size_t)count);
    return at + count;
}

/// Digits with a point behind the first `whole` of them, if any follow.
static char* put_digits(char* at, const char* digits, int whole)
{
    const int count = (int)strlen(digits);
    memcpy(at, digits, (size_t)(count < whole ? count : whole));
    if (count <= whole) {
        return put_zeros(at + count, whole - count);
    }
    at += whole;
    *at++ = '.';
    memcpy(at, digits + whole, (size_t)(count - whole));
    return at + count - whole;
}

static void spell(const decimal* self, bool negative, char text[DECIMAL_SIZE])
{
    char* at = text;
    if (negative) {
        *at++ = '-';
    }
    if (self->exponent < FIXED_FROM || self->exponent >= FIXED_BELOW) {
        at = put_digits(at, self->digits, 1);
        at += snprintf(at, (size_t)(text + DECIMAL_SIZE - at), "e%d", self->exponent);
    } else if (self->exponent >= 0) {
        at = put_digits(at, self->digits, self->exponent + 1);
    } else {
        *at++ = '0';
        *at++ = '.';
        at = put_zeros(at, -self->exponent - 1);
        memcpy(at, self->digits, strlen(self->digits));
        at += strlen(self->digits);
    }
    *at = '\0';
}
