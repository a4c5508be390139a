/// Range reduction after Cody and Waite, then Taylor series with a remainder below a tenth of an
/// ulp. Every step is one correctly rounded operation, so the results are the same on every machine
/// if contraction is off.
#include "base/scalar.h"

#include "base/contract.h"

#include <stddef.h>
#include <string.h>

/// pi/2 and 2 pi in three parts. The first two hold 33 bits, so that k * part is exact for
/// |k| < 2^20. |x| <= 1e6 needs less.
static const double half_pi[3] = { 0x1.921fb54400000p+0, 0x1.0b4611a600000p-34,
                                   0x1.3198a2e037073p-69 };
static const double two_pi[3] = { 0x1.921fb54400000p+2, 0x1.0b4611a600000p-32,
                                  0x1.3198a2e037073p-67 };
/// atan(k / 8): the nearest double and the rounding error.
static const double atan_eighth[9][2] = {
    { 0.0, 0.0 },
    { 0x1.fd5ba9aac2f6ep-4, -0x1.cd37686760c17p-59 },
    { 0x1.f5b75f92c80ddp-3, 0x1.8ab6e3cf7afbdp-57 },
    { 0x1.6f61941e4def1p-2, -0x1.c63aae6f6e918p-56 },
    { 0x1.dac670561bb4fp-2, 0x1.a2b7f222f65e2p-56 },
    { 0x1.1e00babdefeb4p-1, -0x1.928df287a668fp-58 },
    { 0x1.4978fa3269ee1p-1, 0x1.2419a87f2a458p-56 },
    { 0x1.700a7c5784634p-1, -0x1.8c34d25aadef6p-56 },
    { 0x1.921fb54442d18p-1, 0x1.1a62633145c07p-55 },
};
static const double pi_low = 0x1.1a62633145c07p-53; // pi - VG_PI
/// ln 2: 32 bits, so that exponent * ln2_high is exact, and the rest.
static const double ln2_high = 0x1.62e42fee00000p-1;
static const double ln2_low = 0x1.a39ef35793c76p-33;

/// x - k * step with k the nearest integer to x / step[0]. The integer is returned in *k.
static double reduce(double x, const double step[3], double* tail, int32_t* k);
static double sin_series(double r, double tail);
static double cos_series(double r, double tail);
/// atan of a ratio in [0, 1], y <= x, 0 < x; the result is head + *tail.
static double atan_ratio(double y, double x, double* tail);

double vg_sin(double x)
{
    double sine, cosine;
    vg_sincos(x, &sine, &cosine);
    return sine;
}

double vg_cos(double x)
{
    double sine, cosine;
    vg_sincos(x, &sine, &cosine);
    return cosine;
}

void vg_sincos(double x, double* sine, double* cosine)
{
    VERGE_ASSERT(x >= -1e6 && x <= 1e6);
    VERGE_ASSERT(sine != NULL && cosine != NULL);

    int32_t k;
    double tail;
    const double r = reduce(x, half_pi, &tail, &k);
    const double s = sin_series(r, tail);
    const double c = cos_series(r, tail);
    switch ((uint32_t)k & 3u) {
    case 0: *sine = s; *cosine = c; break;
    case 1: *sine = c; *cosine = -s; break;
    case 2: *sine = -s; *cosine = -c; break;
    default: *sine = -c; *cosine = s; break;
    }
}

double vg_atan2(double y, double x)
{
    VERGE_ASSERT(y == y && x == x);
    const double ay = vg_abs(y);
    const double ax = vg_abs(x);
    if (ay == 0.0) {
        return x < 0.0 ? VG_PI : 0.0; // the sign of the zero is ignored: (-pi, pi]
    }

    // Eighth turns are folded onto [0, pi/4]; each unfolding carries the tail of pi along.
    double tail;
    double angle;
    if (ay <= ax) {
        angle = atan_ratio(ay, ax, &tail);
    } else {
        double inner_tail;
        const double inner = atan_ratio(ax, ay, &inner_tail);
        angle = 0.5 * VG_PI - inner;
        tail = (0.5 * VG_PI - angle) - inner + (0.5 * pi_low - inner_tail);
    }
    if (x < 0.0) {
        const double folded = VG_PI - angle;
        tail = (VG_PI - folded) - angle + (pi_low - tail);
        angle = folded;
    }
    angle += tail;
    return y < 0.0 ? (angle < VG_PI ? -angle : VG_PI) : angle;
}

double vg_log(double x)
{
    VERGE_ASSERT(x > 0.0 && vg_finite(x));

    // x = 2^exponent * (1 + f), 1 + f in [sqrt(1/2), sqrt(2)).
    int32_t exponent = 0;
    if (x < 0x1p-1022) {
        x *= 0x1p54;
        exponent = -54;
    }
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    exponent += (int32_t)(bits >> 52) - 1023;
    bits = (bits & 0x000fffffffffffffu) | 0x3ff0000000000000u;
    double mantissa;
    memcpy(&mantissa, &bits, sizeof mantissa);
    if (mantissa > 1.41421356237309515) {
        mantissa *= 0.5;
        ++exponent;
    }
    const double f = mantissa - 1.0;

    // log(1 + f) = 2 atanh(s), s = f / (2 + f), written as f - (f^2/2 - s (f^2/2 + R)) so that
    // the leading term is exact. R = 2/3 s^2 + 2/5 s^4 + ...
    const double s = f / (2.0 + f);
    const double z = s * s;
    double rest = 2.0 / 25.0;
    for (int n = 23; n >= 3; n -= 2) {
        rest = rest * z + 2.0 / n;
    }
    rest *= z;
    const double half_square = 0.5 * f * f;
    const double e = (double)exponent;
    return e * ln2_high - ((half_square - (s * (half_square + rest) + e * ln2_low)) - f);
}

