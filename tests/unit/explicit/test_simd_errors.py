"""The translator rejects unknown source and shows it in the message."""

# ruff: noqa: F841, B007, RUF059 -- these kernels are only read

import re
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import warp as wp
from lane_kernels import MAPPINGS, lanes_of, small_structs

from explicit.layout.lanes import lane_functions
from explicit.layout.structs import entry_function, four_function
from explicit.precision import PRECISIONS
from explicit.simd import Mapping, kernel, lane_kernel

NUMBERS = PRECISIONS["fp64"]
STRUCTS = small_structs(NUMBERS)
Body, Batch, State, Output = STRUCTS.Body, STRUCTS.Batch, STRUCTS.State, STRUCTS.Output
Function = Callable[..., Any]

put_total, put_largest = lane_functions().put_total, lane_functions().put_largest
boundary_totals = lane_functions().boundary_totals
entry, four = entry_function(NUMBERS.real), four_function(NUMBERS)
one = wp.float64(1.0)


@pytest.fixture(autouse=True)
def nothing_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """A kept translation would be found, and not refused, by the next process."""
    monkeypatch.setattr(kernel, "kernel_cache", lambda: tmp_path)
    yield
    assert not list(tmp_path.rglob("*.inc"))


def refused(source: Function, message: str, mapping: Mapping = "simulation") -> None:
    """The source's sample is a lane's own (or its lane, for workers), and it is refused every time."""

    class TimeLoop:
        func = staticmethod(source)
        module = SimpleNamespace(hash_module=lambda: source.__name__.encode())

    for _ in range(2):
        with pytest.raises(TypeError, match=re.escape(message)):
            lane_kernel(TimeLoop, STRUCTS, NUMBERS, mapping, lanes_of(NUMBERS))


@wp.func
def early(x: wp.float64):
    if x > one:
        return one
    return x


def return_in_a_branch(body, batch, state, output, first):
    i, lane = wp.tid()
    output.values[i, 0] = early(batch.x[i])


def leaving_a_loop(body, batch, state, output, first):
    for k in range(3):
        break


def a_choice(body, batch, state, output, first):
    i, lane = wp.tid()
    x = one if batch.k[i] > 2 else batch.x[i]


def a_step(body, batch, state, output, first):
    for k in range(0, 6, 2):
        i = k


def a_loop_over_numbers(body, batch, state, output, first):
    for k in batch.k:
        i = k


def a_loop_with_else(body, batch, state, output, first):
    while body.n > 0:
        i = 1
    else:
        i = 2


def a_chain(body, batch, state, output, first):
    i, lane = wp.tid()
    if 0 < batch.k[i] < 3:
        i = 1


def a_power(body, batch, state, output, first):
    i, lane = wp.tid()
    x = batch.k[i] ** batch.k[i]


def a_remainder(body, batch, state, output, first):
    i, lane = wp.tid()
    x = batch.x[i] % batch.y[i]


def two_kinds(body, batch, state, output, first):
    i, lane = wp.tid()
    x = batch.x[i] + batch.k[i]


def two_kinds_fused(body, batch, state, output, first):
    i, lane = wp.tid()
    x = batch.x[i] + batch.y[i] * batch.k[i]


def two_kinds_compared(body, batch, state, output, first):
    i, lane = wp.tid()
    if batch.x[i] > batch.k[i]:
        i = 1


def two_kinds_in_one_name(body, batch, state, output, first):
    i, lane = wp.tid()
    x = one
    x = batch.k[i]


def a_number_for_a_truth(body, batch, state, output, first):
    i, lane = wp.tid()
    if batch.k[i]:
        i = 1


def a_function_of_no_lane(body, batch, state, output, first):
    i, lane = wp.tid()
    x = wp.erf(batch.x[i])


def half_precision(body, batch, state, output, first):
    i, lane = wp.tid()
    x = wp.float16(batch.x[i])


def too_few(body, batch, state, output, first):
    i, lane = wp.tid()
    x = wp.vec4d(batch.x[i], one)


def a_vector(body, batch, state, output, first):
    i, lane = wp.tid()
    x = wp.max(batch.v[i], batch.v[i])


def a_component(body, batch, state, output, first):
    i, lane = wp.tid()
    x = batch.v[i][batch.k[i]]


def written_component(body, batch, state, output, first):
    i, lane = wp.tid()
    x = batch.v[i]
    x[0] = one


def written_vector(body, batch, state, output, first):
    i, lane = wp.tid()
    batch.v[i] = batch.v[0]


def wrong_kind_written(body, batch, state, output, first):
    i, lane = wp.tid()
    output.values[i, 0] = batch.k[i]


def truth_values_in_memory(body, batch, state, output, first):
    i, lane = wp.tid()
    x = batch.flag[i]


def shape_of_the_state(body, batch, state, output, first):
    n = state.u.shape[0]


def a_keyword(body, batch, state, output, first):
    i, lane = wp.tid()
    x = wp.max(batch.x[i], b=one)


def a_sum_of_something(body, batch, state, output, first):
    i, lane = wp.tid()
    put_total(state.parts[i], 0, wp.float64(batch.x[i]))


def constants_of_a_row(body, batch, state, output, first):
    i, lane = wp.tid()
    x = entry(body.weight, 0, lane)


def constants_of_the_state(body, batch, state, output, first):
    i, lane = wp.tid()
    x = entry(state.u, 0, lane)


