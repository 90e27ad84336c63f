"""Branches, loops, gathers and scatters on which the lanes disagree, compared with Warp."""

# ruff: noqa: RUF046, UP018 -- in a Warp kernel `int(0)` declares a variable that a loop may change

from functools import cache
from typing import Any

import lane_kernels
import numpy as np
import pytest
import warp as wp

from explicit.precision import Precision
from explicit.simd import Mapping

BOTH = [pytest.param(p, m, id=f"{p.name}-{m}") for p in lane_kernels.PRECISION for m in lane_kernels.MAPPINGS]


@cache
def control_kernel(numbers: Precision) -> Any:
    """A case a slot. Products are never added here, so every mapping rounds as Warp does."""
    structs = lane_kernels.small_structs(numbers)
    Body, Batch, State, Output = structs.Body, structs.Batch, structs.State, structs.Output
    real = numbers.real
    zero, half, one, two = real(0.0), real(0.5), real(1.0), real(2.0)

    @wp.func
    def three_ways(x: real, y: real):
        """Results of several kinds from branches in branches."""
        value, which = real(0.0), int(0)
        if x < zero:
            which = 1
            if y < zero:
                which = 2
                value = x - y
            value += one
        elif x < one:
            which = 3
        else:
            value = y
        return value, which

    @wp.func
    def halvings(x: real):
        """A loop that lanes leave at different times."""
        n = int(0)
        while wp.abs(x) > real(0.01):
            x *= half
            n += 1
        return x, n

    @wp.func
    def entry(row: wp.array(dtype=real), k: int):
        """Known places of a table's row, and one that the lanes disagree on."""
        return row[0] - row[6] + row[k + 1]

    @wp.kernel(module="unique", enable_backward=False)
    def kernel(body: Body, batch: Batch, state: State, output: Output, first: int):
        index, lane = wp.tid()
        sample = first + index
        x, y, k = batch.x[sample], batch.y[sample], batch.k[sample]
        out, whole = output.values[sample], output.whole[sample]
        if lane == 0:
            value, which = three_ways(x, y)
            out[0] = value
            whole[0] = which
            value, count = halvings(x)
            out[1] = value
            whole[1] = count
            # loops over known, uniform and varying bounds, one in the other
            total, steps = real(0.0), int(0)
            for a in range(3):
                for b in range(a, body.two + 1):
                    for c in range(k - b, k + 2):
                        total = total + real(c) * half
                        steps += a + 1
            out[2] = total
            whole[2] = steps
            bound = int(k)
            for _a in range(bound):
                bound = bound - 1  # a range is made once
            whole[3] = bound
            # the second operand is looked at where the first leaves it open
            near = k < 4 and body.place[1000000 * (k / 4)] > 10
            whole[4] = int(near)
            far = k >= 4 or body.weight[1000000 * (k / 4)] > zero
            whole[5] = int(far)
            if k != 0 and 12 / k > 3:
                whole[6] = 12 % k
            else:
                whole[6] = -1
            # a body that changes its own condition
            greater = x > y
            if greater:
                greater = x > two
                out[3] = x
            else:
                out[3] = y
            whole[7] = int(greater)
            # gathers, rows of a table, a struct of the lane's own
            out[4] = body.weight[body.place[7 * k + 2]]
            row = batch.rows[k]
            out[5] = entry(row, k)
            if k > 2:
                out[6] = entry(batch.rows[k - 1], k - 1)
            pair = batch.pairs[4 - k]
            out[7] = pair.factor - pair.arm[1]
            # a variable that is the same in all lanes until late
            late, other = real(1.0), int(5)
            for a in range(4):
                out[8 + a] = late
                if a == 2:
                    late = late + x
                    if y > zero:
                        other = a
            whole[8] = other
            # written in some lanes, to places of their own
            if x > y:
                whole[10 + k] = k
            n = int(0)
            while n < k:
                last = real(n) - y  # outlives the loop
                out[20 + n] = last
                n += 1
            if k > 0:
                out[12] = last
            # read again after it was written
            held = output.values[sample]
            held[13] = x
            held[13] = held[13] + one
            out[14] = held[13]

    return kernel


