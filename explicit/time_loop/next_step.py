"""Planning a step: its size, where it takes the platens, what it records, and whether it may be taken."""

from dataclasses import dataclass
from functools import cache
from typing import Any

import warp as wp

from explicit.elements.base import INVERTED
from explicit.outcome import Outcome
from explicit.time_loop.boundary import BoundaryFunctions
from explicit.time_loop.failure import CHECK_EVERY, MOTION_LIMIT
from explicit.time_loop.lanes import lane_functions
from explicit.time_loop.record import RecordFunctions
from explicit.time_loop.slots import (
    BEYOND,
    CLOCK,
    COMING,
    COMING_DUE,
    FAULT,
    FIRST_STEP,
    FLYER_NEXT,
    FORCE_DUE,
    GOING,
    INTERVAL,
    LEDGER,
    LOWER_NEXT,
    LOWER_SPEED,
    MOST_WORK,
    MOTION,
    NO_TIME,
    PER_INTERVAL,
    PLAN,
    PLANS,
    RATE,
    SMALLEST_STEP,
    STATUS,
    STEP,
    STEP_BEFORE,
    STIFFER,
    STIFFEST,
    SURFACE_DUE,
    TIME,
    TURNED,
    UPPER_SPEED,
    VOID,
    WORK_DONE,
)
from explicit.time_loop.structs import Structs


@dataclass(frozen=True)
class NextStepFunctions:
    """From rest to the last look."""

    start: Any
    """``start(batch, output, sample, clock)``: the clock at rest."""
    depart: Any
    """``depart(clock)``: the first step begins, if it can be taken."""
    look: Any
    """``look(batch, sample, clock, parts)``: the outcome of a failure that the workers' totals show, or 0."""
    plan: Any
    """``plan(batch, output, sample, step, clock, parts)``: a step to come."""


