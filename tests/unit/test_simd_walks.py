"""Walks over the elements of a simulation: by one lane, by all lanes together, and by Warp itself."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
import warp as wp
from lane_kernels import (
    ELEMENTS,
    MAPPINGS,
    PRECISION,
    N,
    Results,
    inputs,
    lane_launch,
    lanes_of,
    scalar_launch,
    small_structs,
)

from explicit.lanes import field_function, lane_functions
from explicit.precision import Precision
from explicit.simd import Mapping

BOTH = [pytest.param(p, m, id=f"{p.name}-{m}") for p in PRECISION for m in MAPPINGS]


@cache
def walk_kernel(numbers: Precision) -> Any:
    structs = small_structs(numbers)
    Body, Batch, State, Output = structs.Body, structs.Batch, structs.State, structs.Output
    real = numbers.real
    lanes = lane_functions()
    sync, total, largest = lanes.sync, lanes.total, lanes.largest
    empty_sum, add_to = lanes.empty_sum, lanes.add_to
    ordered_first, ordered_step, ordered_total = lanes.ordered_first, lanes.ordered_step, lanes.ordered_total
    field = field_function(numbers)
    zero, half = real(0.0), real(0.5)
    HALF = wp.float64(0.5)

    @wp.func
    def sweep(body: Body, state: State, sample: int, lane: int, x: real):
        """Write the state and add up, in branches too."""
        u = field(state.u, sample, 0, 0)
        positive, most = empty_sum(), real(0.0)
        e = lane
        while e < body.n:
            share = body.weight[e] * x
            u[e] = share
            state.marks[sample, e] = 0
            if share > zero:
                positive = add_to(positive, wp.float64(share), e)
                state.marks[sample, e] = 1
                if share < half:
                    u[e] = half
            most = wp.max(most, wp.abs(share))
            e += wp.block_dim()
        return positive, wp.float64(most)

    @wp.kernel(module="unique", enable_backward=False)
    def kernel(body: Body, batch: Batch, state: State, output: Output, first: int):
        index, lane = wp.tid()
        sample = first + index
        x = batch.x[sample]
        u = state.u[sample]
        positive, most = sweep(body, state, sample, lane, x)
        sync()
        everything, gathered, twice = empty_sum(), empty_sum(), empty_sum()
        n = lane
        while n < body.n:
            everything = add_to(everything, wp.float64(u[n]), n)
            if state.marks[sample, body.place[n]] == 1:
                gathered = add_to(gathered, wp.float64(u[body.place[n]] * x), n)
            n += wp.block_dim()
        twice += everything
        twice += HALF * positive
        walked = real(0.0)
        e = ordered_first(lane)
        while e < body.n:
            walked = walked + u[e]
            e += ordered_step()
        # a walk whose lanes leave where they like, and what they bring back
        behind = empty_sum()
        k = lane  # alone: in a tuple it would be another name of `lane` to Warp
        while k < body.n and body.weight[k] > -half:
            k += wp.block_dim()
        while k < body.n:
            behind = add_to(behind, wp.float64(1.0), k)
            k += wp.block_dim()
        sum_positive, sum_everything, sum_gathered = total(positive), total(everything), total(gathered)
        sum_twice, found, left = total(twice), largest(most), total(behind)
        if lane == 0:
            output.sums[sample, 0] = sum_positive
            output.sums[sample, 1] = sum_everything
            output.sums[sample, 2] = sum_gathered
            output.sums[sample, 3] = sum_twice
            output.sums[sample, 4] = found
            output.sums[sample, 5] = ordered_total(wp.float64(walked))
            output.sums[sample, 6] = left
        # written side by side
        k = lane
        while k < body.n:
            output.values[sample, k] = u[k]
            k += wp.block_dim()

    return kernel


@cache
def results(numbers: Precision, mapping: Mapping | None) -> Results:
    if mapping is None:
        return scalar_launch(walk_kernel(numbers), numbers, inputs(numbers))
    return lane_launch(walk_kernel(numbers), numbers, inputs(numbers), mapping)


@pytest.mark.parametrize("numbers", PRECISION, ids=lambda p: p.name)
def test_walked_sums_agree_bit_for_bit(numbers: Precision) -> None:
    one, all_lanes = (results(numbers, mapping) for mapping in MAPPINGS)
    np.testing.assert_array_equal(one.sums[:, :6], all_lanes.sums[:, :6])
    np.testing.assert_array_equal(one.values, all_lanes.values)
    np.testing.assert_array_equal(one.u, all_lanes.u)


@pytest.mark.parametrize(("numbers", "mapping"), BOTH)
def test_they_are_made_in_the_order_of_the_lanes(numbers: Precision, mapping: Mapping) -> None:
    """Element k belongs to partial sum k modulo the lanes; halves are added to halves."""
    lanes, u = lanes_of(numbers), results(numbers, None).u.astype(np.float64)
    parts = np.zeros((N, lanes))
    for e in range(ELEMENTS):
        parts[:, e % lanes] += u[:, e]
    while parts.shape[1] > 1:
        half = parts.shape[1] // 2
        parts = parts[:, :half] + parts[:, half:]
    np.testing.assert_array_equal(results(numbers, mapping).sums[:, 1], parts[:, 0])


@pytest.mark.parametrize(("numbers", "mapping"), BOTH)
def test_warp_itself_agrees(numbers: Precision, mapping: Mapping) -> None:
    got, warp = results(numbers, mapping), results(numbers, None)
    np.testing.assert_array_equal(got.values, warp.values)
    np.testing.assert_array_equal(got.u, warp.u)
    np.testing.assert_array_equal(got.sums[:, 4:6], warp.sums[:, 4:6])  # a largest value; a sum in order
    # 37 numbers of size 4 added in another order
    np.testing.assert_allclose(got.sums[:, :4], warp.sums[:, :4], atol=37 * 37 * 4 * 2.2e-16)


@pytest.mark.parametrize("numbers", PRECISION, ids=lambda p: p.name)
def test_lanes_that_stopped_a_walk_go_on_from_there(numbers: Precision) -> None:
    data = inputs(numbers)
    for mapping in MAPPINGS:
        stride = lanes_of(numbers) if mapping == "walker" else 1
        left = 0
        for lane in range(stride):
            mine = data.weight[lane::stride] > -0.5
            left += len(mine) - (len(mine) if mine.all() else int(np.argmin(mine)))
        assert (results(numbers, mapping).sums[:, 6] == left).all()


@pytest.mark.parametrize(("numbers", "mapping"), BOTH)
def test_what_is_not_a_number_stays_in_its_simulation(numbers: Precision, mapping: Mapping) -> None:
    x = inputs(numbers).x.copy()
    x[::3] = np.nan, np.inf, -np.inf, np.nan, np.nan
    got = lane_launch(walk_kernel(numbers), numbers, replace(inputs(numbers), x=x), mapping)
    whole, other = results(numbers, mapping), np.arange(N) % 3 != 0
    np.testing.assert_array_equal(got.sums[other], whole.sums[other])
    np.testing.assert_array_equal(got.u[other], whole.u[other])
    assert not np.isfinite(got.u[~other]).all(axis=1).any()
