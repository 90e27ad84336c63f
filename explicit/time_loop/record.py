"""Writing a simulation's histories: forces and impulses, positions, the energy ledger."""

from dataclasses import dataclass
from functools import cache
from typing import Any

import warp as wp

from explicit.precision import Precision
from explicit.time_loop.lanes import LaneFunctions
from explicit.time_loop.slots import Control, Ending, Total
from explicit.time_loop.state_layout import StateLayout
from explicit.time_loop.structs import Structs, simulation_structs


@dataclass(frozen=True)
class RecordFunctions:
    """Recorders of the time loop."""

    is_due: Any
    """``is_due(row, n, every)``: whether a surface time has an entry in the ledger."""
    force: Any
    """``force(output, sample, row, value, sofar)``: forces [N] and impulses [N s], flyer and transmission."""
    positions: Any
    """``positions(body, output, sample, lane, row, late, fields)``: where the nodes were a time
    `late` before they came to `u` with the velocity `v`."""
    put_stored: Any
    """``put_stored(partials, elastic, hourglass, viscous, past, most)``: the workers hand the elements' sums
    of the ledger to control."""
    put_exchanged: Any
    """``put_exchanged(partials, kinetic, external, damping, friction, impact, hourglass_damping)``: the same
    for what the nodes' sweep and the platens' work have added up."""
    ledger: Any
    """``ledger(output, sample, row, external, kinetic, elastic, hourglass, damping, friction, impact,
    hourglass_damping, viscous)``."""
    ending: Any
    """``ending(output, sample, control, failed)``: how a simulation ended."""


@cache
def record_functions(
    precision: Precision, structs: Structs, layout: StateLayout, lanes: LaneFunctions
) -> RecordFunctions:
    """Generate the recorders."""
    real = precision.real
    Body, Output, Fields = structs.Body, structs.Output, simulation_structs(precision).Fields
    control_first, control_stride = lanes.control_first, lanes.control_stride
    put_total, put_largest = lanes.put_total, lanes.put_largest
    place_of = layout.node

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
        fields: Fields,
    ):
        k = control_first(lane)
        while k < output.n_recorded:
            node = output.nodes[k]
            at = place_of(body, node)
            r = body.reference_r[node] + wp.float64(fields.u_r[at] - late * fields.v_r[at])
            y = body.reference_y[node] + wp.float64(fields.u_y[at] - late * fields.v_y[at])
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

    @wp.func
    def put_stored(
        partials: wp.array(dtype=wp.float64),
        elastic: wp.float64,
        hourglass: wp.float64,
        viscous: wp.float64,
        past: wp.float64,
        most: wp.float64,
    ):
        put_total(partials, Total.ELASTIC, elastic)
        put_total(partials, Total.HOURGLASS, hourglass)
        put_total(partials, Total.VISCOUS, viscous)
        put_total(partials, Total.PAST, past)
        put_largest(partials, Total.MOST, most)

    @wp.func
    def put_exchanged(
        partials: wp.array(dtype=wp.float64),
        kinetic: wp.float64,
        external: wp.float64,
        damping: wp.float64,
        friction: wp.float64,
        impact: wp.float64,
        hourglass_damping: wp.float64,
    ):
        put_total(partials, Total.KINETIC, kinetic)
        put_total(partials, Total.WORK, external)
        put_total(partials, Total.DAMPING, damping)
        put_total(partials, Total.FRICTION, friction)
        put_total(partials, Total.LANDING, impact)
        put_total(partials, Total.RESTRAINT, hourglass_damping)

    @wp.func
    def record_ending(output: Output, sample: int, control: wp.array(dtype=wp.float64), failed: int):
        output.ending[sample, Ending.STATUS] = control[Control.STATUS]
        output.ending[sample, Ending.FAILED_ELEMENT] = wp.float64(failed)
        output.ending[sample, Ending.STEPS] = control[Control.STEPS]
        output.ending[sample, Ending.END_TIME] = control[Control.TIME]
        output.ending[sample, Ending.SMALLEST_STEP] = control[Control.SMALLEST_STEP]
        output.ending[sample, Ending.PAST_DATA] = control[Control.PAST_DATA]
        output.ending[sample, Ending.MOST_STRAINED] = control[Control.MOST_STRAINED]

    return RecordFunctions(
        is_due=is_due, force=record_force, positions=record_positions, put_stored=put_stored,
        put_exchanged=put_exchanged, ledger=record_ledger, ending=record_ending,
    )  # fmt: skip
