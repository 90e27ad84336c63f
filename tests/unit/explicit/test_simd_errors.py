"""The translator rejects unknown source and shows it in the message."""

import re
from collections.abc import Callable, Iterator
from pathlib import Path
from textwrap import indent
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest
import warp as wp
from lane_kernels import MAPPINGS, lanes_of, small_structs
from module_files import module_at

from explicit.layout.lanes import lane_functions
from explicit.layout.structs import entry_function, four_function
from explicit.precision import PRECISIONS
from explicit.simd import Mapping, kernel, lane_kernel

NUMBERS = PRECISIONS["fp64"]
STRUCTS = small_structs(NUMBERS)

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


def refused(source: Callable[..., Any], message: str, mapping: Mapping = "simulation") -> None:
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


@wp.func
def law_with_an_error_function(x: wp.float64):
    return x + wp.erf(x)


KERNELS = {
    "leaving_a_loop": ("for k in range(3):\n    break", "break: no meaning over lanes"),
    "a_choice": (
        "x = one if batch.k[i] > 2 else batch.x[i]",
        "one if batch.k[i] > 2 else batch.x[i]: IfExp has no meaning over lanes; write wp.where",
    ),
    "a_step": (
        "for k in range(0, 6, 2):\n    i = k",
        "for k in range(0, 6, 2):\n    i = k: a range has one or two bounds",
    ),
    "a_loop_over_numbers": ("for k in batch.k:\n    i = k", "batch.k: a loop goes over a range"),
    "a_loop_with_else": ("while body.n > 0:\n    i = 1\nelse:\n    i = 2", "a loop has no else over lanes"),
    "return_in_a_branch": ("output.values[i, 0] = early(batch.x[i])", "return one: no meaning over lanes"),
    "a_chain": (
        "if 0 < batch.k[i] < 3:\n    i = 1",
        "0 < batch.k[i] < 3: one comparison of numbers at a time",
    ),
    "a_power": (
        "x = batch.k[i] ** batch.k[i]",
        "batch.k[i] ** batch.k[i]: no such operator over lanes; write wp.pow(x, y)",
    ),
    "a_remainder": (
        "x = batch.x[i] % batch.y[i]",
        "batch.x[i] % batch.y[i]: no such operator over lanes; write x - y * wp.trunc(x / y)",
    ),
    "two_kinds": ("x = batch.x[i] + batch.k[i]", "batch.x[i] + batch.k[i]: operands of one kind are wanted"),
    "two_kinds_fused": (
        "x = batch.x[i] + batch.y[i] * batch.k[i]",
        "batch.x[i] + batch.y[i] * batch.k[i]: operands of one kind are wanted",
    ),
    "two_kinds_compared": (
        "if batch.x[i] > batch.k[i]:\n    i = 1",
        "batch.x[i] > batch.k[i]: operands of one kind are wanted",
    ),
    "two_kinds_in_one_name": ("x = one\nx = batch.k[i]", "x = batch.k[i]: x changes from f64 to i32"),
    "a_number_for_a_truth": ("if batch.k[i]:\n    i = 1", "batch.k[i]: a truth value is wanted here"),
    "a_function_of_no_lane": (
        "x = wp.erf(batch.x[i])",
        "wp.erf has no meaning over lanes; of Warp's functions use abs, acos,",
    ),
    "half_precision": (
        "x = wp.float16(batch.x[i])",
        "wp.float16(batch.x[i]): a number becomes a number of another kind",
    ),
    "too_few": ("x = wp.vec4d(batch.x[i], one)", "wp.vec4d(batch.x[i], one): 4 numbers f64 are wanted"),
    "a_vector": (
        "x = wp.max(batch.v[i], batch.v[i])",
        "wp.max(batch.v[i], batch.v[i]): 2 numbers are wanted",
    ),
    "a_component": (
        "x = batch.v[i][batch.k[i]]",
        "batch.v[i][batch.k[i]]: a component is chosen by a known number",
    ),
    "written_component": ("x = batch.v[i]\nx[0] = one", "x[0] = one: only parts of arrays are assigned"),
    "written_vector": ("batch.v[i] = batch.v[0]", "batch.v[i] = batch.v[0]: one number is written at a time"),
    "wrong_kind_written": (
        "output.values[i, 0] = batch.k[i]",
        "output.values[i, 0] = batch.k[i]: a f64 is wanted, this is a i32",
    ),
    "truth_values_in_memory": ("x = batch.flag[i]", "batch.flag: truth values are kept as integers"),
    "shape_of_the_state": (
        "n = state.u.shape[0]",
        "state.u.shape[0]: the shape of a constant array by a known number is wanted",
    ),
    "a_keyword": (
        "x = wp.max(batch.x[i], b=one)",
        "wp.max(batch.x[i], b=one): arguments by position are wanted",
    ),
    "constants_of_a_row": (
        "x = entry(body.weight, 0, lane)",
        "entry(body.weight, 0, lane): a table of constants and a number",
    ),
    "constants_of_the_state": (
        "x = entry(state.u, 0, lane)",
        "entry(state.u, 0, lane): a table of constants and a number",
    ),
    "another_constant_a_lane": (
        "x = entry(body.table, body.place[lane + batch.k[i]], lane)",
        "a table of constants and a number that all lanes share are wanted",
    ),
    "four_of_a_vector": (
        "x = four(batch.v[0], 0)",
        "four(batch.v[0], 0): a row of constants and a number are wanted",
    ),
    "totals_of_a_number": (
        "x = boundary_totals(one, one, body.n)",
        "boundary_totals(one, one, body.n): numbers of boundary nodes and a count",
    ),
    "totals_of_a_lane": (
        "x = boundary_totals(state.ours[i], state.ours[i], body.place[lane + batch.k[i]])",
        "numbers of boundary nodes and a count that all lanes share are wanted",
    ),
}
"""Bodies of kernels after `i, lane = wp.tid()`, and words of their refusals, in either mapping."""
OF_A_PACK = {
    "a_sum_that_began_elsewhere": (
        "put_total(state.parts[i], 0, wp.float64(batch.x[i]))",
        "put_total(state.parts[i], 0, wp.float64(batch.x[i])): only sums that began with empty_sum",
    ),
    "four_of_the_state": (
        "x = four(state.u[i], 0)",
        "four(state.u[i], 0): a row of constants and a number are wanted",
    ),
}
OF_WORKERS = {
    "lanes_apart": (
        "if lane == 2:\n    put_largest(state.parts[i], 0, one)",
        "put_largest(state.parts[i], 0, one): every lane must take part",
    ),
    "one_place": (
        "output.values[i, 0] = body.weight[lane]",
        "lanes would write different values to one place",
    ),
}
IN_A_LAW = {"a_law_in_a_file": ("output.values[i, 0] = law_with_an_error_function(batch.x[i])", "")}