@cache
def next_step_functions(
    structs: Structs, boundary: BoundaryFunctions, record: RecordFunctions
) -> NextStepFunctions:
    """Generate the planning."""
    Batch, Output = structs.Batch, structs.Output
    platen_position = boundary.platen_position
    is_due = record.is_due
    lanes = lane_functions()
    control_sync, get_total, get_largest = lanes.control_sync, lanes.get_total, lanes.get_largest
    ZERO, HALF, ONE, TWO = wp.float64(0.0), wp.float64(0.5), wp.float64(1.0), wp.float64(2.0)
    NEVER = wp.float64(NO_TIME)
    inverted = wp.float64(INVERTED * 0.5)
    watch_every, motion_limit = int(CHECK_EVERY), wp.float64(MOTION_LIMIT)
    diverged, turned = int(Outcome.DIVERGED), int(Outcome.INVERTED)
    collapsed, limit = int(Outcome.STEP_COLLAPSED), int(Outcome.STEP_LIMIT)
    exceeded = int(Outcome.TABLE_EXCEEDED)

    @wp.func
    def start(batch: Batch, output: Output, sample: int, clock: wp.array(dtype=wp.float64)):
        for k in range(CLOCK):
            clock[k] = ZERO
        clock[TIME] = batch.start
        clock[GOING] = ONE
        clock[PLANS + PLAN + FLYER_NEXT] = platen_position(batch, batch.motion[sample], batch.start)
        clock[FORCE_DUE] = output.force_times[0]
        clock[SURFACE_DUE] = output.surface_times[0]
        clock[COMING_DUE] = output.surface_times[0]
        clock[SMALLEST_STEP] = batch.largest_step

    @wp.func
    def depart(clock: wp.array(dtype=wp.float64)):
        """The first step begins, if it can be taken."""
        if clock[FAULT] > ZERO:
            clock[STATUS] = clock[FAULT]
            clock[GOING] = ZERO

    @wp.func
    def look(
        batch: Batch,
        sample: int,
        clock: wp.array(dtype=wp.float64),
        parts: wp.array(dtype=wp.float64),
    ):
        """The outcome of a failure that the workers' totals show, or 0."""
        most_work = wp.max(wp.float64(clock[MOST_WORK]), get_total(parts, WORK_DONE))
        control_sync()
        clock[MOST_WORK] = most_work
        allowed = motion_limit * most_work + batch.stray_energy[sample]
        fault = int(0)
        if not (get_total(parts, MOTION) <= allowed):  # nor where it is no number
            fault = diverged
        elif get_largest(parts, TURNED) >= inverted:
            fault = turned
        return fault

    @wp.func
    def plan(
        batch: Batch,
        output: Output,
        sample: int,
        step: int,
        clock: wp.array(dtype=wp.float64),
        parts: wp.array(dtype=wp.float64),
    ):
        """A step to come: its size, where it takes the flyer, and whether the ledger is due in it."""
        this, before = PLANS + PLAN * (step % 2), PLANS + PLAN * ((step + 1) % 2)
        dt_before, rate = wp.float64(clock[before + STEP]), wp.float64(clock[before + RATE])
        flyer_y, coming_due = wp.float64(clock[before + FLYER_NEXT]), wp.float64(clock[COMING_DUE])
        time = wp.float64(clock[TIME]) + dt_before
        dt = wp.float64(dt_before)
        control_sync()
        # The bound was measured one step ago, where the specimen stood before the step that is under way.
        if step % batch.measure_every == 0:
            omega_squared = get_largest(parts, STIFFEST + step % 2) + get_largest(parts, STIFFER + step % 2)
            dt = wp.min(batch.safety * TWO / wp.sqrt(omega_squared), batch.largest_step)
            rate = ONE / dt
            if step == 0:
                clock[FIRST_STEP] = dt
            control_sync()
            if omega_squared >= inverted:
                clock[FAULT] = wp.float64(turned)
                clock[VOID] = ONE
            elif dt < batch.floor * clock[FIRST_STEP]:
                clock[FAULT] = wp.float64(collapsed)
            elif not wp.isfinite(omega_squared):
                clock[FAULT] = wp.float64(diverged)
                clock[VOID] = ONE
            else:
                clock[SMALLEST_STEP] = wp.min(clock[SMALLEST_STEP], dt)
        if step >= batch.max_steps:
            clock[FAULT] = wp.float64(limit)
        if batch.stop_past_data == 1 and get_largest(parts, BEYOND) > ZERO:
            clock[FAULT] = wp.float64(exceeded)
            clock[VOID] = ONE
        if step > 0 and (step - 1) % watch_every == 0:
            fault = look(batch, sample, clock, parts)
            if fault != 0:
                clock[FAULT] = wp.float64(fault)
                clock[VOID] = ONE
        following, ledger = time + dt, wp.float64(0.0)
        if coming_due <= following:
            coming = int(clock[COMING])
            while coming_due <= following:
                if is_due(coming, output.surface_times.shape[0], batch.ledger_every):
                    ledger = ONE
                coming += 1
                coming_due = wp.float64(NEVER)
                if coming < output.surface_times.shape[0]:
                    coming_due = wp.float64(output.surface_times[coming])
            control_sync()
            clock[COMING] = wp.float64(coming)
            clock[COMING_DUE] = coming_due
        if step == 0 and batch.support_moves == 1:
            clock[LOWER_NEXT] = platen_position(batch, batch.support_motion[sample], following)
            clock[LOWER_SPEED] = clock[LOWER_NEXT] * rate
        flyer_next = platen_position(batch, batch.motion[sample], following)
        interval = HALF * (dt + dt_before)  # the velocity lives between the positions
        clock[this + STEP] = dt
        clock[this + STEP_BEFORE] = dt_before
        clock[this + INTERVAL] = interval
        clock[this + PER_INTERVAL] = ONE / interval
        clock[this + RATE] = rate
        clock[this + FLYER_NEXT] = flyer_next
        clock[this + UPPER_SPEED] = (flyer_y - flyer_next) * rate
        clock[this + LEDGER] = ledger

    return NextStepFunctions(start, depart, look, plan)
