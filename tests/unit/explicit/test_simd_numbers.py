"""Arithmetic over lanes: against exact rational numbers, NumPy, and the same kernel run by Warp itself."""

from dataclasses import replace
from fractions import Fraction
from functools import cache
from typing import Any

import numpy as np
import pytest
import warp as wp
from lane_kernels import (
    MAPPINGS,
    PRECISION,
    Inputs,
    N,
    Results,
    inputs,
    lane_launch,
    scalar_launch,
    small_structs,
)

from explicit.precision import Precision
from explicit.simd import Mapping

BOTH = [pytest.param(p, m, id=f"{p.name}-{m}") for p in PRECISION for m in MAPPINGS]


@cache
def numbers_kernel(numbers: Precision) -> Any:
    """Many operations, each to its own slot."""
    structs = small_structs(numbers)
    Body, Batch, State, Output = structs.Body, structs.Batch, structs.State, structs.Output
    real, vec2, vec4 = numbers.real, numbers.vec2, numbers.vec4
    one, half, infinity = real(1.0), real(0.5), real(np.inf)
    seven = 7

    @wp.kernel(module="unique", enable_backward=False)
    def kernel(body: Body, batch: Batch, state: State, output: Output, first: int):
        index, _lane = wp.tid()
        sample = first + index
        x, y, z = batch.x[sample], batch.y[sample], batch.z[sample]
        k = batch.k[sample]
        out, whole = output.values[sample], output.whole[sample]
        # rounded once
        out[0] = x * y + z
        out[1] = z - x * y
        out[2] = x * y - z
        out[3] = x * y - z * z
        total = real(z)
        total += x * y
        total -= y * z
        out[4] = total
        # rounded once an operation
        product = x * y
        out[5] = product + z
        out[6] = x / y
        out[7] = -x + y - half
        out[8] = (x + y) * (x - y)
        # numbers that are not
        out[9] = wp.max(x, y)
        out[10] = wp.max(y, x)
        out[11] = wp.min(x, y)
        out[12] = wp.min(y, x)
        out[13] = wp.sign(x)
        out[14] = wp.abs(x)
        out[15] = wp.sqrt(wp.abs(z))
        out[16] = wp.cbrt(x)
        out[17] = wp.clamp(x, -one, half)
        out[18] = real(int(wp.isfinite(x)))
        out[19] = infinity
        out[20] = -infinity + z
        # vectors
        v, pair = vec2(batch.v[sample]), batch.pairs[sample]
        w = vec2(z, y)
        out[21] = wp.dot(v, w)
        out[22] = wp.dot(vec4(x, y, z, one), vec4(z, z, y, x))
        w = w - pair.factor * v
        out[23] = w[0]
        out[24] = (-w * half + pair.arm)[1]
        both = vec2(y)
        out[25] = both[0] + both[1]
        w, v = v, w
        out[26] = w[0] - v[1]
        # conversions
        out[27] = real(k)
        out[28] = real(int(z * real(100.0)))
        out[29] = real(wp.float64(wp.float32(z)))
        out[30] = real(z > y)
        whole[0] = int(z * real(100.0))
        whole[1] = k * seven - 3
        whole[2] = (k + 2) % 3
        whole[3] = (11 * k + 5) / (k + 1)
        whole[4] = int(z > y)
        whole[5] = int(not (z > y))
        whole[6] = -k
        whole[7] = wp.max(k, 2) + wp.min(k, body.two) * 10
        whole[8] = wp.clamp(k, 1, 3)
        whole[9] = wp.abs(k - 3)
        whole[10] = batch.rows.shape[0] * 100 + batch.rows.shape[1]
        whole[11] = int(wp.bool(k)) + 2 * int((z > y) == (k > 2))
        row = batch.rows[k]
        whole[12] = row.shape[0]

    return kernel


@cache
def given(numbers: Precision) -> Inputs:
    """Random numbers; x is also what is not a number, infinite, zero or of any size."""
    random = inputs(numbers)
    x, y = random.x.copy(), random.y.copy()
    x[:6] = np.nan, np.inf, -np.inf, 0.0, -0.0, 1e-6
    y[10], x[10] = np.nan, 1.5
    return replace(random, x=x, y=y)


@cache
def results(numbers: Precision, mapping: Mapping | None) -> Results:
    if mapping is None:
        return scalar_launch(numbers_kernel(numbers), numbers, given(numbers))
    return lane_launch(numbers_kernel(numbers), numbers, given(numbers), mapping)


def exactly(numbers: Precision, a: Fraction) -> Any:
    return numbers.dtype(float(a))


@pytest.mark.parametrize(("numbers", "mapping"), BOTH)
def test_a_product_that_is_added_is_rounded_once(numbers: Precision, mapping: Mapping) -> None:
    got, data = results(numbers, mapping).values, given(numbers)
    for i in range(N):
        if not (np.isfinite(data.x[i]) and np.isfinite(data.y[i])):
            continue
        x, y, z = (Fraction(float(a[i])) for a in (data.x, data.y, data.z))
        xy = Fraction(float(data.x[i] * data.y[i]))  # of two products the left one is rounded before
        total = Fraction(float(exactly(numbers, z + x * y)))
        expected = [x * y + z, z - x * y, x * y - z, xy - z * z, total - y * z]
        assert got[i, :5].tolist() == [exactly(numbers, e) for e in expected]


