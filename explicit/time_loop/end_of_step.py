"""The end of a step: the forces it has brought, what is recorded of it, and the support's answer."""

from functools import cache
from typing import Any

import warp as wp

from explicit.outcome import Outcome
from explicit.precision import Precision
from explicit.time_loop.boundary import BAR_HISTORY, BoundaryFunctions
from explicit.time_loop.lanes import LaneFunctions
from explicit.time_loop.record import RecordFunctions
from explicit.time_loop.slots import NO_TIME, Control, Plan, Total
from explicit.time_loop.structs import Structs, simulation_structs


@cache
def end_of_step_function(
    precision: Precision,
    structs: Structs,
    boundary: BoundaryFunctions,
    record: RecordFunctions,
    lanes: LaneFunctions,
) -> Any:
    """Generate ``end_of_step(body, batch, state, output, sample, lane, step, control, partials, surface,
    fields)``, for the control warp."""
    real = precision.real
    Body, Batch, State, Output = structs.Body, structs.Batch, structs.State, structs.Output
    simulation = simulation_structs(precision)
    Fields, Surface = simulation.Fields, simulation.Surface
    platen_position, returned_wave = boundary.platen_position, boundary.returned_wave
    is_due, record_force = record.is_due, record.force
    record_positions, record_ledger = record.positions, record.ledger
    control_sync, get_total, get_largest = lanes.control_sync, lanes.get_total, lanes.get_largest
    boundary_totals, is_writer = lanes.boundary_totals, lanes.is_writer
    ZERO, HALF, ONE, TWO = wp.float64(0.0), wp.float64(0.5), wp.float64(1.0), wp.float64(2.0)
    NEVER, RIGID = wp.float64(NO_TIME), wp.float64(1.0e30)
    diverged = int(Outcome.DIVERGED)
    history, twice = int(BAR_HISTORY), int(2 * BAR_HISTORY)

    @wp.func
    def record_forces(
        output: Output,
        sample: int,
        lane: int,
        control: wp.array(dtype=wp.float64),
        time: wp.float64,
        dt_before: wp.float64,
        force: wp.vec2d,
    ):
        """Forces and impulses at the requested times up to `time`."""
        due = wp.float64(control[Control.FORCE_DUE])
        if due <= time:
            impulse = wp.vec2d(control[Control.IMPULSE_FLYER], control[Control.IMPULSE_SUPPORT])
            force_before = wp.vec2d(control[Control.FORCE_FLYER], control[Control.FORCE_SUPPORT])
            row = int(control[Control.NEXT_FORCE])
            while due <= time:
                blend = wp.float64(1.0)
                if dt_before > ZERO:
                    blend = (due - (time - dt_before)) / dt_before
                value = force_before + blend * (force - force_before)
                # `impulse` is known half a step behind `time`; the force holds over its interval.
                since = due - (time - HALF * dt_before)
                sofar = impulse + force * since
                if since < ZERO:
                    sofar = impulse + force_before * since
                if is_writer(lane) == 1:
                    record_force(output, sample, row, value, sofar)
                row += 1
                due = wp.float64(NEVER)
                if row < output.force_times.shape[0]:
                    due = wp.float64(output.force_times[row])
            control_sync()
            control[Control.NEXT_FORCE] = wp.float64(row)
            control[Control.FORCE_DUE] = due

    @wp.func
    def record_surface(
        body: Body,
        batch: Batch,
        output: Output,
        sample: int,
        lane: int,
        control: wp.array(dtype=wp.float64),
        partials: wp.array(dtype=wp.float64),
        fields: Fields,
        following: wp.float64,
        ledger: int,
    ):
        """Positions and energies at the requested times up to `following`."""
        due = wp.float64(control[Control.SURFACE_DUE])
        if due <= following:
            row, n_surface = int(control[Control.NEXT_SURFACE]), output.surface_times.shape[0]
            past_data = wp.float64(control[Control.PAST_DATA])
            most_strained = wp.float64(control[Control.MOST_STRAINED])
            if ledger == 1:
                past_data = wp.max(past_data, get_total(partials, Total.PAST))
                most_strained = wp.max(most_strained, get_largest(partials, Total.MOST))
            while due <= following:
                back = real(following - due)
                record_positions(body, output, sample, lane, row, back, fields)
                if is_due(row, n_surface, batch.ledger_every):
                    external, moving = get_total(partials, Total.WORK), get_total(partials, Total.KINETIC)
                    stored, held = get_total(partials, Total.ELASTIC), get_total(partials, Total.HOURGLASS)
                    damping = get_total(partials, Total.DAMPING)
                    rubbing = get_total(partials, Total.FRICTION)
                    landing = get_total(partials, Total.LANDING)
                    restraint = get_total(partials, Total.RESTRAINT)
                    branches = get_total(partials, Total.VISCOUS)
                    if is_writer(lane) == 1:
                        record_ledger(
                            output, sample, row,
                            external, moving, stored, held, damping, rubbing, landing, restraint, branches,
                        )  # fmt: skip
                row += 1
                due = wp.float64(NEVER)
                if row < n_surface:
                    due = wp.float64(output.surface_times[row])
            control_sync()
            control[Control.NEXT_SURFACE] = wp.float64(row)
            control[Control.SURFACE_DUE] = due
            control[Control.PAST_DATA] = past_data
            control[Control.MOST_STRAINED] = most_strained

    @wp.func
    def bar_speed(
        body: Body,
        batch: Batch,
        state: State,
        sample: int,
        lane: int,
        control: wp.array(dtype=wp.float64),
        surface: Surface,
        push: wp.float64,
        speed: wp.float64,
        interval: wp.float64,
        elapsed: wp.float64,
    ):
        """The support's speed under the force it just felt: v = F / Z + 2 h, away from the specimen.

        The mass it carries answers with it: a light bar would overshoot one step later without it.
        """
        recorded = int(control[Control.RECORDED])
        returned = wp.float64(0.0)
        if batch.round_trip < RIGID:
            returned = returned_wave(state, sample, elapsed, batch.round_trip)
        carried = boundary_totals(surface.carried, surface.carried, body.n_boundary)[0]
        inertia = carried / (interval * batch.impedance)
        answer = -(push / batch.impedance + TWO * returned)
        new = (inertia * speed + answer) / (ONE + inertia)
        control_sync()
        if batch.round_trip < RIGID:
            outgoing = -new - returned
            while wp.float64(recorded) * batch.round_trip / wp.float64(history) <= elapsed:
                if is_writer(lane) == 1:
                    state.bar_wave[sample, recorded % twice] = outgoing
                recorded += 1
        control[Control.RECORDED] = wp.float64(recorded)
        return new

    @wp.func
    def end_of_step(
        body: Body,
        batch: Batch,
        state: State,
        output: Output,
        sample: int,
        lane: int,
        step: int,
        control: wp.array(dtype=wp.float64),
        partials: wp.array(dtype=wp.float64),
        surface: Surface,
        fields: Fields,
    ):
        this = Control.PLANS + Plan.SIZE * (step % 2)
        after = Control.PLANS + Plan.SIZE * ((step + 1) % 2)
        time, dt = wp.float64(control[Control.TIME]), wp.float64(control[this + Plan.STEP])
        dt_before = wp.float64(control[this + Plan.STEP_BEFORE])
        interval, fault = wp.float64(control[this + Plan.INTERVAL]), int(control[Control.FAULT])
        # Compression-positive forces at `time`: the flyer pushes down, the support pushes up.
        pushes = boundary_totals(surface.push_upper, surface.push_lower, body.n_boundary)
        pushes = pushes * wp.float64(control[this + Plan.PER_INTERVAL])
        force = wp.vec2d(-pushes[0], pushes[1])
        following = time + dt
        if control[Control.VOID] > ZERO:  # it began where something had gone wrong already
            control_sync()
        elif wp.isfinite(force[0]) and wp.isfinite(force[1]):
            record_forces(output, sample, lane, control, time, dt_before, force)
            record_surface(
                body, batch, output, sample, lane, control, partials, fields,
                following, int(control[this + Plan.LEDGER]),
            )  # fmt: skip
            lower_next = wp.float64(control[Control.LOWER_NEXT])
            lower_speed = wp.float64(control[Control.LOWER_SPEED])
            dt_next = wp.float64(control[after + Plan.STEP])
            if batch.impedance < RIGID:
                lower_speed = bar_speed(
                    body, batch, state, sample, lane, control, surface,
                    force[1], lower_speed, interval, following - batch.start,
                )  # fmt: skip
            if batch.support_moves == 1:
                planned = platen_position(batch, batch.support_motion[sample], following + dt_next)
                lower_speed = (planned - lower_next) / dt_next
            impulse = wp.vec2d(control[Control.IMPULSE_FLYER], control[Control.IMPULSE_SUPPORT])
            control_sync()
            impulse += force * interval
            control[Control.IMPULSE_FLYER] = impulse[0]
            control[Control.IMPULSE_SUPPORT] = impulse[1]
            control[Control.FORCE_FLYER] = force[0]
            control[Control.FORCE_SUPPORT] = force[1]
            control[Control.LOWER_SPEED] = lower_speed
            control[Control.LOWER_NEXT] = lower_next + lower_speed * dt_next
            control[Control.TIME] = following
            control[Control.STEPS] = wp.float64(step + 1)
        else:
            control_sync()
            fault = diverged
        if fault != 0:
            control[Control.STATUS] = wp.float64(fault)
            control[Control.GOING] = ZERO
        # Nothing is left to record.
        if control[Control.FORCE_DUE] >= NEVER and control[Control.SURFACE_DUE] >= NEVER:
            control[Control.STATUS] = ZERO
            control[Control.GOING] = ZERO

    return end_of_step
