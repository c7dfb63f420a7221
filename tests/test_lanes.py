import numpy as np
import pytest
from numba import njit

import models
from twin.compiled import simd as lanes
from twin.compiled.simd import gather, load, scatter, unpack
from twin.tyre.four_tyres import four_tyres, table_of
from twin.tyre.magic_formula import magic_formula
from twin.tyre.record import TYRE_DTYPE
from twin.tyre.tir import read_tyre

A = np.array([1.5, -2.0, 0.25, -0.0])
B = np.array([-3.0, -2.0, 7.0, 2.5])


def test_operators_act_on_each_lane():
    @njit
    def arithmetic(a, b):
        x, y = load(a.ctypes, 0), load(b.ctypes, 0)
        z = x
        z += y
        z *= 2.0
        return unpack(x - y), unpack(x * y), unpack(x / y), unpack(-x), unpack(1.0 - y), unpack(z)

    out = arithmetic(A, B)
    expected = (A - B, A * B, A / B, -A, 1.0 - B, 2.0 * (A + B))
    assert np.array_equal(out, expected)


def test_functions_act_on_each_lane():
    @njit
    def functions(a, b):
        x, y = load(a.ctypes, 0), load(b.ctypes, 0)
        return (
            unpack(lanes.maximum(x, y)),
            unpack(lanes.minimum(x, 0.5)),
            unpack(lanes.absolute(x)),
            unpack(lanes.sqrt(y * y)),
            unpack(lanes.rounded(x)),
            unpack(lanes.copysign(1.0, x)),
            unpack(lanes.where(x < y, x, 9.0)),
            unpack(lanes.power_of_two(y + y)),
        )

    expected = (
        *(np.maximum(A, B), np.minimum(A, 0.5), np.abs(A), np.abs(B), np.rint(A)),
        *(np.copysign(1.0, A), np.where(A < B, A, 9.0), 2.0 ** (2.0 * B)),
    )
    assert np.array_equal(functions(A, B), expected)


@pytest.mark.parametrize(("limit", "holds"), [(-4.0, False), (-2.5, True)])
def test_anywhere_tells_if_some_lane_holds(limit, holds):
    @njit
    def below(a, limit):
        return lanes.anywhere(load(a.ctypes, 0) < limit)

    assert below(B, limit) is holds


def test_scatter_writes_where_gather_reads():
    @njit
    def move(source, ids, target):
        scatter(target.ctypes, ids.ctypes, 3, 1, gather(source.ctypes, ids.ctypes, 3, 2))

    source, target = np.arange(18.0).reshape(6, 3), np.zeros((6, 3))
    ids = np.array([5, 0, 2, 3])
    move(source, ids, target)
    assert np.array_equal(target[ids, 1], source[ids, 2])
    assert np.count_nonzero(target) == 4


def test_four_tyres_at_once_are_to_the_bit_one_by_one():
    tyres = np.full(4, read_tyre(models.path("tyres/suv.tir")), TYRE_DTYPE)
    tyres["lmuy"], tyres["rhx1"] = (1.0, 0.8, 0.6, 0.4), (0.0, 0.01, 0.0, 0.02)
    slips = np.array(
        [[3e3, 6e3, 9e3, 0.0], [0.05, -0.1, 0.0, 0.3], [0.1, -0.02, 0.7, 0.0],
         [0.02, -0.05, 0.0, 0.4], [20.0, -5.0, 0.0, 30.0], [1.0, -1.0, 1.0, -1.0]]
    )  # fmt: skip

    @njit
    def together(table, slips):
        tyre, rows = four_tyres(table.ctypes), slips.ctypes
        fx, fy, mx, my, mz = magic_formula(
            tyre, load(rows, 0), load(rows, 4), load(rows, 8),
            load(rows, 12), load(rows, 16), load(rows, 20),
        )  # fmt: skip
        return unpack(fx), unpack(fy), unpack(mx), unpack(my), unpack(mz)

    alone = [magic_formula(tyre, *slip) for tyre, slip in zip(tyres, slips.T, strict=True)]
    assert np.array_equal(together(table_of(tyres), slips), np.transpose(alone))