@cache
def results(numbers: Precision, mapping: Mapping | None) -> lane_kernels.Results:
    return lane_kernels.launched(control_kernel(numbers), numbers, mapping)


@pytest.mark.parametrize(("numbers", "mapping"), BOTH)
def test_every_lane_does_what_warp_does(numbers: Precision, mapping: Mapping) -> None:
    got, warp = results(numbers, mapping), results(numbers, None)
    np.testing.assert_array_equal(got.whole, warp.whole)
    np.testing.assert_array_equal(got.values, warp.values)


@pytest.mark.parametrize("numbers", lane_kernels.PRECISION, ids=lambda p: p.name)
def test_warp_does_what_python_does(numbers: Precision) -> None:
    """A guard of the reference: some of the cases in plain Python."""
    got, d = results(numbers, None), lane_kernels.inputs(numbers)
    for i in range(lane_kernels.N):
        x, y, k = d.x[i], d.y[i], int(d.k[i])
        which = 2 if x < 0 and y < 0 else 1 if x < 0 else 3 if x < 1 else 0
        assert got.whole[i, 0] == which
        assert got.whole[i, 3] == 0
        assert got.whole[i, 4] == (k < 4 and d.place[0] > 10)
        assert got.whole[i, 5] == (k >= 4 or d.weight[0] > 0)
        assert got.whole[i, 6] == (12 % k if k != 0 and 12 // k > 3 else -1)
        assert got.values[i, 3] == max(x, y)
        assert got.values[i, 5] == d.rows[k, 0] - d.rows[k, 6] + d.rows[k, k + 1]
        assert got.values[i, 12] == (numbers.dtype(k - 1) - y if k else lane_kernels.UNTOUCHED)
        assert got.values[i, 14] == x + 1
        places = np.flatnonzero(got.whole[i, 10:20] != lane_kernels.UNTOUCHED)
        assert places.tolist() == ([k] if x > y else [])
    # every branch has its lanes
    assert set(got.whole[:, 0]) == {0, 1, 2, 3}
    assert set(d.k) == {0, 1, 2, 3, 4}


@pytest.mark.parametrize("numbers", lane_kernels.PRECISION, ids=lambda p: p.name)
def test_an_incomplete_pack_writes_its_own_simulations_alone(numbers: Precision) -> None:
    lanes = lane_kernels.lanes_of(numbers)
    ends = lane_kernels.N // lanes * lanes  # where the incomplete pack begins
    got = lane_kernels.launched(control_kernel(numbers), numbers, "simulation", skip=(ends,))
    whole = results(numbers, "simulation")
    np.testing.assert_array_equal(got.values[:ends], whole.values[:ends])
    assert (got.values[ends:] == lane_kernels.UNTOUCHED).all()
    assert (got.whole[ends:] == lane_kernels.UNTOUCHED).all()
    if ends:
        got = lane_kernels.launched(control_kernel(numbers), numbers, "simulation", skip=(0,))
        np.testing.assert_array_equal(got.values[ends:], whole.values[ends:])
        assert (got.values[:ends] == lane_kernels.UNTOUCHED).all()


@pytest.mark.parametrize("numbers", lane_kernels.PRECISION, ids=lambda p: p.name)
def test_what_a_lane_computes_does_not_depend_on_its_neighbours(numbers: Precision) -> None:
    data = lane_kernels.inputs(numbers)
    alone = results(numbers, "simulation")
    poisoned = lane_kernels.inputs(numbers)
    poisoned.x[::2], poisoned.y[::2] = np.nan, np.inf
    got = lane_kernels.launched(control_kernel(numbers), numbers, "simulation", poisoned)
    assert np.isfinite(data.x).all()
    np.testing.assert_array_equal(got.values[1::2], alone.values[1::2])
    np.testing.assert_array_equal(got.whole[1::2], alone.whole[1::2])
    assert lane_kernels.ELEMENTS > 7 * 4 + 2  # the gathers stay inside
