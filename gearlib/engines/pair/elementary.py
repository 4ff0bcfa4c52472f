"""exp, sine and cosine as plain arithmetic, for tables that are filled at every tuning.

A call into the C library costs several times as much and prevents vectorised loops. The
error is one unit in the last place of the result for `decay`, of 1 for `cos_sin`.
"""

import numpy as np

from gearlib.engines.jit import inlined_kernel

#: 1.5 * 2^52: adding it leaves the nearest integer in the last bits of the sum.
_ROUNDING = 6755399441055744.0
_LOG2_E = 1.4426950408889634
_TWO_OVER_PI = 0.6366197723675814
# ln 2 and pi / 2 in two parts, the first with so few bits that its small multiples are exact.
_LN2_HIGH, _LN2_LOW = 6.93147180369123816490e-01, 1.90821492927058770002e-10
_QUARTER_HIGH, _QUARTER_LOW = 1.57079632673412561417, 6.07710050650619224932e-11
#: Largest exponent: exp(-700) = 1e-304 replaces all smaller values.
_MAX_EXPONENT = 700.0


@inlined_kernel
def decay(z):
    """Return exp(-z) for z >= 0 to one unit in the last place, by arithmetic only."""
    z = z if z < _MAX_EXPONENT else _MAX_EXPONENT
    # exp(-z) = 2^k exp(r), where k is an integer and |r| <= ln 2 / 2.
    rounded = _ROUNDING - z * _LOG2_E
    k = rounded - _ROUNDING
    r = (-z - k * _LN2_HIGH) - k * _LN2_LOW
    # Taylor series up to r^13 / 13!; even and odd terms are summed in parallel.
    s = r * r
    even = s * (1.0 / 3628800.0 + s * (1.0 / 479001600.0))
    even = 0.5 + s * (1.0 / 24.0 + s * (1.0 / 720.0 + s * (1.0 / 40320.0) + s * even))
    odd = s * (1.0 / 39916800.0 + s * (1.0 / 6227020800.0))
    odd = 1.0 / 6.0 + s * (1.0 / 120.0 + s * (1.0 / 5040.0 + s * (1.0 / 362880.0) + s * odd))
    # Shifted to the exponent bits of a double, k gives 2^k.
    bits = (np.float64(rounded).view(np.int64) + 1023) << 52
    return (1.0 + (r + s * (even + r * odd))) * np.int64(bits).view(np.float64)


@inlined_kernel
def cos_sin(angle):
    """Return (cosine, sine) of an angle in rad, at most 2^20 quarter turns, by arithmetic only."""
    rounded = angle * _TWO_OVER_PI + _ROUNDING
    k = rounded - _ROUNDING
    r = (angle - k * _QUARTER_HIGH) - k * _QUARTER_LOW
    # The angle is k quarter turns plus r, |r| <= pi / 4. The coefficients are those of fdlibm.
    z = r * r
    s = 2.75573137070700676789e-06 + z * (
        -2.50507602534068634195e-08 + z * 1.58969099521155010221e-10
    )
    s = 8.33333333332248946124e-03 + z * (-1.98412698298579493134e-04 + z * s)
    sine = r + r * z * (-1.66666666666666324348e-01 + z * s)
    c = -2.75573143513906633035e-07 + z * (
        2.08757232129817482790e-09 - z * 1.13596475577881948265e-11
    )
    c = -1.38888888888741095749e-03 + z * (2.48015872894767294178e-05 + z * c)
    cosine = 1.0 - (0.5 * z - z * z * (4.16666666666666019037e-02 + z * c))
    quarter = np.float64(rounded).view(np.int64)
    is_odd = (quarter & 1) != 0
    turned_cosine, turned_sine = (sine, cosine) if is_odd else (cosine, sine)
    turned_cosine = -turned_cosine if ((quarter + 1) & 2) != 0 else turned_cosine
    turned_sine = -turned_sine if (quarter & 2) != 0 else turned_sine
    return turned_cosine, turned_sine
