"""The tables of Marlow's law in the time loop, at any strain that a simulation can reach."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
import warp as wp
from lane_kernels import EACH, MAPPINGS, N, inputs, lane_launch, scalar_launch, small_structs
from scipy.interpolate import CubicHermiteSpline

from explicit.materials import MarlowLaw
from explicit.precision import PRECISIONS, Precision
from explicit.simd import Mapping


def law(n_knots: int = 6, seed: int = 1) -> MarlowLaw:
    rng = np.random.default_rng(seed)
    quotient, slope = rng.uniform(1e4, 3e4, n_knots), rng.uniform(-2e4, 4e4, n_knots)
    slope[-1] = 1.7e4
    return MarlowLaw(last=1.5, quotient=quotient, slope=slope)


@pytest.mark.parametrize("n_knots", [2, 3, 6, 129])
def test_its_cubics_are_those_of_hermite_and_a_straight_line_follows(n_knots: int) -> None:
    item = law(n_knots)
    knots, cubics = np.linspace(0.0, item.last, n_knots), item.cubics
    assert cubics.shape == (n_knots, 4)
    # SciPy has the highest power first, in s from the knot
    powers = CubicHermiteSpline(knots, item.quotient, item.slope).c[::-1].T
    expected = powers * item.step ** np.arange(4)
    np.testing.assert_allclose(cubics[:-1], expected, rtol=0, atol=1e-14 * 20 * 4e4)  # twenty roundings
    straight = [item.quotient[-1], item.slope[-1] * item.step, 0.0, 0.0]
    np.testing.assert_allclose(cubics[-1], straight, rtol=0, atol=1e-14 * 4e4)
    # value and slope at either end of an interval
    ends, rise = cubics.sum(axis=1), cubics @ [0.0, 1.0, 2.0, 3.0]
    np.testing.assert_allclose(ends[:-1], item.quotient[1:], rtol=1e-13)
    np.testing.assert_allclose(rise[:-1], item.slope[1:] * item.step, atol=1e-13 * 4e4)


def test_a_row_holds_header_cubics_and_energies() -> None:
    item = law()
    row = item.parameters()
    assert row[:4] == pytest.approx([1.5, 5.0, 0.3, 1 / 0.3], rel=1e-15)
    np.testing.assert_array_equal(row[4:28].reshape(6, 4), item.cubics)
    np.testing.assert_array_equal(row[28:], item.knot_energy)


@cache
def law_kernel(numbers: Precision) -> Any:
    structs = small_structs(numbers)
    Body, Batch, State, Output = structs.Body, structs.Batch, structs.State, structs.Output
    stress, tangent, energy = MarlowLaw.kernel_functions(numbers)
    zero, one = numbers.real(0.0), numbers.real(1.0)

    @wp.kernel(module="unique", enable_backward=False)
    def kernel(body: Body, batch: Batch, state: State, output: Output, first: int):
        index, lane = wp.tid()
        sample = first + index
        row, rr = batch.rows[batch.k[sample]], batch.x[sample]
        if lane == 0:
            tau = stress(rr, one, zero, one, row)
            output.values[sample, 0] = tau[0]
            output.values[sample, 1] = tangent(rr, one, zero, one, row)
            output.values[sample, 2] = energy(rr, one, zero, one, row)

    return kernel


def evaluated(numbers: Precision, mapping: Mapping | None, s: np.ndarray) -> np.ndarray:
    """Stress, bound of the tangent and energy where b_bar = (1 + s^2, 1, 0, 1)."""
    rows = np.stack([law(seed=seed).parameters() for seed in range(5)]).astype(numbers.dtype)
    given = replace(inputs(numbers), rows=rows, x=(1.0 + s**2).astype(numbers.dtype))
    if mapping is None:
        return scalar_launch(law_kernel(numbers), numbers, given).values
    return lane_launch(law_kernel(numbers), numbers, given, mapping).values


def strains(numbers: Precision) -> np.ndarray:
    """At rest, between the knots, on the last one, past it, and as a simulation that diverges has them: up to
    where s^4 is still a number. From 6e8 on no integer counts the steps of s."""
    last = 2e9 if numbers.name == "fp32" else 1e70
    return np.array([0.0, 0.01, 0.3, 0.5, 1.2, 1.4999, 1.5, 1.6, 40.0, 1e6, 7e8, 1e9, last])


@EACH
def test_the_law_holds_at_any_strain(numbers: Precision, mapping: Mapping | None) -> None:
    s, k = strains(numbers), inputs(numbers).k
    got = evaluated(numbers, mapping, s).astype(float)
    b_bar = np.column_stack([1.0 + s**2, np.ones(N), np.zeros(N), np.ones(N)])
    b_bar = b_bar.astype(numbers.dtype).astype(float)
    # the strain is a difference of numbers of size 1, which fp32 knows to 1e-7: at s = 0.01 to 1e-3 of s^2
    rtol = 1e-11 if numbers.name == "fp64" else 2e-3
    for i in range(N):
        item = law(seed=k[i])
        assert got[i, 0] == pytest.approx(item.stress(b_bar[i])[0], rel=rtol, abs=1e-6)
        assert got[i, 2] == pytest.approx(item.energy(b_bar[i]), rel=rtol, abs=1e-6)
    assert np.isfinite(got[:, :3]).all()
    # past the data 2 U' is a straight line, and its slope is the last one
    past = s > 1.5
    trace = b_bar[past].sum(axis=1)
    value = np.array([law(seed=j).two_u_prime(x) for j, x in zip(k[past], s[past], strict=True)])
    slope = np.array([law(seed=j).slope[-1] for j in k[past]])
    squared = ((b_bar[past][:, [0, 1, 3]] - trace[:, None] / 3) ** 2).sum(axis=1)
    bound = value * b_bar[past, 0] + slope / s[past] * squared
    np.testing.assert_allclose(got[past, 1], bound, rtol=rtol)


def test_both_mappings_give_the_same_bits() -> None:
    numbers = PRECISIONS["fp64"]
    one, other = (evaluated(numbers, mapping, strains(numbers)) for mapping in MAPPINGS)
    np.testing.assert_array_equal(one, other)


@EACH
def test_what_is_no_strain_at_all_disturbs_nobody(numbers: Precision, mapping: Mapping | None) -> None:
    s = np.full(N, 0.7)
    whole = evaluated(numbers, mapping, s)
    s[[1, 4, 7]] = np.inf, np.nan, 1e150 if numbers.name == "fp64" else 1e18
    got, others = evaluated(numbers, mapping, s), np.delete(np.arange(N), [1, 4, 7])
    np.testing.assert_array_equal(got[others], whole[others])
    assert not np.isfinite(got[[1, 4], 0]).any()
