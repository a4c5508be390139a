/// The shortest decimal that reads back as the same number. All programs print numbers this way.
///
///     char text[DECIMAL_SIZE];
///     decimal_from_double(3.35, text);   // "3.35", where "%.17g" gives 3.3500000000000001
///
/// Digits      The fewest that read back as the same double (or float); of those, the nearest.
/// Notation    Fixed from 1e-4 up to below 1e16, so integers up to 2^53 have no exponent; outside
///             of it 1e21, 1.5e-7. -0 is written 0, which is equal to it.
/// Locale      Has no effect: the decimal separator is a point.
/// Memory      Only that of the caller.
#ifndef VERGE_APPS_DECIMAL_H
#define VERGE_APPS_DECIMAL_H

enum { DECIMAL_SIZE = 32 }; ///< [B] the longest text, "-1.2345678901234567e-308", with its end

/// value: finite.
void decimal_from_double(double value, char text[DECIMAL_SIZE]);
/// The same of a float: reads back as the same float, so it has nine digits at most.
void decimal_from_float(float value, char text[DECIMAL_SIZE]);

#endif
