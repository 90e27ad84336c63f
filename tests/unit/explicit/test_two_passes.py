"""Loops with a table lookup in two passes: equal numbers, and one pass if iterations depend on each other."""

# ruff: noqa: RUF046, UP018 -- in a Warp kernel `int(0)` declares a variable that a loop may change

from functools import cache
from typing import Any

import numpy as np
import pytest
import warp as wp
from lane_kernels import ELEMENTS, LANES, N, inputs, launched, small_structs

from explicit import Model, PlatenMotion, Samples, Sampling, Stepping, cylinder, run
from explicit.layout.lanes import lane_functions
from explicit.layout.structs import four_function
from explicit.materials import neo_hookean
from explicit.precision import PRECISIONS, Precision
from explicit.simd import Mapping, kernel, lane_kernel, statements
from explicit.simd.memory import BLOCK, Loop, divided


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch) -> list[bool]:
    """Whether each loop that looks up a table was divided."""
    found: list[bool] = []

    def watched(loop: Loop) -> Any:
        lines = divided(loop)
        found.append(lines is not None)
        return lines

    monkeypatch.setattr(statements, "divided", watched)
    monkeypatch.setattr(kernel, "cached_translation", lambda time_loop, choice, translate: translate())
    lane_kernel.cache_clear()
    return found


@cache
def lookup_kernel(numbers: Precision) -> Any:
    """A turn has a branch before it looks up, and needs what it had read and made after it."""
    structs = small_structs(numbers)
    Body, Batch, State, Output = structs.Body, structs.Batch, structs.State, structs.Output
    four, n_workers, zero = four_function(numbers), lane_functions().n_workers, numbers.real(0.0)

    @wp.kernel(module="unique", enable_backward=False)
    def kernel(body: Body, batch: Batch, state: State, output: Output, first: int):
        index, lane = wp.tid()
        sample = first + index
        x = batch.x[sample]
        e = lane
        while e < body.n:
            weight = body.weight[e]
            share = x * weight
            row = int(0)
            if share < zero:
                share = -share
                row = 1
            c = four(batch.rows[row], int(share))
            output.values[sample, e] = c[0] - share
            output.whole[sample, e] = row
            output.sums[sample, e] = wp.float64(c[3] * weight)
            e += n_workers()

    return kernel


@LANES
def test_two_passes_give_the_numbers_of_one(numbers: Precision, mapping: Mapping, made: list[bool]) -> None:
    given = inputs(numbers)
    got = launched(lookup_kernel(numbers), numbers, mapping, given)
    assert made
    assert all(made)
    share = np.abs(given.x[:, None] * given.weight)
    row = (given.x[:, None] * given.weight < 0.0).astype(int)
    place = share.astype(int)
    assert set(np.unique(place)) == {0, 1, 2, 3}  # lanes look at different places
    assert ELEMENTS % BLOCK  # the last turns are fewer
    np.testing.assert_array_equal(got.values[:, :ELEMENTS], given.rows[row, place] - share)
    np.testing.assert_array_equal(got.whole[:, :ELEMENTS], row)
    np.testing.assert_array_equal(got.sums[:, :ELEMENTS], given.rows[row, place + 3] * given.weight)


@cache
def chained_kernel(numbers: Precision, variable: bool) -> Any:
    """The place of a turn depends on the turn before, by an array or by a variable."""
    structs = small_structs(numbers)
    Body, Batch, State, Output = structs.Body, structs.Batch, structs.State, structs.Output
    four, real = four_function(numbers), numbers.real

    @wp.kernel(module="unique", enable_backward=False)
    def by_array(body: Body, batch: Batch, state: State, output: Output, first: int):
        index, _lane = wp.tid()
        sample = first + index
        state.u[sample, 0] = batch.x[sample]
        e = int(1)
        while e < body.n:
            before = wp.abs(state.u[sample, e - 1])
            c = four(batch.rows[0], int(before))
            state.u[sample, e] = c[2]
            output.values[sample, e] = c[2]
            e += 1

    @wp.kernel(module="unique", enable_backward=False)
    def by_variable(body: Body, batch: Batch, state: State, output: Output, first: int):
        index, _lane = wp.tid()
        sample = first + index
        last = real(batch.x[sample])
        e = int(1)
        while e < body.n:
            before = wp.abs(last)
            c = four(batch.rows[0], int(before))
            last = c[2]
            output.values[sample, e] = last
            e += 1

    return by_variable if variable else by_array


