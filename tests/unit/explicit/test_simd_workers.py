"""Sweeps over the elements of a simulation: by one lane, by all lanes together, and by Warp."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
import warp as wp
from lane_kernels import ELEMENTS, MAPPINGS, PRECISION, N, Results, inputs, lanes_of, launched, small_structs

from explicit.layout.lanes import lane_functions
from explicit.layout.state import state_layout
from explicit.precision import Precision
from explicit.simd import Mapping

BOTH = [pytest.param(p, m, id=f"{p.name}-{m}") for p in PRECISION for m in MAPPINGS]


@cache
def walk_kernel(numbers: Precision) -> Any:
    structs = small_structs(numbers)
    Body, Batch, State, Output = structs.Body, structs.Batch, structs.State, structs.Output
    real = numbers.real
    lanes = lane_functions()
    sync, control_sync, empty_sum, add_to = lanes.sync, lanes.control_sync, lanes.empty_sum, lanes.add_to
    is_worker, n_workers, is_control, is_writer = (
        lanes.is_worker,
        lanes.n_workers,
        lanes.is_control,
        lanes.is_writer,
    )
    put_total, get_total = lanes.put_total, lanes.get_total
    put_largest, get_largest = lanes.put_largest, lanes.get_largest
    boundary_totals, boundary_first = lanes.boundary_totals, lanes.boundary_first
    control_first, control_stride = lanes.control_first, lanes.control_stride
    layout = state_layout(numbers, small_structs(numbers), False)
    field, sums = layout.field, layout.sums
    zero, half = real(0.0), real(0.5)
    HALF = wp.float64(0.5)

    @wp.func
    def sweep(body: Body, state: State, sample: int, lane: int, x: real):
        """Write the state and add up, in branches too."""
        u = field(state.u, sample, 0)
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
            e += n_workers()
        return positive, wp.float64(most)

    @wp.kernel(module="unique", enable_backward=False)
    def kernel(body: Body, batch: Batch, state: State, output: Output, first: int):
        index, lane = wp.tid()
        sample = first + index
        x = batch.x[sample]
        u = state.u[sample]
        parts = sums(state.parts, sample, 0)
        ours, others = sums(state.ours, sample, 0), sums(state.others, sample, 0)
        positive, most = empty_sum(), wp.float64(0.0)
        if is_worker(lane) == 1:
            positive, most = sweep(body, state, sample, lane, x)
        sync()
        everything, gathered, twice = empty_sum(), empty_sum(), empty_sum()
        n = boundary_first(lane)
        while n < body.n:
            everything = add_to(everything, wp.float64(u[n]), n)
            if state.marks[sample, body.place[n]] == 1:
                gathered = add_to(gathered, wp.float64(u[body.place[n]] * x), n)
            ours[n] = wp.float64(u[n])
            others[n] = wp.float64(-body.weight[n])
            n += n_workers()
        twice += everything
        twice += HALF * positive
        # a walk whose lanes leave where they like, and what they bring back
        behind = empty_sum()
        k = lane  # alone: in a tuple it would be another name of `lane` to Warp
        while k < body.n and body.weight[k] > -half:
            k += wp.block_dim()
        while k < body.n:
            behind = add_to(behind, wp.float64(1.0), k)
            k += wp.block_dim()
        put_total(parts, 0, positive)
        put_total(parts, 1, everything)
        put_total(parts, 2, gathered)
        put_total(parts, 3, twice)
        put_largest(parts, 4, most)
        put_total(parts, 6, behind)
        # handed over again, to a place that is made out, and where some simulations do
        put_largest(parts, 8 + body.two, most - HALF)
        if x > zero:
            put_largest(parts, 8 + body.two, wp.float64(x))
        sync()
        if is_control(lane) == 1:
            shares = boundary_totals(ours, others, body.n)
            some = boundary_totals(ours, ours, body.n - body.two)
            if is_writer(lane) == 1:
                for total in range(4):
                    output.sums[sample, total] = get_total(parts, total)
                output.sums[sample, 4] = get_largest(parts, 4)
                output.sums[sample, 5] = shares[0]
                output.sums[sample, 6] = get_total(parts, 6)
                output.sums[sample, 7] = shares[1]
                output.sums[sample, 8] = some[0] - some[1]
                output.sums[sample, 9] = some[1]
                output.sums[sample, 10] = get_largest(parts, 8 + body.two)
            control_sync()
            # written side by side
            k = control_first(lane)
            while k < body.n:
                output.values[sample, k] = u[k]
                k += control_stride()

    return kernel


@cache
def results(numbers: Precision, mapping: Mapping | None) -> Results:
    return launched(walk_kernel(numbers), numbers, mapping)


@pytest.mark.parametrize("numbers", PRECISION, ids=lambda p: p.name)
def test_walked_sums_agree_bit_for_bit(numbers: Precision) -> None:
    one, all_lanes = (results(numbers, mapping) for mapping in MAPPINGS)
    told = [0, 1, 2, 3, 4, 5, 7, 8, 9, 10]  # all but what depends on where a lane leaves its walk
    np.testing.assert_array_equal(one.sums[:, told], all_lanes.sums[:, told])
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


@pytest.mark.parametrize("mapping", [*MAPPINGS, None])
@pytest.mark.parametrize("numbers", PRECISION, ids=lambda p: p.name)
def test_seats_are_added_one_after_the_other(numbers: Precision, mapping: Mapping | None) -> None:
    got, weight = results(numbers, mapping), inputs(numbers).weight.astype(np.float64)
    u = got.u.astype(np.float64)
    # `cumsum` adds in order; `sum` would not
    np.testing.assert_array_equal(got.sums[:, 5], np.cumsum(u, axis=1)[:, -1])
    np.testing.assert_array_equal(got.sums[:, 7], np.cumsum(-weight)[-1])
    np.testing.assert_array_equal(got.sums[:, 9], np.cumsum(u, axis=1)[:, -3])
    assert (got.sums[:, 8] == 0.0).all()
    backward = np.cumsum(u[:, ::-1], axis=1)[:, -1]
    assert (np.cumsum(u, axis=1)[:, -1] != backward).any() or numbers.name == "fp32"


@pytest.mark.parametrize(("numbers", "mapping"), BOTH)
def test_what_is_handed_over_again_replaces_what_was(numbers: Precision, mapping: Mapping) -> None:
    got, data = results(numbers, mapping), inputs(numbers)
    most = np.abs(data.weight * data.x[:, None]).max(axis=1).astype(np.float64)
    np.testing.assert_array_equal(got.sums[:, 4], most)
    np.testing.assert_array_equal(got.sums[:, 10], np.where(data.x > 0.0, data.x, most - 0.5))
    assert 0 < (data.x > 0.0).sum() < N


@pytest.mark.parametrize(("numbers", "mapping"), BOTH)
def test_warp_itself_agrees(numbers: Precision, mapping: Mapping) -> None:
    got, warp = results(numbers, mapping), results(numbers, None)
    np.testing.assert_array_equal(got.values, warp.values)
    np.testing.assert_array_equal(got.u, warp.u)
    told = [4, 5, 7, 8, 9, 10]  # largest values; sums in order
    np.testing.assert_array_equal(got.sums[:, told], warp.sums[:, told])
    # 37 numbers of size 4 added in another order
    np.testing.assert_allclose(got.sums[:, :4], warp.sums[:, :4], atol=37 * 37 * 4 * 2.2e-16)


@pytest.mark.parametrize("numbers", PRECISION, ids=lambda p: p.name)
def test_lanes_that_stopped_a_walk_go_on_from_there(numbers: Precision) -> None:
    data = inputs(numbers)
    for mapping in MAPPINGS:
        stride = lanes_of(numbers) if mapping == "worker" else 1
        left = 0
        for lane in range(stride):
            mine = data.weight[lane::stride] > -0.5
            left += len(mine) - (len(mine) if mine.all() else int(np.argmin(mine)))
        assert (results(numbers, mapping).sums[:, 6] == left).all()


@pytest.mark.parametrize(("numbers", "mapping"), BOTH)
def test_what_is_not_a_number_stays_in_its_simulation(numbers: Precision, mapping: Mapping) -> None:
    x = inputs(numbers).x.copy()
    x[::3] = np.nan, np.inf, -np.inf, np.nan, np.nan
    got = launched(walk_kernel(numbers), numbers, mapping, replace(inputs(numbers), x=x))
    whole, other = results(numbers, mapping), np.arange(N) % 3 != 0
    np.testing.assert_array_equal(got.sums[other], whole.sums[other])
    np.testing.assert_array_equal(got.u[other], whole.u[other])
    assert not np.isfinite(got.u[~other]).all(axis=1).any()
