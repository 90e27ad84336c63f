"""The functions of Warp over lanes: against NumPy's, in every mapping, where numbers end too."""

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


@pytest.mark.parametrize(("numbers", "mapping"), BOTH)
def test_every_function_is_that_of_numpy(numbers: Precision, mapping: Mapping) -> None:
    rng = np.random.default_rng(7)
    limits = np.finfo(numbers.dtype)
    odd = [0.0, -0.0, 1.0, -1.0, 0.5, -0.5, 1.5, -2.5, 2.0, -3.0, np.pi, 100.0, -100.0]
    far = [
        float(limits.tiny),
        -float(limits.tiny),
        float(limits.smallest_subnormal),
        1e15,
        -1e30,
        1e30,
        float(limits.max),
    ]
    x = np.concatenate([odd, far, rng.uniform(-1.0, 1.0, 3 * N), rng.normal(0.0, 20.0, 3 * N), odd, odd])
    y = np.concatenate([rng.uniform(-3.0, 3.0, len(x) - 2 * N), odd[::-1], rng.integers(-4, 5, N)])
    x, y = x.astype(numbers.dtype), y.astype(numbers.dtype)
    found = []
    for k in range(0, len(x) - N + 1, N):
        given = replace(inputs(numbers), x=x[k : k + N], y=y[k : k + N])
        found.append(lane_launch(every_function(numbers), numbers, given, mapping).values[:, :31])
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
    (numbers,) = (p for p in PRECISION if p.name == "fp64")
    given = replace(inputs(numbers), x=np.linspace(0.2, 5.0, N), y=np.linspace(-3.0, 3.0, N))
    a, b = (
        lane_launch(every_function(numbers), numbers, given, mapping).values[:, :31] for mapping in MAPPINGS
    )
    np.testing.assert_array_equal(a, b)