@pytest.mark.parametrize("variable", [False, True], ids=["array", "variable"])
def test_turns_that_depend_on_each_other_stay_in_one_pass(variable: bool, made: list[bool]) -> None:
    numbers = PRECISIONS["fp64"]
    chained, given = chained_kernel(numbers, variable), inputs(numbers)
    got = launched(chained, numbers, "simulation", given)
    assert made
    assert not any(made)
    wanted = launched(chained, numbers, None, given)
    np.testing.assert_array_equal(got.values, wanted.values)
    assert (wanted.values[:, 1] == given.rows[0, np.abs(given.x).astype(int) + 2]).all()
    assert len(given.x) == N


@pytest.mark.parametrize("n", [1, 8], ids=["worker", "simulation"])
def test_a_simulation_has_the_bits_of_one_pass(n: int, monkeypatch: pytest.MonkeyPatch) -> None:
    end = 6e-4
    model = Model(
        mesh=cylinder(4.75e-3, 6.5e-3, n_radial=5, n_axial=7),
        density=870.0,
        materials=(neo_hookean(25e3),),
        motions=(PlatenMotion.sampled(lambda t: 2.6 * t, lambda t: 0.0 * t + 2.6, start=0.0, end=end),),
        faces="coulomb",
        side="coulomb",
    )
    samples = Samples.of(stiffness_factor=np.linspace(0.8, 1.2, n), friction=0.4, poisson=0.495, damping=2e-5)
    times = np.linspace(0.0, end, 9)
    sampling = Sampling(times, times)
    results = []
    monkeypatch.setattr(kernel, "cached_translation", lambda time_loop, choice, translate: translate())
    for change in (None, lambda loop: None):
        lane_kernel.cache_clear()
        if change is not None:
            monkeypatch.setattr(statements, "divided", change)
        results.append(run(model, samples, sampling, stepping=Stepping(), threads=1))
    lane_kernel.cache_clear()
    two, one = results
    assert (two.steps > 40).all()
    for name in ("force_transmission", "impulse_flyer", "surface_r", "surface_y", "steps"):
        np.testing.assert_array_equal(getattr(two, name), getattr(one, name))
    np.testing.assert_array_equal(two.energy.elastic, one.energy.elastic)
    np.testing.assert_array_equal(two.energy.damping, one.energy.damping)


def _loop(first: tuple[str, ...], second: tuple[str, ...]) -> Loop:
    kinds = {"e_0": "int", "x_0": "f64v", "y_0": "f64v", "best_0": "f64v"}
    head = ("const int t_1 = body.n;", "if (!(e_0 < t_1)) break;")
    return Loop(head=head, first=first, second=second, step=("e_0 = t_9;",), counter="e_0", kinds=kinds)


def test_what_is_only_memory_is_read_again_and_the_rest_is_kept() -> None:
    first = (
        "const f64v t_2 = *(f64vu*)(body_shapes + e_0);",
        "x_0 = t_2;",
        "const f64v t_3 = x_0 * t_2;",
        "y_0 = op::sel(m1, t_3, y_0);",
    )
    second = ("const f64v t_4 = __builtin_elementwise_fma(t_2, t_3, y_0);", "best_0 = t_4;")
    made = divided(_loop(first, second))
    assert made is not None
    declared, lines = made
    assert declared == [f"{kind} kept_{name}[{BLOCK}];" for kind, name in
                        (("f64v", "t_3"), ("f64v", "y_0"), ("int", "e_0"))]  # fmt: skip
    begin = lines.index("for (int turn = 0; turn < turns; ++turn) {")
    assert first[0] in lines[:begin]
    assert lines[begin + 1 : begin + 7] == [
        "const f64v t_3 = kept_t_3[turn];", "y_0 = kept_y_0[turn];", "e_0 = kept_e_0[turn];",
        first[0], *second,
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("first", "second"),
    [
        (("state_u[e_0] = 1.0;",), ("x_0 = y_0;",)),  # a store in the first half
        (("y_0 = x_0;",), ("x_0 = y_0;",)),  # a variable of the turn before
        (("const f64v t_2 = *(f64vu*)(state_u + e_0);",), ("((f64vu*)state_u)[e_0] = t_2;",)),
        (("const f64v t_2 = *(f64vu*)(state_u + e_0);",), ("*(f64vu*)(state_u + e_0) = t_2;",)),
        (("const auto p_2 = op::odd(x_0);",), ("y_0 = (f64v)p_2;",)),  # of a type without a name
    ],
)
def test_what_cannot_be_told_apart_stays(first: tuple[str, ...], second: tuple[str, ...]) -> None:
    assert divided(_loop(first, second)) is None
