"""Writing a simulation's histories: forces and impulses, positions, the energy ledger."""

from dataclasses import dataclass
from functools import cache
from typing import Any

import warp as wp

from explicit.precision import Precision
from explicit.time_loop.lanes import lane_functions
from explicit.time_loop.structs import Structs


@dataclass(frozen=True)
class RecordFunctions:
    """What the time loop calls when a requested time has passed."""

    is_due: Any
    """``is_due(row, n, every)``: whether a surface time has an entry in the ledger."""
    force: Any
    """``force(output, sample, row, value, sofar)``: forces [N] and impulses [N s], flyer and transmission."""
    positions: Any
    """``positions(body, output, sample, lane, row, late, u_r, u_y, v_r, v_y)``: where the nodes were a time
    `late` before they came to `u` with the velocity `v`."""
    ledger: Any
    """``ledger(output, sample, row, external, kinetic, elastic, hourglass, damping, friction, impact,
    hourglass_damping, viscous)``."""


@cache
def record_functions(precision: Precision, structs: Structs) -> RecordFunctions:
    """Generate the recorders."""
    real = precision.real
    Body, Output = structs.Body, structs.Output
    control_first, control_stride = lane_functions().control_first, lane_functions().control_stride

    @wp.func
    def is_due(row: int, n: int, every: int):
        return row % every == 0 or row == n - 1

    @wp.func
    def record_force(output: Output, sample: int, row: int, value: wp.vec2d, sofar: wp.vec2d):
        output.force[sample, row, 0] = value[0]
        output.force[sample, row, 1] = value[1]
        output.impulse[sample, row, 0] = sofar[0]
        output.impulse[sample, row, 1] = sofar[1]

    @wp.func
    def record_positions(
        body: Body,
        output: Output,
        sample: int,
        lane: int,
        row: int,
        late: real,
        u_r: wp.array(dtype=real),
        u_y: wp.array(dtype=real),
        v_r: wp.array(dtype=real),
        v_y: wp.array(dtype=real),
    ):
        k = control_first(lane)
        while k < output.n_recorded:
            node = output.nodes[k]
            r = body.reference_r[node] + wp.float64(u_r[node] - late * v_r[node])
            y = body.reference_y[node] + wp.float64(u_y[node] - late * v_y[node])
            output.position[sample, row, k, 0] = r
            output.position[sample, row, k, 1] = y
            k += control_stride()

    @wp.func
    def record_ledger(
        output: Output,
        sample: int,
        row: int,
        external: wp.float64,
        kinetic: wp.float64,
        elastic: wp.float64,
        hourglass: wp.float64,
        damping: wp.float64,
        friction: wp.float64,
        impact: wp.float64,
        hourglass_damping: wp.float64,
        viscous: wp.float64,
    ):
        output.energy[sample, row, 0] = external
        output.energy[sample, row, 1] = kinetic
        output.energy[sample, row, 2] = elastic
        output.energy[sample, row, 3] = hourglass
        output.energy[sample, row, 4] = damping
        output.energy[sample, row, 5] = friction
        output.energy[sample, row, 6] = impact
        output.energy[sample, row, 7] = hourglass_damping
        output.energy[sample, row, 8] = viscous

    return RecordFunctions(is_due, record_force, record_positions, record_ledger)
