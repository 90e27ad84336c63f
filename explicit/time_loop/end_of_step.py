"""Settling a step: the forces it has brought, what is recorded of it, and the support's answer."""

from functools import cache
from typing import Any

import warp as wp

from explicit.outcome import Outcome
from explicit.precision import Precision
from explicit.time_loop.boundary import BAR_HISTORY, BoundaryFunctions
from explicit.time_loop.lanes import lane_functions
from explicit.time_loop.record import RecordFunctions
from explicit.time_loop.slots import (
    DAMPING,
    ELASTIC,
    FAULT,
    FORCE_DUE,
    FORCE_FLYER,
    FORCE_SUPPORT,
    FRICTION,
    GOING,
    HOURGLASS,
    IMPULSE_FLYER,
    IMPULSE_SUPPORT,
    INTERVAL,
    KINETIC,
    LANDING,
    LEDGER,
    LOWER_NEXT,
    LOWER_SPEED,
    MOST,
    MOST_STRAINED,
    NEXT_FORCE,
    NEXT_SURFACE,
    NO_TIME,
    PAST,
    PAST_DATA,
    PER_INTERVAL,
    PLAN,
    PLANS,
    RECORDED,
    RESTRAINT,
    STATUS,
    STEP,
    STEP_BEFORE,
    STEPS,
    SURFACE_DUE,
    TIME,
    VISCOUS,
    VOID,
    WORK,
)
from explicit.time_loop.structs import Structs


