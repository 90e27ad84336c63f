"""Exponentials and logarithms over lanes: against NumPy's, in every mapping, where numbers end too."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
import warp as wp
from lane_kernels import MAPPINGS, PRECISION, N, inputs, lane_launch, small_structs

from explicit.precision import Precision
from explicit.simd import Mapping

BOTH = [pytest.param(p, m, id=f"{p.name}-{m}") for p in PRECISION for m in MAPPINGS]


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
        found.append(lane_launch(kernel_of(numbers), numbers, given, mapping).values[:, :2])
    return np.concatenate(found)


@pytest.mark.parametrize(("numbers", "mapping"), BOTH)
def test_they_are_those_of_numpy(numbers: Precision, mapping: Mapping) -> None:
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


@pytest.mark.parametrize(("numbers", "mapping"), BOTH)
def test_where_numbers_end(numbers: Precision, mapping: Mapping) -> None:
    infinity, tiny = np.inf, float(np.finfo(numbers.dtype).smallest_subnormal)
    x = np.array([0.0, -0.0, infinity, -infinity, np.nan, 800.0, -800.0, 1e30, -1e30, 1.0, 0.0, 0.0, 0.0])
    y = np.array([0.0, -0.0, infinity, -infinity, np.nan, -1.0, 1.0, tiny, 3.0 * tiny, 2.0, 1.0, 1.0, 1.0])
    x, y = x.astype(numbers.dtype), y.astype(numbers.dtype)
    got = evaluated(numbers, mapping, x, y)
    with np.errstate(all="ignore"):
        np.testing.assert_allclose(got[:, 0], np.exp(x), rtol=3e-7 if numbers.name == "fp32" else 1e-15)
        np.testing.assert_allclose(got[:, 1], np.log(y), rtol=3e-7 if numbers.name == "fp32" else 1e-15)


def test_one_number_of_all_lanes_has_the_bits_of_a_pack() -> None:
    (numbers,) = (p for p in PRECISION if p.name == "fp64")
    x, y = np.linspace(-3.0, 3.0, N), np.linspace(0.2, 5.0, N)
    by_lane, by_worker = (evaluated(numbers, mapping, x, y) for mapping in MAPPINGS)
    np.testing.assert_array_equal(by_lane, by_worker)