@pytest.mark.parametrize(("numbers", "mapping"), BOTH)
def test_everything_else_is_rounded_as_numpy_does(numbers: Precision, mapping: Mapping) -> None:
    got, d = results(numbers, mapping).values, given(numbers)
    with np.errstate(all="ignore"):
        expected = {
            5: d.x * d.y + d.z,
            6: d.x / d.y,
            7: -d.x + d.y - numbers.dtype(0.5),
            8: (d.x + d.y) * (d.x - d.y),
            14: np.abs(d.x),
            15: np.sqrt(np.abs(d.z)),
            19: np.full(N, np.inf),
            20: np.full(N, -np.inf),
            25: d.y + d.y,
        }
    for slot, values in expected.items():
        np.testing.assert_array_equal(got[:, slot], values.astype(numbers.dtype), err_msg=f"slot {slot}")


@pytest.mark.parametrize(("numbers", "mapping"), BOTH)
def test_what_is_not_a_number(numbers: Precision, mapping: Mapping) -> None:
    got, d = results(numbers, mapping).values, given(numbers)
    # A number wins over NaN, as in C's fmax, Warp and CUDA.
    np.testing.assert_array_equal(got[:, 9], np.fmax(d.x, d.y))
    np.testing.assert_array_equal(got[:, 10], np.fmax(d.x, d.y))
    np.testing.assert_array_equal(got[:, 11], np.fmin(d.x, d.y))
    np.testing.assert_array_equal(got[:, 12], np.fmin(d.x, d.y))
    np.testing.assert_array_equal(got[:, 13], np.where(d.x < 0, -1.0, 1.0))  # 1 for NaN and both zeros
    np.testing.assert_array_equal(got[:, 17], np.fmin(np.fmax(d.x, -1.0), 0.5))
    np.testing.assert_array_equal(got[:, 18], np.isfinite(d.x))


@pytest.mark.parametrize(("numbers", "mapping"), BOTH)
def test_integers_and_truth_values(numbers: Precision, mapping: Mapping) -> None:
    got, d = results(numbers, mapping), given(numbers)
    cut = (d.z * numbers.dtype(100.0)).astype(np.int32)  # toward zero
    k, greater = d.k, d.z > d.y
    expected = [cut, 7 * k - 3, (k + 2) % 3, (11 * k + 5) // (k + 1), greater, ~greater, -k]
    expected += [np.maximum(k, 2) + 10 * np.minimum(k, 2), np.clip(k, 1, 3), np.abs(k - 3)]
    expected += [np.full(N, 507), (k != 0) + 2 * (greater == (k > 2)), np.full(N, 7)]
    for slot, values in enumerate(expected):
        np.testing.assert_array_equal(got.whole[:, slot], values, err_msg=f"slot {slot}")
    for slot, values in ((27, k), (28, cut), (29, d.z.astype(np.float32)), (30, greater)):
        np.testing.assert_array_equal(got.values[:, slot], values, err_msg=f"slot {slot}")
    assert not np.signbit(got.values[:, 30]).any()


@pytest.mark.parametrize(("numbers", "mapping"), BOTH)
def test_warp_itself_agrees(numbers: Precision, mapping: Mapping) -> None:
    got, warp = results(numbers, mapping), results(numbers, None)
    np.testing.assert_array_equal(got.whole, warp.whole)
    # A few roundings of numbers of size 10 where a sum is fused, else none.
    tolerance = 50 * np.finfo(numbers.dtype).eps
    np.testing.assert_allclose(got.values[:, :31], warp.values[:, :31], rtol=tolerance, atol=tolerance)


@pytest.mark.parametrize("numbers", PRECISION, ids=lambda p: p.name)
def test_the_mappings_agree_bit_for_bit(numbers: Precision) -> None:
    a, b = (results(numbers, mapping) for mapping in MAPPINGS)
    rest = np.arange(a.values.shape[1]) != 16  # cbrt of one number is the library's, of a pack our own
    np.testing.assert_array_equal(a.values[:, rest], b.values[:, rest])
    np.testing.assert_array_equal(a.whole, b.whole)


@pytest.mark.parametrize(("numbers", "mapping"), BOTH)
def test_cube_roots(numbers: Precision, mapping: Mapping) -> None:
    roots = np.geomspace(1e-2, 1e2, 10 * N)
    roots[::2] *= -1.0
    roots[7] = 0.0
    rtol = 1e-15 if numbers.name == "fp64" else 1e-7
    for part in roots.reshape(10, N):
        x = (part**3).astype(numbers.dtype)
        got = lane_launch(numbers_kernel(numbers), numbers, replace(given(numbers), x=x), mapping).values[
            :, 16
        ]
        exact = np.cbrt(x.astype(np.longdouble))
        np.testing.assert_allclose(got, exact.astype(float), rtol=rtol)
        assert (got[x == 0.0] == 0.0).all()
