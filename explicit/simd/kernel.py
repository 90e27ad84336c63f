"""From a kernel of the scalar source to a kernel that runs it in SIMD lanes on the CPU."""

from dataclasses import dataclass
from functools import cache
from typing import Any, Literal

import warp as wp

from explicit.precision import Precision
from explicit.simd.kept_code import file_of, kept
from explicit.simd.mappings import LaneIsSimulation
from explicit.simd.prelude import prelude
from explicit.simd.team import CODE, Team
from explicit.simd.values import Scalar, Struct
from explicit.simd.workers import LaneIsWorker
from explicit.time_loop.structs import Structs

Mapping = Literal["simulation", "worker"]
PACK_BYTES = 64
"""Bytes of a pack: one register of AVX-512, two of AVX2."""
FLAGS = "-march=native -ffp-contract=off -mprefer-vector-width=512 -mstackrealign"
"""Nothing is fused that the translator has not fused, so a simulation keeps its bits in any pack."""


@dataclass(frozen=True)
class LaneKernel:
    """A kernel over lanes."""

    kernel: Any
    """Launch with dim 1 and inputs (body, batch, state, output, first, count, team); by each thread of those
    that share a simulation (`explicit.simd.team`)."""
    lanes: int
    """Lanes of a pack."""


@cache
def lane_kernel(
    time_loop: Any, structs: Structs, precision: Precision, mapping: Mapping, lanes: int
) -> LaneKernel:
    """Generate the lanes of a time loop.

    Parameters
    ----------
    time_loop
        The scalar Warp kernel.
    structs, precision
        Types of its arguments and its arithmetic.
    mapping
        "simulation": a lane is a simulation; "worker": the lanes share one simulation, which several threads
        may.
    lanes : int
        Lanes of a pack, a power of two.
    """
    arguments: dict[str, Any] = {
        name: Struct(kind, name)
        for name, kind in (
            ("body", structs.Body),
            ("batch", structs.Batch),
            ("state", structs.State),
            ("output", structs.Output),
        )
    }
    arguments["first"] = Scalar("i32", "first")

    def translate() -> str:
        translator = {"simulation": LaneIsSimulation, "worker": LaneIsWorker}[mapping](lanes)
        before = prelude(lanes, "f64" if precision.name == "fp64" else "f32")
        if mapping == "worker":
            before += CODE
        return before + translator.translate(time_loop.func, arguments)

    code = kept(time_loop, _choice(precision, mapping, lanes), translate)
    Body, Batch, State, Output = structs.Body, structs.Batch, structs.State, structs.Output

    @wp.func_native(snippet=code)
    def time_loop_lanes(
        body: Body,  # type: ignore[valid-type]
        batch: Batch,  # type: ignore[valid-type]
        state: State,  # type: ignore[valid-type]
        output: Output,  # type: ignore[valid-type]
        first: int,
        count: int,
        team: Team,
    ): ...

    @wp.kernel(module="unique", enable_backward=False, module_options={"cpu_compiler_flags": FLAGS})
    def time_loop_packs(
        body: Body,  # type: ignore[valid-type]
        batch: Batch,  # type: ignore[valid-type]
        state: State,  # type: ignore[valid-type]
        output: Output,  # type: ignore[valid-type]
        first: int,
        count: int,
        team: Team,
    ):
        time_loop_lanes(body, batch, state, output, first, count, team)

    return LaneKernel(time_loop_packs, lanes)


def is_known(time_loop: Any, precision: Precision, mapping: Mapping, lanes: int) -> bool:
    """Whether this machine has translated a time loop, and compiled it then unless it was stopped."""
    return file_of(time_loop, _choice(precision, mapping, lanes)).exists()


def _choice(precision: Precision, mapping: Mapping, lanes: int) -> str:
    return f"{mapping} {lanes} {precision.name}"
