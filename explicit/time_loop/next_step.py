"""The next step: its size, where it takes the platens, what it records, and whether it may be taken."""

from dataclasses import dataclass
from functools import cache
from typing import Any

import warp as wp

from explicit.elements.base import INVERTED
from explicit.outcome import Outcome
from explicit.precision import Precision
from explicit.time_loop.boundary import BoundaryFunctions
from explicit.time_loop.failure import CHECK_EVERY, MOTION_LIMIT
from explicit.time_loop.lanes import LaneFunctions
from explicit.time_loop.record import RecordFunctions
from explicit.time_loop.slots import CONTROL_SIZE, NO_TIME, Control, Plan, Total
from explicit.time_loop.structs import Structs, simulation_structs


@dataclass(frozen=True)
class NextStepFunctions:
    """From rest to the last check; all but `read` are for the control warp."""

    start: Any
    """``start(batch, output, sample, control)``: the control record at rest."""
    first_step: Any
    """``first_step(control)``: begin the first step, if it can be taken."""
    check: Any
    """``check(batch, sample, control, partials)``: the outcome of a failure that the workers' totals show, or
    0."""
    next_step: Any
    """``next_step(batch, output, sample, step, measured, control, partials)``: plan a step to come, with
    a new size where the bound was `measured`."""
    read: Any
    """``read(control, step) -> Step``: the plan of the step under way, for every lane."""
    again: Any
    """``again(planned, control, step) -> Step``: the same once more, where the record has come since."""
    as_read: Any
    """``as_read(planned, control, step) -> Step``: what was read before."""