def another_constant_a_lane(body, batch, state, output, first):
    i, lane = wp.tid()
    x = entry(body.table, body.place[lane + batch.k[i]], lane)


def four_of_a_vector(body, batch, state, output, first):
    x = four(batch.v[0], 0)


def totals_of_a_number(body, batch, state, output, first):
    x = boundary_totals(one, one, body.n)


def totals_of_a_lane(body, batch, state, output, first):
    i, lane = wp.tid()
    x = boundary_totals(state.ours[i], state.ours[i], body.place[lane + batch.k[i]])


@pytest.mark.parametrize("mapping", MAPPINGS)
@pytest.mark.parametrize(
    ("source", "message"),
    [
        (leaving_a_loop, "break: no meaning over lanes"),
        (a_choice, "one if batch.k[i] > 2 else batch.x[i]: IfExp has no meaning over lanes; write wp.where"),
        (a_step, "for k in range(0, 6, 2):\n    i = k: a range has one or two bounds"),
        (a_loop_over_numbers, "batch.k: a loop goes over a range"),
        (a_loop_with_else, "a loop has no else over lanes"),
        (return_in_a_branch, "return one: no meaning over lanes"),
        (a_chain, "0 < batch.k[i] < 3: one comparison of numbers at a time"),
        (a_power, "batch.k[i] ** batch.k[i]: no such operator over lanes; write wp.pow(x, y)"),
        (a_remainder, "batch.x[i] % batch.y[i]: no such operator over lanes; write x - y * wp.trunc(x / y)"),
        (two_kinds, "batch.x[i] + batch.k[i]: operands of one kind are wanted"),
        (two_kinds_fused, "batch.x[i] + batch.y[i] * batch.k[i]: operands of one kind are wanted"),
        (two_kinds_compared, "batch.x[i] > batch.k[i]: operands of one kind are wanted"),
        (two_kinds_in_one_name, "x = batch.k[i]: x changes from f64 to i32"),
        (a_number_for_a_truth, "batch.k[i]: a truth value is wanted here"),
        (a_function_of_no_lane, "wp.erf has no meaning over lanes; of Warp's functions use abs, acos,"),
        (half_precision, "wp.float16(batch.x[i]): a number becomes a number of another kind"),
        (too_few, "wp.vec4d(batch.x[i], one): 4 numbers f64 are wanted"),
        (a_vector, "wp.max(batch.v[i], batch.v[i]): 2 numbers are wanted"),
        (a_component, "batch.v[i][batch.k[i]]: a component is chosen by a known number"),
        (written_component, "x[0] = one: only parts of arrays are assigned"),
        (written_vector, "batch.v[i] = batch.v[0]: one number is written at a time"),
        (wrong_kind_written, "output.values[i, 0] = batch.k[i]: a f64 is wanted, this is a i32"),
        (truth_values_in_memory, "batch.flag: truth values are kept as integers"),
        (shape_of_the_state, "state.u.shape[0]: the shape of a constant array by a known number is wanted"),
        (a_keyword, "wp.max(batch.x[i], b=one): arguments by position are wanted"),
        (constants_of_a_row, "entry(body.weight, 0, lane): a table of constants and a number"),
        (constants_of_the_state, "entry(state.u, 0, lane): a table of constants and a number"),
        (another_constant_a_lane, "a table of constants and a number that all lanes share are wanted"),
        (four_of_a_vector, "four(batch.v[0], 0): a row of constants and a number are wanted"),
        (totals_of_a_number, "boundary_totals(one, one, body.n): numbers of boundary nodes and a count"),
        (totals_of_a_lane, "numbers of boundary nodes and a count that all lanes share are wanted"),
    ],
)
def test_refused_in_both_mappings(source: Function, message: str, mapping: Mapping) -> None:
    refused(source, message, mapping)


def test_a_sum_of_one_worker_begins_with_empty_sum() -> None:
    message = "put_total(state.parts[i], 0, wp.float64(batch.x[i])): only sums that began with empty_sum"
    refused(a_sum_of_something, message)


def four_of_the_state(body, batch, state, output, first):
    i, lane = wp.tid()
    x = four(state.u[i], 0)


def test_the_state_of_a_pack_has_no_four_numbers_in_a_row() -> None:
    refused(four_of_the_state, "four(state.u[i], 0): a row of constants and a number are wanted")


def lanes_apart(body, batch, state, output, first):
    i, lane = wp.tid()
    if lane == 2:
        put_largest(state.parts[i], 0, one)


def one_place(body, batch, state, output, first):
    i, lane = wp.tid()
    output.values[i, 0] = body.weight[lane]


def test_workers_reduce_together_and_write_apart() -> None:
    refused(lanes_apart, "put_largest(state.parts[i], 0, one): every lane must take part", "worker")
    refused(one_place, "lanes would write different values to one place", "worker")


@wp.func
def law_with_an_error_function(x: wp.float64):
    return x + wp.erf(x)


def a_law_in_a_file(body, batch, state, output, first):
    i, lane = wp.tid()
    output.values[i, 0] = law_with_an_error_function(batch.x[i])


def test_a_refusal_names_function_file_line_and_cure() -> None:
    line = law_with_an_error_function.func.__code__.co_firstlineno + 2
    refused(a_law_in_a_file, f"test_simd_errors.py:{line}: wp.erf(x): wp.erf has no meaning over lanes")
    refused(a_law_in_a_file, "atan2, ")
    refused(a_law_in_a_file, "pow, ")