@pytest.fixture(scope="module")
def kernels(tmp_path_factory: pytest.TempPathFactory) -> ModuleType:
    """The kernels as functions of a module in a file, which the translator reads."""
    text = "from test_simd_errors import *\n"
    for name, (body, _) in (KERNELS | OF_A_PACK | OF_WORKERS | IN_A_LAW).items():
        body = indent("i, lane = wp.tid()\n" + body, "    ")
        text += f"\n\ndef {name}(body, batch, state, output, first):\n{body}\n"
    file = tmp_path_factory.mktemp("refused") / "refused_kernels.py"
    file.write_text(text, "utf-8")
    return module_at(file)


@pytest.mark.parametrize(
    ("name", "mapping"),
    [
        *((name, mapping) for name in KERNELS for mapping in MAPPINGS),
        *((name, "simulation") for name in OF_A_PACK),
        *((name, "worker") for name in OF_WORKERS),
    ],
)
def test_a_kernel_without_a_meaning_is_refused(kernels: ModuleType, name: str, mapping: Mapping) -> None:
    refused(getattr(kernels, name), (KERNELS | OF_A_PACK | OF_WORKERS)[name][1], mapping)


def test_a_refusal_names_function_file_line_and_cure(kernels: ModuleType) -> None:
    line = law_with_an_error_function.func.__code__.co_firstlineno + 2
    for words in (
        f"test_simd_errors.py:{line}: wp.erf(x): wp.erf has no meaning over lanes",
        "atan2, ",
        "pow, ",
    ):
        refused(kernels.a_law_in_a_file, words)