@cache
def end_of_step_function(
    precision: Precision, structs: Structs, boundary: BoundaryFunctions, record: RecordFunctions
) -> Any:
    """Generate ``settle(body, batch, state, output, sample, lane, step, clock, parts, push_lower, push_upper,
    carried, u_r, u_y, v_r, v_y)``: what a step has brought."""
    real = precision.real
    Body, Batch, State, Output = structs.Body, structs.Batch, structs.State, structs.Output
    platen_position, returned_wave = boundary.platen_position, boundary.returned_wave
    is_due, record_force = record.is_due, record.force
    record_positions, record_ledger = record.positions, record.ledger
    lanes = lane_functions()
    control_sync, get_total, get_largest = lanes.control_sync, lanes.get_total, lanes.get_largest
    boundary_totals, is_writer = lanes.boundary_totals, lanes.is_writer
    ZERO, HALF, ONE, TWO = wp.float64(0.0), wp.float64(0.5), wp.float64(1.0), wp.float64(2.0)
    NEVER, RIGID = wp.float64(NO_TIME), wp.float64(1.0e30)
    diverged = int(Outcome.DIVERGED)
    history, twice = int(BAR_HISTORY), int(2 * BAR_HISTORY)

    @wp.func
    def settle(
        body: Body,
        batch: Batch,
        state: State,
        output: Output,
        sample: int,
        lane: int,
        step: int,
        clock: wp.array(dtype=wp.float64),
        parts: wp.array(dtype=wp.float64),
        push_lower: wp.array(dtype=wp.float64),
        push_upper: wp.array(dtype=wp.float64),
        carried: wp.array(dtype=wp.float64),
        u_r: wp.array(dtype=real),
        u_y: wp.array(dtype=real),
        v_r: wp.array(dtype=real),
        v_y: wp.array(dtype=real),
    ):
        """What a step has brought: forces, records, the support's answer."""
        this, following_plan = PLANS + PLAN * (step % 2), PLANS + PLAN * ((step + 1) % 2)
        time, dt = wp.float64(clock[TIME]), wp.float64(clock[this + STEP])
        dt_before = wp.float64(clock[this + STEP_BEFORE])
        interval, fault = wp.float64(clock[this + INTERVAL]), int(clock[FAULT])
        lower_next, lower_speed = wp.float64(clock[LOWER_NEXT]), wp.float64(clock[LOWER_SPEED])
        impulse = wp.vec2d(clock[IMPULSE_FLYER], clock[IMPULSE_SUPPORT])
        force_due, surface_due = wp.float64(clock[FORCE_DUE]), wp.float64(clock[SURFACE_DUE])
        dt_next = wp.float64(clock[following_plan + STEP])
        # Compression-positive forces at `time`: the flyer pushes down, the support pushes up.
        pushes = boundary_totals(push_upper, push_lower, body.n_boundary) * wp.float64(
            clock[this + PER_INTERVAL]
        )
        force = wp.vec2d(-pushes[0], pushes[1])
        following = time + dt
        if clock[VOID] > ZERO:  # it began where something had gone wrong already
            control_sync()
        elif wp.isfinite(force[0]) and wp.isfinite(force[1]):
            if force_due <= time:
                force_before = wp.vec2d(clock[FORCE_FLYER], clock[FORCE_SUPPORT])
                next_force = int(clock[NEXT_FORCE])
                while force_due <= time:
                    blend = wp.float64(1.0)
                    if dt_before > ZERO:
                        blend = (force_due - (time - dt_before)) / dt_before
                    value = force_before + blend * (force - force_before)
                    # `impulse` is known half a step behind `time`; the force holds over its interval.
                    since = force_due - (time - HALF * dt_before)
                    sofar = impulse + force * since
                    if since < ZERO:
                        sofar = impulse + force_before * since
                    if is_writer(lane) == 1:
                        record_force(output, sample, next_force, value, sofar)
                    next_force += 1
                    force_due = wp.float64(NEVER)
                    if next_force < output.force_times.shape[0]:
                        force_due = wp.float64(output.force_times[next_force])
                control_sync()
                clock[NEXT_FORCE] = wp.float64(next_force)
                clock[FORCE_DUE] = force_due
            if surface_due <= following:
                next_surface, n_surface = int(clock[NEXT_SURFACE]), output.surface_times.shape[0]
                past_data, most_strained = wp.float64(clock[PAST_DATA]), wp.float64(clock[MOST_STRAINED])
                if int(clock[this + LEDGER]) == 1:
                    past_data = wp.max(past_data, get_total(parts, PAST))
                    most_strained = wp.max(most_strained, get_largest(parts, MOST))
                while surface_due <= following:
                    back = real(following - surface_due)
                    record_positions(body, output, sample, lane, next_surface, back, u_r, u_y, v_r, v_y)
                    if is_due(next_surface, n_surface, batch.ledger_every):
                        external, moving = get_total(parts, WORK), get_total(parts, KINETIC)
                        stored, held = get_total(parts, ELASTIC), get_total(parts, HOURGLASS)
                        damping, rubbing = get_total(parts, DAMPING), get_total(parts, FRICTION)
                        landing, restraint = get_total(parts, LANDING), get_total(parts, RESTRAINT)
                        branches = get_total(parts, VISCOUS)
                        if is_writer(lane) == 1:
                            record_ledger(
                                output, sample, next_surface,
                                external, moving, stored, held, damping, rubbing, landing, restraint,
                                branches,
                            )  # fmt: skip
                    next_surface += 1
                    surface_due = wp.float64(NEVER)
                    if next_surface < n_surface:
                        surface_due = wp.float64(output.surface_times[next_surface])
                control_sync()
                clock[NEXT_SURFACE] = wp.float64(next_surface)
                clock[SURFACE_DUE] = surface_due
                clock[PAST_DATA] = past_data
                clock[MOST_STRAINED] = most_strained
            # The support answers the force it just felt: v = F / Z + 2 h, away from the specimen. The
            # mass it carries answers with it: a light bar would overshoot one step later without it.
            if batch.impedance < RIGID:
                recorded = int(clock[RECORDED])
                returned = wp.float64(0.0)
                elapsed = following - batch.start
                if batch.round_trip < RIGID:
                    returned = returned_wave(state, sample, elapsed, batch.round_trip)
                inertia = boundary_totals(carried, carried, body.n_boundary)[0] / (interval * batch.impedance)
                answer = -(force[1] / batch.impedance + TWO * returned)
                lower_speed = (inertia * lower_speed + answer) / (ONE + inertia)
                control_sync()
                if batch.round_trip < RIGID:
                    outgoing = -lower_speed - returned
                    while wp.float64(recorded) * batch.round_trip / wp.float64(history) <= elapsed:
                        if is_writer(lane) == 1:
                            state.bar_wave[sample, recorded % twice] = outgoing
                        recorded += 1
                clock[RECORDED] = wp.float64(recorded)
            if batch.support_moves == 1:
                planned = platen_position(batch, batch.support_motion[sample], following + dt_next)
                lower_speed = (planned - lower_next) / dt_next
            control_sync()
            impulse += force * interval
            clock[IMPULSE_FLYER] = impulse[0]
            clock[IMPULSE_SUPPORT] = impulse[1]
            clock[FORCE_FLYER] = force[0]
            clock[FORCE_SUPPORT] = force[1]
            clock[LOWER_SPEED] = lower_speed
            clock[LOWER_NEXT] = lower_next + lower_speed * dt_next
            clock[TIME] = following
            clock[STEPS] = wp.float64(step + 1)
        else:
            control_sync()
            fault = diverged
        if fault != 0:
            clock[STATUS] = wp.float64(fault)
            clock[GOING] = ZERO
        if force_due >= NEVER and surface_due >= NEVER:  # nothing is left to record
            clock[STATUS] = ZERO
            clock[GOING] = ZERO

    return settle
