"""Elementary functions in plain arithmetic, on floats and on `twin.compiled.simd.Four` alike.

The C library's take one number and cannot be inlined, which costs most of a tyre's time. These
are good to a few units in the last place, and the same on every machine.
"""

import math

from twin.compiled.simd import (
    absolute,
    copysign,
    inlined,
    maximum,
    minimum,
    polynomial,
    power_of_two,
    rounded,
    sqrt,
    where,
)

# pi and ln 2 as sums of a short number, whose small multiples are exact, and the rest
PI_SHORT, PI_REST = 3.1415926218032837, 3.178650954705639e-08
LN2_SHORT, LN2_REST = 0.693145751953125, 1.42860682030941723212e-6
# Taylor series less their first terms, highest power first: what they leave out is below rounding
# for |x| < pi/2 and |x| < ln(2)/2.
SINE = tuple((-1.0) ** n / math.factorial(2 * n + 1) for n in range(10, 0, -1))
EXPONENTIAL = tuple(1.0 / math.factorial(n) for n in range(13, -1, -1))
# atan(x) = x + x^3 P(x^2)/Q(x^2) for |x| < 0.66: Moshier, Cephes Mathematical Library, atan.c
ARCTAN_P = (
    -8.750608600031904122785e-1,
    -1.615753718733365076637e1,
    -7.500855792314704667340e1,
    -1.228866684490136173410e2,
    -6.485021904942025371773e1,
)
ARCTAN_Q = (
    1.0,
    2.485846490142306297962e1,
    1.650270098316988542046e2,
    4.328810604912902668951e2,
    4.853903996359136964868e2,
    1.945506571482613964425e2,
)
PI_2_REST = 6.123233995736766e-17  # pi/2 less its nearest float64


@inlined
def clip(x, least, largest):
    """The number, held within limits."""
    return minimum(maximum(x, least), largest)


@inlined
def atan(x):
    """Arc tangent."""
    size = absolute(x)
    large, middle = size > 1.0 + math.sqrt(2.0), size > 0.66
    # atan(x) = pi/2 + atan(-1/x) = pi/4 + atan((x - 1)/(x + 1))
    above = where(large, -1.0, where(middle, size - 1.0, size))
    below = where(large, size, where(middle, size + 1.0, 1.0))
    share = where(large, 1.0, where(middle, 0.5, 0.0))
    t = above / below
    z = t * t
    rest = z * polynomial(ARCTAN_P, z) / polynomial(ARCTAN_Q, z)
    return copysign(share * (0.5 * math.pi) + (t * rest + t + share * PI_2_REST), x)


@inlined
def sin(x):
    """Sine, for |x| up to some 1e5."""
    return _sine_beyond(x, rounded(x * (1.0 / math.pi)), 0.0)


@inlined
def cos(x):
    """Cosine, for |x| up to some 1e5."""
    return -_sine_beyond(x, rounded(x * (1.0 / math.pi) - 0.5), 0.5)


@inlined
def _sine_beyond(x, turns, more):
    """(-1)^turns sin(x - (turns + more) pi) of an angle within +-pi/2."""
    k = turns + more
    r = (x - k * PI_SHORT) - k * PI_REST
    odd = absolute(turns - 2.0 * rounded(0.5 * turns))
    z = r * r
    return (1.0 - 2.0 * odd) * (r + r * z * polynomial(SINE, z))


@inlined
def exp(x):
    """Exponential function, for |x| up to 700; beyond, its value there."""
    x = clip(x, -700.0, 700.0)
    k = rounded(x * (1.0 / math.log(2.0)))
    r = (x - k * LN2_SHORT) - k * LN2_REST
    return polynomial(EXPONENTIAL, r) * power_of_two(k)


@inlined
def asin(x):
    """Arc sine; beyond +-1 its value there."""
    return atan(x / sqrt(maximum(1.0 - x * x, 0.0)))