// x less whole turns, by long division: each difference is exact. Such an angle is known to no
// better than its last digit, so that the digits of pi beyond a double do not matter.
static double remainder_of_turn(double x)
{
    const double turn = 2.0 * VG_PI;
    double rest = vg_abs(x), step = turn;
    while (step <= 0.5 * rest) {
        step *= 2.0;
    }
    for (; step >= turn; step *= 0.5) {
        rest = rest >= step ? rest - step : rest;
    }
    return x < 0.0 ? -rest : rest;
}

double vg_wrap_angle(double x)
{
    VERGE_ASSERT(vg_finite(x));
    if (x > -VG_PI && x <= VG_PI) {
        return x;
    }
    int32_t k;
    double tail;
    const double near = vg_abs(x) <= 1e6 ? x : remainder_of_turn(x);
    const double r = reduce(near, two_pi, &tail, &k);
    if (r > VG_PI) {
        return VG_PI;
    }
    return r <= -VG_PI ? VG_PI : r;
}

static double reduce(double x, const double step[3], double* tail, int32_t* k)
{
    if (!(x >= -1e6 && x <= 1e6)) { // without assertions: a defined result for an illegal argument
        x = 0.0;
    }
    const double turns = x / step[0];
    *k = (int32_t)(turns < 0.0 ? turns - 0.5 : turns + 0.5); // |turns| < 1e6
    const double n = (double)*k;

    // The first product and difference are exact. The second difference is not: what it drops
    // joins the third part in the tail, or arguments near a multiple of pi/2 lose their digits.
    const double a = x - n * step[0];
    const double b = n * step[1];
    const double c = a - b;
    const double back = a - c;
    const double lost = (a - (c + back)) + (back - b);
    const double d = lost - n * step[2];
    const double r = c + d;
    *tail = (c - r) + d;
    return r;
}

/// sin(r + tail), |r| <= pi/4: remainder of the series r^19/19! < 1e-19.
static double sin_series(double r, double tail)
{
    const double z = r * r;
    double sum = 1.0 / 355687428096000.0;        //  1/17!
    sum = sum * z - 1.0 / 1307674368000.0;       // -1/15!
    sum = sum * z + 1.0 / 6227020800.0;          //  1/13!
    sum = sum * z - 1.0 / 39916800.0;            // -1/11!
    sum = sum * z + 1.0 / 362880.0;              //  1/9!
    sum = sum * z - 1.0 / 5040.0;                // -1/7!
    sum = sum * z + 1.0 / 120.0;                 //  1/5!
    sum = sum * z - 1.0 / 6.0;                   // -1/3!
    return r + (r * z * sum + tail * (1.0 - 0.5 * z));
}

/// cos(r + tail), |r| <= pi/4: remainder of the series r^18/18! < 3e-18.
static double cos_series(double r, double tail)
{
    const double z = r * r;
    double sum = 1.0 / 20922789888000.0;         //  1/16!
    sum = sum * z - 1.0 / 87178291200.0;         // -1/14!
    sum = sum * z + 1.0 / 479001600.0;           //  1/12!
    sum = sum * z - 1.0 / 3628800.0;             // -1/10!
    sum = sum * z + 1.0 / 40320.0;               //  1/8!
    sum = sum * z - 1.0 / 720.0;                 // -1/6!
    sum = sum * z + 1.0 / 24.0;                  //  1/4!
    const double half = 0.5 * z;
    const double head = 1.0 - half;
    return head + (((1.0 - head) - half) + (z * z * sum - r * tail));
}

static double atan_ratio(double y, double x, double* tail)
{
    // atan(y/x) = atan(c) + atan((y - c x) / (x + c y)), c the nearest eighth: |r| <= 1/16, so
    // the series may stop at r^13 (remainder r^15/15 < 1e-19).
    const double ratio = y / x;
    VERGE_ASSERT(ratio >= 0.0 && ratio <= 1.0);
    const int k = (int)(8.0 * ratio + 0.5);
    const double c = 0.125 * k;
    const double r = k == 0 ? ratio : (y - c * x) / (x + c * y);
    const double z = r * r;
    double sum = 1.0 / 13.0;
    sum = 1.0 / 11.0 - z * sum;
    sum = 1.0 / 9.0 - z * sum;
    sum = 1.0 / 7.0 - z * sum;
    sum = 1.0 / 5.0 - z * sum;
    sum = 1.0 / 3.0 - z * sum;
    const double small = -r * z * sum;

    const double head = atan_eighth[k][0] + r;
    *tail = ((atan_eighth[k][0] - head) + r) + (atan_eighth[k][1] + small);
    return head;
}
