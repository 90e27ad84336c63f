"""Small kernels for the translator, with structs of a few arrays, launched over lanes and by Warp."""

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import pytest
import warp as wp

from explicit.arguments import SPARE
from explicit.device import select_device
from explicit.layout.structs import Structs, grouped
from explicit.precision import PRECISIONS, Precision
from explicit.simd import PACK_BYTES, Mapping, lane_kernel
from explicit.simd.team import single_thread_team

N = 13  # simulations of a batch: one full pack and an incomplete one in fp64, an incomplete one in fp32
ELEMENTS = 37  # number of elements of the body: not a multiple of any number of lanes, and more than a group
CONSTANTS = 5  # constants of an element in the grouped tables
SLOTS = 128  # numbers that a kernel writes for each simulation
UNTOUCHED = -77  # content of the output before a launch


def lanes_of(numbers: Precision) -> int:
    return PACK_BYTES // numbers.dtype().itemsize


@cache
def small_structs(numbers: Precision) -> Structs:
    real = numbers.real

    @wp.struct
    class Pair:
        factor: real
        arm: numbers.vec2

    @wp.struct
    class Body:
        n: int
        two: int
        weight: wp.array(dtype=real)
        place: wp.array(dtype=int)
        table: wp.array2d(dtype=real)
        numbers: wp.array2d(dtype=int)

    @wp.struct
    class Batch:
        x: wp.array(dtype=real)
        y: wp.array(dtype=real)
        z: wp.array(dtype=real)
        k: wp.array(dtype=int)
        v: wp.array(dtype=numbers.vec2)
        pairs: wp.array(dtype=Pair)
        rows: wp.array2d(dtype=real)
        flag: wp.array(dtype=wp.bool)

    @wp.struct
    class State:
        u: wp.array2d(dtype=real)
        marks: wp.array2d(dtype=int)
        parts: wp.array2d(dtype=wp.float64)
        ours: wp.array2d(dtype=wp.float64)
        others: wp.array2d(dtype=wp.float64)

    @wp.struct
    class Output:
        values: wp.array2d(dtype=real)
        whole: wp.array2d(dtype=int)
        sums: wp.array2d(dtype=wp.float64)

    Body.pair = Pair
    return Structs(Body, Batch, State, Output)


@dataclass(frozen=True)
class Inputs:
    """Inputs of a launch, shape [N] unless stated otherwise."""

    x: np.ndarray
    y: np.ndarray
    z: np.ndarray
    k: np.ndarray
    v: np.ndarray  # shape [N, 2]
    factor: np.ndarray
    arm: np.ndarray  # shape [N, 2]
    rows: np.ndarray  # shape [5, 7]
    weight: np.ndarray  # shape [ELEMENTS]
    place: np.ndarray  # shape [ELEMENTS], a permutation
    table: np.ndarray  # shape [CONSTANTS, ELEMENTS]
    numbers: np.ndarray  # shape [CONSTANTS, ELEMENTS]


@dataclass(frozen=True)
class Results:
    """Output of a launch, shape [N, SLOTS], and the state."""

    values: np.ndarray
    whole: np.ndarray
    sums: np.ndarray
    u: np.ndarray  # shape [N, ELEMENTS]


def inputs(numbers: Precision, seed: int = 3) -> Inputs:
    rng = np.random.default_rng(seed)

    def real(*shape: int) -> np.ndarray:
        return rng.uniform(-2.0, 2.0, shape).astype(numbers.dtype)

    return Inputs(
        x=real(N), y=real(N), z=real(N), k=rng.integers(0, 5, N).astype(np.int32), v=real(N, 2),
        factor=real(N), arm=real(N, 2), rows=real(5, 7), weight=real(ELEMENTS),
        place=rng.permutation(ELEMENTS).astype(np.int32), table=real(CONSTANTS, ELEMENTS),
        numbers=rng.integers(-99, 99, (CONSTANTS, ELEMENTS)).astype(np.int32),
    )  # fmt: skip


