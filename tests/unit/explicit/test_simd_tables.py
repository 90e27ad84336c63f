"""Constants in groups and rows of four: by one lane, by all lanes together, and by Warp."""

from dataclasses import replace
from fractions import Fraction
from functools import cache
from typing import Any

import numpy as np
import pytest
import warp as wp
from lane_kernels import (
    CONSTANTS,
    EACH,
    ELEMENTS,
    LANES,
    MAPPINGS,
    PRECISION,
    SLOTS,
    UNTOUCHED,
    Inputs,
    N,
    Results,
    inputs,
    lanes_of,
    launched,
    small_structs,
)

from explicit.layout.lanes import lane_functions
from explicit.layout.structs import GROUP, entry_function, four_function, grouped
from explicit.precision import PRECISIONS, Precision
from explicit.simd import Mapping

FAR = 1_000_000_000  # where no array reaches


# A table in groups ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("n", [1, GROUP - 1, GROUP, GROUP + 1, 3 * GROUP, 100])
@pytest.mark.parametrize("dtype", [np.float64, np.float32, np.int64])
def test_a_table_in_groups_holds_what_it_held(n: int, dtype: Any) -> None:
    table = np.arange(7 * n).reshape(7, n).astype(dtype)
    groups = grouped(table)
    assert groups.dtype == dtype
    assert groups.flags.c_contiguous
    assert groups.shape == (-(-n // GROUP), 7 * GROUP)
    for e in range(n):  # where `entry` looks
        np.testing.assert_array_equal(groups[e // GROUP, np.arange(7) * GROUP + e % GROUP], table[:, e])
    back = groups.reshape(-1, 7, GROUP).transpose(1, 0, 2).reshape(7, -1)
    np.testing.assert_array_equal(back[:, :n], table)
    # what is past the end is an element there is, so that a lane without one computes nothing strange
    np.testing.assert_array_equal(back[:, n:], np.repeat(table[:, -1:], back.shape[1] - n, axis=1))


@cache
def entry_kernel(numbers: Precision) -> Any:
    structs = small_structs(numbers)
    Body, Batch, State, Output = structs.Body, structs.Batch, structs.State, structs.Output
    number, whole_at = entry_function(numbers.real), entry_function(wp.int32)
    n_workers, zero, far = lane_functions().n_workers, numbers.real(0.0), FAR

    @wp.kernel(module="unique", enable_backward=False)
    def kernel(body: Body, batch: Batch, state: State, output: Output, first: int):
        index, lane = wp.tid()
        sample = first + index
        x, k = batch.x[sample], batch.k[sample]
        e = lane
        while e < body.n:
            # by lanes in step, and at places that they look up
            output.values[sample, e] = number(body.table, 1, e)
            node = whole_at(body.numbers, 3, e)
            output.whole[sample, e] = node
            there = number(body.table, body.two, body.place[e])
            output.sums[sample, e] = wp.float64(there)
            # where some lanes have no place to look at
            nowhere = body.place[e] + far
            if node > 0:
                nowhere = body.place[e]
                output.values[sample, e] = number(body.table, 4, nowhere)
            e += n_workers()
        if lane == 0:
            # a place that all lanes share, and one that is a simulation's own
            output.values[sample, 40] = number(body.table, 0, 35) - number(body.table, 2, body.two)
            output.values[sample, 41] = number(body.table, 3, 9 * k)
            output.whole[sample, 41] = whole_at(body.numbers, 4, 9 * k + 1 - k / 4)
            place = int(far)
            if x > zero:
                place = 8 * k
                output.values[sample, 42] = number(body.table, 0, place)
                output.whole[sample, 42] = whole_at(body.numbers, 0, place)

    return kernel


@EACH
def test_every_constant_is_found_in_its_group(numbers: Precision, mapping: Mapping | None) -> None:
    got, d = launched(entry_kernel(numbers), numbers, mapping), inputs(numbers)
    assert ELEMENTS > GROUP
    assert ELEMENTS % lanes_of(numbers)
    whole = np.full((N, SLOTS), UNTOUCHED)
    whole[:, :ELEMENTS] = d.numbers[3]
    whole[:, 41] = d.numbers[4, 9 * d.k + 1 - d.k // 4]
    whole[d.x > 0, 42] = d.numbers[0, 8 * d.k[d.x > 0]]
    np.testing.assert_array_equal(got.whole, whole)
    values = np.full((N, SLOTS), UNTOUCHED, dtype=numbers.dtype)
    values[:, :ELEMENTS] = np.where(d.numbers[3] > 0, d.table[4, d.place], d.table[1])
    values[:, 40] = d.table[0, 35] - d.table[2, 2]
    values[:, 41] = d.table[3, 9 * d.k]
    values[d.x > 0, 42] = d.table[0, 8 * d.k[d.x > 0]]
    np.testing.assert_array_equal(got.values, values)
    np.testing.assert_array_equal(got.sums[:, :ELEMENTS], np.tile(d.table[2, d.place], (N, 1)))
    assert len(d.table) == CONSTANTS
    assert set(9 * d.k // GROUP) == {0, 1}  # both groups are asked for


# Rows of four --------------------------------------------------------------------------------------------


@cache
def four_kernel(numbers: Precision) -> Any:
    """What `four` finds, and whether subscripts find the same."""
    structs = small_structs(numbers)
    Body, Batch, State, Output = structs.Body, structs.Batch, structs.State, structs.Output
    four = four_function(numbers)
    real, vec4 = numbers.real, numbers.vec4
    n_workers, zero, far = lane_functions().n_workers, real(0.0), FAR

    @wp.func
    def subscripts(row: wp.array(dtype=real), k: int):
        return vec4(row[k], row[k + 1], row[k + 2], row[k + 3])

    @wp.func
    def mixed(c: vec4):
        """A number that their order changes. Halving is exact: fused or not, it rounds alike."""
        return ((c[0] * real(0.5) - c[1]) * real(0.5) - c[2]) * real(0.5) - c[3]

    @wp.kernel(module="unique", enable_backward=False)
    def kernel(body: Body, batch: Batch, state: State, output: Output, first: int):
        index, lane = wp.tid()
        sample = first + index
        x, k = batch.x[sample], batch.k[sample]
        e = lane
        while e < body.n:
            # lanes in step, each four beginning inside another; then places that they look up
            found, wanted = four(body.weight, e), subscripts(body.weight, e)
            output.whole[sample, e] = 0
            for c in range(4):
                if found[c] != wanted[c]:
                    output.whole[sample, e] = 1
            output.values[sample, e] = mixed(four(body.weight, body.place[e]))
            # where some lanes have no place to look at
            nowhere = body.place[e] + far
            output.sums[sample, e] = wp.float64(0.0)
            if body.weight[e] > zero:
                nowhere = body.place[e]
                past = four(body.weight, nowhere)
                output.sums[sample, e] = wp.float64(past[3])
            e += n_workers()
        if lane == 0:
            row, own = batch.rows[2], batch.rows[k]
            a, b = four(row, 1 + body.two), four(row, 3 - k % 3)
            d, f = four(own, 1), four(own, k % 4)
            for c in range(4):
                output.sums[sample, 37 + c] = wp.float64(a[c])
                output.sums[sample, 41 + c] = wp.float64(b[c])
                output.values[sample, 37 + c] = d[c]
                output.values[sample, 41 + c] = f[c]
            place = int(far)
            if x > zero:
                place = k % 3
                g = four(batch.rows[k], place)
                output.values[sample, 45] = g[0]
                output.values[sample, 46] = g[3]
            else:
                g = four(batch.rows[4 - k], 3)
                output.values[sample, 45] = g[1]
                output.values[sample, 46] = g[2]

    return kernel


@EACH
def test_four_numbers_are_those_of_four_subscripts(numbers: Precision, mapping: Mapping | None) -> None:
    got, d = launched(four_kernel(numbers), numbers, mapping), inputs(numbers)
    assert (got.whole[:, :ELEMENTS] == 0).all()
    weight = np.pad(d.weight, (0, 3)).astype(numbers.dtype)
    c, half = weight[d.place[:, None] + np.arange(4)].T, numbers.dtype(0.5)
    mixed = ((c[0] * half - c[1]) * half - c[2]) * half - c[3]
    np.testing.assert_array_equal(got.values[:, :ELEMENTS], np.tile(mixed, (N, 1)))
    third = np.where(d.weight > 0, c[3], 0.0)
    np.testing.assert_array_equal(got.sums[:, :ELEMENTS], np.tile(third, (N, 1)))
    for i in range(N):
        k = int(d.k[i])
        own = d.rows[k]
        np.testing.assert_array_equal(got.sums[i, 37:41], d.rows[2, 3:7])
        np.testing.assert_array_equal(got.sums[i, 41:45], d.rows[2, 3 - k % 3 :][:4])
        np.testing.assert_array_equal(got.values[i, 37:41], own[1:5])
        np.testing.assert_array_equal(got.values[i, 41:45], own[k % 4 :][:4])
        ends = (own[k % 3], own[k % 3 + 3]) if d.x[i] > 0 else d.rows[4 - k, 4:6]
        np.testing.assert_array_equal(got.values[i, 45:47], ends)


@pytest.mark.parametrize("numbers", PRECISION, ids=lambda p: p.name)
def test_the_derivative_of_four_numbers_goes_back_to_their_places(numbers: Precision) -> None:
    four, real = four_function(numbers), numbers.real
    factor = numbers.vec4(*(real(value) for value in (1.0, 2.0, 4.0, 8.0)))

    @wp.kernel(module="unique")
    def kernel(row: wp.array(dtype=real), out: wp.array(dtype=real)):
        out[0] = wp.dot(four(row, 2), factor) + wp.dot(four(row, 3), factor)

    row = wp.array(np.arange(8.0), dtype=real, requires_grad=True, device="cpu")
    out = wp.zeros(1, dtype=real, requires_grad=True, device="cpu")
    with wp.Tape() as tape:
        wp.launch(kernel, dim=1, inputs=[row], outputs=[out], device="cpu")
    tape.backward(out)
    assert out.numpy()[0] == 2 + 6 + 16 + 40 + 3 + 8 + 20 + 48
    np.testing.assert_array_equal(row.grad.numpy(), [0, 0, 1, 3, 6, 12, 8, 0])


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
    return launched(numbers_kernel(numbers), numbers, mapping, given(numbers))


def exactly(numbers: Precision, a: Fraction) -> Any:
    return numbers.dtype(float(a))


@LANES
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


@LANES
def test_everything_else_is_rounded_as_numpy_does_and_what_is_no_number(
    numbers: Precision, mapping: Mapping
) -> None:
    got, d = results(numbers, mapping).values, given(numbers)
    with np.errstate(all="ignore"):
        expected = {
            5: d.x * d.y + d.z, 6: d.x / d.y, 7: -d.x + d.y - numbers.dtype(0.5),
            8: (d.x + d.y) * (d.x - d.y), 14: np.abs(d.x), 15: np.sqrt(np.abs(d.z)), 19: np.full(N, np.inf),
            20: np.full(N, -np.inf), 25: d.y + d.y,
        }  # fmt: skip
    for slot, values in expected.items():
        np.testing.assert_array_equal(got[:, slot], values.astype(numbers.dtype), err_msg=f"slot {slot}")
    # A number wins over NaN, as in C's fmax, Warp and CUDA.
    np.testing.assert_array_equal(got[:, 9], np.fmax(d.x, d.y))
    np.testing.assert_array_equal(got[:, 10], np.fmax(d.x, d.y))
    np.testing.assert_array_equal(got[:, 11], np.fmin(d.x, d.y))
    np.testing.assert_array_equal(got[:, 12], np.fmin(d.x, d.y))
    np.testing.assert_array_equal(got[:, 13], np.where(d.x < 0, -1.0, 1.0))  # 1 for NaN and both zeros
    np.testing.assert_array_equal(got[:, 17], np.fmin(np.fmax(d.x, -1.0), 0.5))
    np.testing.assert_array_equal(got[:, 18], np.isfinite(d.x))


@LANES
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


@LANES
def test_warp_itself_agrees(numbers: Precision, mapping: Mapping) -> None:
    got, warp = results(numbers, mapping), results(numbers, None)
    np.testing.assert_array_equal(got.whole, warp.whole)
    # A few roundings of numbers of size 10 where a sum is fused, else none.
    tolerance = 50 * np.finfo(numbers.dtype).eps
    np.testing.assert_allclose(got.values[:, :31], warp.values[:, :31], rtol=tolerance, atol=tolerance)


def test_the_mappings_agree_bit_for_bit() -> None:
    a, b = (results(PRECISIONS["fp64"], mapping) for mapping in MAPPINGS)
    rest = np.arange(a.values.shape[1]) != 16  # cbrt of one number is the library's, of a pack our own
    np.testing.assert_array_equal(a.values[:, rest], b.values[:, rest])
    np.testing.assert_array_equal(a.whole, b.whole)


@LANES
def test_cube_roots(numbers: Precision, mapping: Mapping) -> None:
    roots = np.geomspace(1e-2, 1e2, 10 * N)
    roots[::2] *= -1.0
    roots[7] = 0.0
    rtol = 1e-15 if numbers.name == "fp64" else 1e-7
    for part in roots.reshape(10, N):
        x = (part**3).astype(numbers.dtype)
        got = launched(numbers_kernel(numbers), numbers, mapping, replace(given(numbers), x=x)).values[:, 16]
        exact = np.cbrt(x.astype(np.longdouble))
        np.testing.assert_allclose(got, exact.astype(float), rtol=rtol)
        assert (got[x == 0.0] == 0.0).all()


@cache
def kernel_of(numbers: Precision) -> Any:
    structs = small_structs(numbers)
    Body, Batch, State, Output = structs.Body, structs.Batch, structs.State, structs.Output

    @wp.kernel(module="unique", enable_backward=False)
    def kernel(body: Body, batch: Batch, state: State, output: Output, first: int):
        index, lane = wp.tid()
        sample = first + index
        if lane == 0:
            output.values[sample, 0] = wp.exp(batch.x[sample])
            output.values[sample, 1] = wp.log(batch.y[sample])

    return kernel


def evaluated(numbers: Precision, mapping: Mapping, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Both functions of many numbers, N at a time, shape [n, 2]."""
    found = []
    for k in range(0, len(x), N):
        given = replace(inputs(numbers), x=x[k : k + N], y=y[k : k + N])
        found.append(launched(kernel_of(numbers), numbers, mapping, given).values[:, :2])
    return np.concatenate(found)


@LANES
def test_exponentials_and_logarithms_are_those_of_numpy_to_their_ends(
    numbers: Precision, mapping: Mapping
) -> None:
    rng = np.random.default_rng(5)
    wide = 700.0 if numbers.name == "fp64" else 85.0
    x = np.concatenate([rng.uniform(-wide, wide, 10 * N), rng.normal(0.0, 1e-3, 10 * N), rng.normal(size=N)])
    y = np.concatenate([np.exp(x[: 10 * N]), 1.0 + x[10 * N : 20 * N], np.full(N, 2.0) + np.arange(N)])
    x, y = x.astype(numbers.dtype), y.astype(numbers.dtype)
    got = evaluated(numbers, mapping, x, y).astype(float)
    # Two units in the last place of each: the series leaves out less, but three operations round.
    last = 2.0 * float(np.finfo(numbers.dtype).eps)
    np.testing.assert_allclose(got[:, 0], np.exp(x.astype(float)), rtol=last)
    np.testing.assert_allclose(got[:, 1], np.log(y.astype(float)), rtol=last)
    infinity, tiny = np.inf, float(np.finfo(numbers.dtype).smallest_subnormal)
    x = np.array([0.0, -0.0, infinity, -infinity, np.nan, 800.0, -800.0, 1e30, -1e30, 1.0, 0.0, 0.0, 0.0])
    y = np.array([0.0, -0.0, infinity, -infinity, np.nan, -1.0, 1.0, tiny, 3.0 * tiny, 2.0, 1.0, 1.0, 1.0])
    x, y = x.astype(numbers.dtype), y.astype(numbers.dtype)
    got = evaluated(numbers, mapping, x, y)
    with np.errstate(all="ignore"):
        np.testing.assert_allclose(got[:, 0], np.exp(x), rtol=3e-7 if numbers.name == "fp32" else 1e-15)
        np.testing.assert_allclose(got[:, 1], np.log(y), rtol=3e-7 if numbers.name == "fp32" else 1e-15)


def test_one_number_of_all_lanes_has_the_bits_of_a_pack() -> None:
    numbers = PRECISIONS["fp64"]
    x, y = np.linspace(-3.0, 3.0, N), np.linspace(0.2, 5.0, N)
    by_lane, by_worker = (evaluated(numbers, mapping, x, y) for mapping in MAPPINGS)
    np.testing.assert_array_equal(by_lane, by_worker)


UNARY = (
    *("sin", "cos", "tan", "sinh", "cosh", "tanh", "asin", "acos", "atan"),
    *("exp", "log", "log2", "log10", "sqrt", "cbrt", "abs", "sign"),
    *("floor", "ceil", "round", "rint", "trunc"),
)
BINARY = ("pow", "atan2", "min", "max")


@cache
def every_function(numbers: Precision) -> Any:
    structs = small_structs(numbers)
    Body, Batch, State, Output = structs.Body, structs.Batch, structs.State, structs.Output
    low, high = numbers.real(-0.75), numbers.real(3.0)

    @wp.kernel(module="unique", enable_backward=False)
    def kernel(body: Body, batch: Batch, state: State, output: Output, first: int):
        index, lane = wp.tid()
        i = first + index
        if lane == 0:
            x, y = batch.x[i], batch.y[i]
            output.values[i, 0] = wp.sin(x)
            output.values[i, 1] = wp.cos(x)
            output.values[i, 2] = wp.tan(x)
            output.values[i, 3] = wp.sinh(x)
            output.values[i, 4] = wp.cosh(x)
            output.values[i, 5] = wp.tanh(x)
            output.values[i, 6] = wp.asin(x)
            output.values[i, 7] = wp.acos(x)
            output.values[i, 8] = wp.atan(x)
            output.values[i, 9] = wp.exp(x)
            output.values[i, 10] = wp.log(x)
            output.values[i, 11] = wp.log2(x)
            output.values[i, 12] = wp.log10(x)
            output.values[i, 13] = wp.sqrt(x)
            output.values[i, 14] = wp.cbrt(x)
            output.values[i, 15] = wp.abs(x)
            output.values[i, 16] = wp.sign(x)
            output.values[i, 17] = wp.floor(x)
            output.values[i, 18] = wp.ceil(x)
            output.values[i, 19] = wp.round(x)
            output.values[i, 20] = wp.rint(x)
            output.values[i, 21] = wp.trunc(x)
            output.values[i, 22] = wp.pow(x, y)
            output.values[i, 23] = wp.atan2(x, y)
            output.values[i, 24] = wp.min(x, y)
            output.values[i, 25] = wp.max(x, y)
            output.values[i, 26] = wp.clamp(x, low, high)
            output.values[i, 27] = wp.where(x < y, x, y * y)
            output.values[i, 28] = x**y
            output.values[i, 29] = wp.pow(y, high)
            if wp.isnan(x):
                output.values[i, 30] = low
            else:
                output.values[i, 30] = wp.pow(wp.abs(x), low)

    return kernel


def numpy_results(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """The same of NumPy in double precision, shape [n, 31]."""
    # Warp's sign of zero is 1; its round goes away from zero at a half; its arcs take what is outside
    # [-1, 1] for the bound.
    named = {
        "sign": np.where(x < 0.0, -1.0, 1.0),
        "round": np.trunc(x + np.copysign(0.5, x)),
        "asin": np.arcsin(np.clip(x, -1.0, 1.0)),
        "acos": np.arccos(np.clip(x, -1.0, 1.0)),
        "atan": np.arctan(x),
    }
    columns = [named[name] if name in named else getattr(np, name)(x) for name in UNARY]
    columns += [x**y, np.arctan2(x, y), np.fmin(x, y), np.fmax(x, y)]
    columns += [np.clip(x, -0.75, 3.0), np.where(x < y, x, y * y), x**y, y**3.0]
    columns += [np.where(np.isnan(x), -0.75, np.abs(x) ** -0.75)]
    return np.stack(columns, axis=1)


@LANES
def test_every_function_is_that_of_numpy(numbers: Precision, mapping: Mapping) -> None:
    rng = np.random.default_rng(7)
    limits = np.finfo(numbers.dtype)
    odd = [0.0, -0.0, 1.0, -1.0, 0.5, -0.5, 1.5, -2.5, 2.0, -3.0, np.pi, 100.0, -100.0]
    far = [
        float(limits.tiny), -float(limits.tiny), float(limits.smallest_subnormal), 1e15, -1e30, 1e30,
        float(limits.max),
    ]  # fmt: skip
    x = np.concatenate([odd, far, rng.uniform(-1.0, 1.0, 3 * N), rng.normal(0.0, 20.0, 3 * N), odd, odd])
    y = np.concatenate([rng.uniform(-3.0, 3.0, len(x) - 2 * N), odd[::-1], rng.integers(-4, 5, N)])
    x, y = x.astype(numbers.dtype), y.astype(numbers.dtype)
    found = []
    for k in range(0, len(x) - N + 1, N):
        given = replace(inputs(numbers), x=x[k : k + N], y=y[k : k + N])
        found.append(launched(every_function(numbers), numbers, mapping, given).values[:, :31])
    got = np.concatenate(found)
    with np.errstate(all="ignore"):
        want = numpy_results(x.astype(float), y.astype(float))[: len(got)].astype(numbers.dtype)
    names = [*UNARY, *BINARY, "clamp", "where", "**", "cube", "power of a size"]
    # A scalar library is right to one unit in the last place or two, of NumPy's double rounded once more.
    close = np.isclose(got, want, rtol=4.0 * float(limits.eps), atol=0.0, equal_nan=True)
    tiny = np.abs(want) < 4.0 * float(limits.tiny)  # what is subnormal keeps fewer digits
    with np.errstate(invalid="ignore"):  # infinity less infinity
        close |= tiny & (np.abs(got - want) <= 4.0 * float(limits.smallest_subnormal))
    wrong = [(names[j], x[i], y[i], got[i, j], want[i, j]) for i, j in np.argwhere(~close)]
    assert not wrong


def test_a_function_has_the_same_bits_in_both_mappings() -> None:
    numbers = PRECISIONS["fp64"]
    given = replace(inputs(numbers), x=np.linspace(0.2, 5.0, N), y=np.linspace(-3.0, 3.0, N))
    a, b = (launched(every_function(numbers), numbers, mapping, given).values[:, :31] for mapping in MAPPINGS)
    np.testing.assert_array_equal(a, b)
