import math

import numpy as np
import pytest
from numba import njit

from twin.compiled import elementary
from twin.compiled.simd import load, unpack

RNG = np.random.default_rng(1)
ANGLES = np.concatenate([RNG.uniform(-40.0, 40.0, 2000), RNG.uniform(-1e-3, 1e-3, 500), [0.0]])
NUMBERS = np.concatenate(
    [RNG.normal(0.0, 3.0, 2000), 10.0 ** RNG.uniform(-12, 12, 500), [0.0, np.inf]]
)
ARGUMENTS = {
    "atan": NUMBERS,
    "sin": ANGLES,
    "cos": ANGLES,
    "exp": RNG.uniform(-700.0, 700.0, 2000),
    "asin": RNG.uniform(-1.0, 1.0, 2000),
}


def on_floats(name, values):
    function = getattr(elementary, name)

    @njit
    def apply(values, out):
        for i in range(values.size):
            out[i] = function(values[i])

    out = np.empty(values.size)
    apply(values, out)
    return out


def on_fours(name, values):
    function = getattr(elementary, name)

    @njit
    def apply(values, out):
        for i in range(0, values.size - 3):
            out[i : i + 4] = np.array(unpack(function(load(values.ctypes, i))))

    out = np.empty(values.size)
    apply(values, out)
    return out


@pytest.mark.parametrize("name", ["atan", "exp"])
def test_atan_and_exp_are_good_to_two_units_in_the_last_place(name):
    values = ARGUMENTS[name]
    expected = np.array([getattr(math, name)(value) for value in values])
    assert np.all(np.abs(on_floats(name, values) - expected) <= 2.0 * np.spacing(np.abs(expected)))


@pytest.mark.parametrize("name", ["sin", "cos", "asin"])
def test_sin_cos_and_asin_are_good_to_rounding(name):
    values = ARGUMENTS[name]
    expected = np.array([getattr(math, name)(value) for value in values])
    np.testing.assert_allclose(on_floats(name, values), expected, rtol=0.0, atol=1e-15)


def test_small_angles_keep_their_relative_accuracy():
    angles = 10.0 ** np.linspace(-300, -3, 200)
    for name in ("sin", "atan", "asin"):
        expected = [getattr(math, name)(angle) for angle in angles]
        np.testing.assert_allclose(on_floats(name, angles), expected, rtol=1e-15)


@pytest.mark.parametrize("name", list(ARGUMENTS))
def test_four_at_once_are_to_the_bit_one_by_one(name):
    values = ARGUMENTS[name]
    assert np.array_equal(on_fours(name, values), on_floats(name, values))