def _arguments(numbers: Precision, given: Inputs, rows: int, lanes: int) -> list[Any]:
    structs = small_structs(numbers)
    body, batch = structs.Body(), structs.Batch()
    body.n, body.two = ELEMENTS, 2
    body.weight = wp.array(np.pad(given.weight, (0, SPARE)), dtype=numbers.real, device="cpu")
    body.place = wp.array(np.pad(given.place, (0, SPARE)), dtype=int, device="cpu")
    body.table = wp.array(grouped(given.table), dtype=numbers.real, device="cpu")
    body.numbers = wp.array(grouped(given.numbers), dtype=int, device="cpu")
    for name in ("x", "y", "z"):
        setattr(batch, name, wp.array(getattr(given, name), dtype=numbers.real, device="cpu"))
    batch.k = wp.array(given.k, dtype=int, device="cpu")
    batch.v = wp.array(given.v, dtype=numbers.vec2, device="cpu")
    pairs = np.zeros(N, dtype=structs.Body.pair.numpy_dtype())
    pairs["factor"], pairs["arm"] = given.factor, given.arm
    batch.pairs = wp.array(pairs, dtype=structs.Body.pair, device="cpu")
    batch.rows = wp.array(given.rows, dtype=numbers.real, device="cpu")
    batch.flag = wp.zeros(N, dtype=wp.bool, device="cpu")
    state, output = structs.State(), structs.Output()
    shape = (ELEMENTS, lanes) if lanes > 1 else (rows, ELEMENTS + SPARE)
    state.u = wp.zeros(shape, dtype=numbers.real, device="cpu")
    state.marks = wp.zeros(shape, dtype=int, device="cpu")
    for name in ("parts", "ours", "others"):
        setattr(state, name, wp.zeros(shape, dtype=wp.float64, device="cpu"))
    output.values = wp.full((N, SLOTS), UNTOUCHED, dtype=numbers.real, device="cpu")
    output.whole = wp.full((N, SLOTS), UNTOUCHED, dtype=int, device="cpu")
    output.sums = wp.full((N, SLOTS), UNTOUCHED, dtype=wp.float64, device="cpu")
    return [body, batch, state, output]


def launched(
    kernel: Any,
    numbers: Precision,
    mapping: Mapping | None,
    given: Inputs | None = None,
    *,
    skip: tuple[int, ...] = (),
) -> Results:
    """The kernel over lanes, in packs as in `explicit.drivers`; without a mapping run by Warp, one simulation
    after the other. `skip` leaves simulations out."""
    select_device("cpu")
    given, lanes = given or inputs(numbers), lanes_of(numbers)
    if mapping is None:
        arguments = _arguments(numbers, given, N, 1)
        wp.launch(kernel, dim=(N, 1), inputs=[*arguments, 0], device="cpu", block_dim=1)
        return _results(arguments[3], arguments[2].u.numpy()[:, :ELEMENTS])
    made = lane_kernel(kernel, small_structs(numbers), numbers, mapping, lanes).kernel
    width = lanes if mapping == "simulation" else 1
    arguments = _arguments(numbers, given, 1, width)
    u = np.zeros((N, ELEMENTS))
    for first in range(0, N, width):
        if first in skip:
            continue
        count = min(width, N - first)
        arguments[2] = _arguments(numbers, given, 1, width)[2]
        wp.launch(
            made, dim=1, inputs=[*arguments, first, count, single_thread_team()], device="cpu", block_dim=1
        )
        state = arguments[2].u.numpy()
        u[first : first + count] = state[:, :count].T if width > 1 else state[:, :ELEMENTS]
    return _results(arguments[3], u)


def _results(output: Any, u: np.ndarray) -> Results:
    return Results(output.values.numpy(), output.whole.numpy(), output.sums.numpy(), u)


PRECISION = list(PRECISIONS.values())
MAPPINGS: tuple[Mapping, ...] = ("simulation", "worker")
_PAIRS = [*((PRECISIONS["fp64"], mapping) for mapping in MAPPINGS), (PRECISIONS["fp32"], "simulation")]
LANES = pytest.mark.parametrize(
    ("numbers", "mapping"), [pytest.param(p, m, id=f"{p.name}-{m}") for p, m in _PAIRS]
)
"""Each precision and each mapping, not every pair: each is compiled."""
EACH = pytest.mark.parametrize(
    ("numbers", "mapping"),
    [pytest.param(p, m, id=f"{p.name}-{m or 'warp'}") for p, m in [*_PAIRS, (PRECISIONS["fp64"], None)]],
)
"""The same, and by Warp."""
