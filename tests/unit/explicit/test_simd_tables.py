"""Constants in groups and rows of four: by one lane, by all lanes together, and by Warp itself."""

from functools import cache
from typing import Any

import numpy as np
import pytest
import warp as wp
from lane_kernels import (
    CONSTANTS,
    ELEMENTS,
    MAPPINGS,
    PRECISION,
    SLOTS,
    UNTOUCHED,
    N,
    Results,
    inputs,
    lane_launch,
    lanes_of,
    scalar_launch,
    small_structs,
)

from explicit.layout.lanes import lane_functions
from explicit.layout.structs import GROUP, entry_function, four_function, grouped
from explicit.precision import Precision
from explicit.simd import Mapping

EVERY = [pytest.param(p, m, id=f"{p.name}-{m or 'warp'}") for p in PRECISION for m in (*MAPPINGS, None)]
FAR = 1_000_000_000
"""Where no array reaches."""


def launched(kernel: Any, numbers: Precision, mapping: Mapping | None) -> Results:
    if mapping is None:
        return scalar_launch(kernel, numbers, inputs(numbers))
    return lane_launch(kernel, numbers, inputs(numbers), mapping)


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


@pytest.mark.parametrize(("numbers", "mapping"), EVERY)
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


@pytest.mark.parametrize(("numbers", "mapping"), EVERY)
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