@cache
def next_step_functions(
    precision: Precision,
    structs: Structs,
    boundary: BoundaryFunctions,
    record: RecordFunctions,
    lanes: LaneFunctions,
    relaxes: bool,
) -> NextStepFunctions:
    """Generate the planning."""
    Batch, Output, Step = structs.Batch, structs.Output, simulation_structs(precision).Step
    platen_position = boundary.platen_position
    is_due = record.is_due
    control_sync, get_total, get_largest = lanes.control_sync, lanes.get_total, lanes.get_largest
    ZERO, HALF, ONE, TWO = wp.float64(0.0), wp.float64(0.5), wp.float64(1.0), wp.float64(2.0)
    NEVER = wp.float64(NO_TIME)
    inverted = wp.float64(INVERTED * 0.5)
    watch_every, motion_limit = int(CHECK_EVERY), wp.float64(MOTION_LIMIT)
    diverged, turned = int(Outcome.DIVERGED), int(Outcome.INVERTED)
    collapsed, limit = int(Outcome.STEP_COLLAPSED), int(Outcome.STEP_LIMIT)
    exceeded, branches = int(Outcome.TABLE_EXCEEDED), int(relaxes)

    @wp.func
    def start(batch: Batch, output: Output, sample: int, control: wp.array(dtype=wp.float64)):
        for k in range(CONTROL_SIZE):
            control[k] = ZERO
        control[Control.TIME] = batch.start
        control[Control.GOING] = ONE
        rest = platen_position(batch, batch.motion[sample], batch.start)
        control[Control.PLANS + Plan.SIZE + Plan.FLYER_NEXT] = rest
        control[Control.FORCE_DUE] = output.force_times[0]
        control[Control.SURFACE_DUE] = output.surface_times[0]
        control[Control.PLANNED_DUE] = output.surface_times[0]
        control[Control.SMALLEST_STEP] = batch.largest_step

    @wp.func
    def first_step(control: wp.array(dtype=wp.float64)):
        if control[Control.FAULT] > ZERO:
            control[Control.STATUS] = control[Control.FAULT]
            control[Control.GOING] = ZERO

    @wp.func
    def check(
        batch: Batch,
        sample: int,
        control: wp.array(dtype=wp.float64),
        partials: wp.array(dtype=wp.float64),
    ):
        most_work = wp.max(wp.float64(control[Control.MOST_WORK]), get_total(partials, Total.WORK_DONE))
        control_sync()
        control[Control.MOST_WORK] = most_work
        allowed = motion_limit * most_work + batch.stray_energy[sample]
        fault = int(0)
        if not (get_total(partials, Total.MOTION) <= allowed):  # nor where it is no number
            fault = diverged
        elif get_largest(partials, Total.TURNED) >= inverted:
            fault = turned
        return fault

    @wp.func
    def next_step(
        batch: Batch,
        output: Output,
        sample: int,
        step: int,
        measured: int,
        control: wp.array(dtype=wp.float64),
        partials: wp.array(dtype=wp.float64),
    ):
        this = Control.PLANS + Plan.SIZE * (step % 2)
        before = Control.PLANS + Plan.SIZE * ((step + 1) % 2)
        dt_before, rate = wp.float64(control[before + Plan.STEP]), wp.float64(control[before + Plan.RATE])
        flyer_y = wp.float64(control[before + Plan.FLYER_NEXT])
        planned_due = wp.float64(control[Control.PLANNED_DUE])
        time = wp.float64(control[Control.TIME]) + dt_before
        dt = wp.float64(dt_before)
        control_sync()
        # The bound was measured one step ago, where the specimen stood before the step that is under way.
        if measured == 1:
            omega_squared = get_largest(partials, Total.STIFFEST + step % 2)
            if branches == 1:
                omega_squared += get_largest(partials, Total.STIFFER + step % 2)
            dt = wp.min(batch.safety * TWO / wp.sqrt(omega_squared), batch.largest_step)
            rate = ONE / dt
            if step == 0:
                control[Control.FIRST_STEP] = dt
            control_sync()
            if omega_squared >= inverted:
                control[Control.FAULT] = wp.float64(turned)
                control[Control.VOID] = ONE
            elif dt < batch.floor * control[Control.FIRST_STEP]:
                control[Control.FAULT] = wp.float64(collapsed)
            elif not wp.isfinite(omega_squared):
                control[Control.FAULT] = wp.float64(diverged)
                control[Control.VOID] = ONE
            else:
                control[Control.SMALLEST_STEP] = wp.min(control[Control.SMALLEST_STEP], dt)
        if step >= batch.max_steps:
            control[Control.FAULT] = wp.float64(limit)
        if batch.stop_past_data == 1 and get_largest(partials, Total.BEYOND) > ZERO:
            control[Control.FAULT] = wp.float64(exceeded)
            control[Control.VOID] = ONE
        if step > 0 and (step - 1) % watch_every == 0:
            fault = check(batch, sample, control, partials)
            if fault != 0:
                control[Control.FAULT] = wp.float64(fault)
                control[Control.VOID] = ONE
        following, ledger = time + dt, wp.float64(0.0)
        if planned_due <= following:
            planned = int(control[Control.PLANNED])
            while planned_due <= following:
                if is_due(planned, output.surface_times.shape[0], batch.ledger_every):
                    ledger = ONE
                planned += 1
                planned_due = wp.float64(NEVER)
                if planned < output.surface_times.shape[0]:
                    planned_due = wp.float64(output.surface_times[planned])
            control_sync()
            control[Control.PLANNED] = wp.float64(planned)
            control[Control.PLANNED_DUE] = planned_due
        if step == 0 and batch.support_moves == 1:
            control[Control.LOWER_NEXT] = platen_position(batch, batch.support_motion[sample], following)
            control[Control.LOWER_SPEED] = control[Control.LOWER_NEXT] * rate
        flyer_next = platen_position(batch, batch.motion[sample], following)
        interval = HALF * (dt + dt_before)  # the velocity lives between the positions
        control[this + Plan.STEP] = dt
        control[this + Plan.STEP_BEFORE] = dt_before
        control[this + Plan.INTERVAL] = interval
        control[this + Plan.PER_INTERVAL] = ONE / interval
        control[this + Plan.RATE] = rate
        control[this + Plan.FLYER_NEXT] = flyer_next
        control[this + Plan.UPPER_SPEED] = (flyer_y - flyer_next) * rate
        control[this + Plan.LEDGER] = ledger

    @wp.func
    def read(control: wp.array(dtype=wp.float64), step: int):
        this = Control.PLANS + Plan.SIZE * (step % 2)
        return Step(
            control[this + Plan.STEP],
            control[this + Plan.INTERVAL],
            control[this + Plan.RATE],
            control[this + Plan.FLYER_NEXT],
            control[this + Plan.UPPER_SPEED],
            int(control[this + Plan.LEDGER] > ZERO),
        )

    @wp.func
    def again(planned: Step, control: wp.array(dtype=wp.float64), step: int):
        return read(control, step)

    @wp.func
    def as_read(planned: Step, control: wp.array(dtype=wp.float64), step: int):
        return planned

    return NextStepFunctions(start, first_step, check, next_step, read, again, as_read)
