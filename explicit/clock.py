"""The clock of a simulation: what happens once a step, whatever the number of walkers.

While the walkers sweep the elements at one time, the clock is tended: the step before is settled (forces,
records, the support's answer) and the next one planned (its size, where the platens will be). On a GPU a
warp of its own does so, and the walkers read the result from shared memory.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any

import warp as wp

from explicit.boundary import BAR_HISTORY, BoundaryFunctions
from explicit.elements.base import INVERTED
from explicit.failure import MOTION_LIMIT, WATCH_EVERY
from explicit.lanes import lane_functions
from explicit.outcome import Outcome
from explicit.precision import Precision
from explicit.record import RecordFunctions
from explicit.structs import Structs

TIME, STATUS, GOING, STEPS, SMALLEST_STEP, FIRST_STEP, PAST_DATA, MOST_STRAINED = range(8)
FORCE_FLYER, FORCE_SUPPORT, IMPULSE_FLYER, IMPULSE_SUPPORT = range(8, 12)
LOWER_NEXT, LOWER_SPEED, RECORDED = range(12, 15)
NEXT_FORCE, FORCE_DUE, NEXT_SURFACE, SURFACE_DUE, COMING, COMING_DUE = range(15, 21)
FAULT, VOID, MOST_WORK, PLANS = range(21, 25)
STEP, STEP_BEFORE, INTERVAL, PER_INTERVAL, RATE, FLYER_NEXT, UPPER_SPEED, LEDGER, PLAN = range(9)
CLOCK = PLANS + 2 * PLAN
"""Numbers on the clock; those above say which is which. The plan of a step has its own, at `PLANS` for even
steps and behind them for odd ones, because the next one is made while a plan is carried out. Times and steps
[s], rate [1/s], displacements [m], speeds [m/s], forces [N], impulses [N s]; counters are exact in fp64."""

ELASTIC, HOURGLASS, KINETIC, WORK, DAMPING, FRICTION, LANDING, RESTRAINT, PAST, MOST = range(10)
MOTION, WORK_DONE, TURNED, BEYOND, STIFFEST = range(10, 15)
"""What the walkers hand over: totals for the ledger; what the clock watches; twice, in turn, the largest
omega^2."""
HANDED = 16
"""How many numbers they hand over."""

NO_TIME = 1.0e300
"""Time [s] of a record that never comes."""


@dataclass(frozen=True)
class ClockFunctions:
    """The clock's functions."""

    start: Any
    """``start(batch, output, sample, clock)``: the clock at rest."""
    settle: Any
    """``settle(body, batch, state, output, sample, lane, step, clock, parts, push_lower, push_upper, carried,
    u_r, u_y, v_r, v_y)``: what a step has brought."""
    depart: Any
    """``depart(clock)``: the first step begins, if it can be taken."""
    look: Any
    """``look(batch, sample, clock, parts)``: the outcome of a failure that the walkers' totals show, or 0."""
    plan: Any
    """``plan(batch, output, sample, step, clock, parts)``: a step to come."""


@cache
def clock_functions(
    precision: Precision, structs: Structs, boundary: BoundaryFunctions, record: RecordFunctions
) -> ClockFunctions:
    """Generate the clock's functions."""
    real = precision.real
    Body, Batch, State, Output = structs.Body, structs.Batch, structs.State, structs.Output
    platen_position, returned_wave = boundary.platen_position, boundary.returned_wave
    is_due, record_force = record.is_due, record.force
    record_positions, record_ledger = record.positions, record.ledger
    lanes = lane_functions()
    all_read, get_total, get_largest = lanes.all_read, lanes.get_total, lanes.get_largest
    seat_totals, alone = lanes.seat_totals, lanes.alone
    ZERO, HALF, ONE, TWO = wp.float64(0.0), wp.float64(0.5), wp.float64(1.0), wp.float64(2.0)
    NEVER, RIGID = wp.float64(NO_TIME), wp.float64(1.0e30)
    inverted = wp.float64(INVERTED * 0.5)
    watch_every, motion_limit = int(WATCH_EVERY), wp.float64(MOTION_LIMIT)
    diverged, turned, exceeded = (
        int(Outcome.DIVERGED),
        int(Outcome.INVERTED),
        int(Outcome.TABLE_EXCEEDED),
    )
    collapsed, limit = int(Outcome.STEP_COLLAPSED), int(Outcome.STEP_LIMIT)
    history, twice = int(BAR_HISTORY), int(2 * BAR_HISTORY)

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
        pushes = seat_totals(push_upper, push_lower, body.n_seats) * wp.float64(clock[this + PER_INTERVAL])
        force = wp.vec2d(-pushes[0], pushes[1])
        following = time + dt
        if clock[VOID] > ZERO:  # it began where something had gone wrong already
            all_read()
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
                    if alone(lane) == 1:
                        record_force(output, sample, next_force, value, sofar)
                    next_force += 1
                    force_due = wp.float64(NEVER)
                    if next_force < output.force_times.shape[0]:
                        force_due = wp.float64(output.force_times[next_force])
                all_read()
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
                        if alone(lane) == 1:
                            record_ledger(
                                output, sample, next_surface,
                                external, moving, stored, held, damping, rubbing, landing, restraint,
                            )  # fmt: skip
                    next_surface += 1
                    surface_due = wp.float64(NEVER)
                    if next_surface < n_surface:
                        surface_due = wp.float64(output.surface_times[next_surface])
                all_read()
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
                inertia = seat_totals(carried, carried, body.n_seats)[0] / (interval * batch.impedance)
                answer = -(force[1] / batch.impedance + TWO * returned)
                lower_speed = (inertia * lower_speed + answer) / (ONE + inertia)
                all_read()
                if batch.round_trip < RIGID:
                    outgoing = -lower_speed - returned
                    while wp.float64(recorded) * batch.round_trip / wp.float64(history) <= elapsed:
                        if alone(lane) == 1:
                            state.bar_wave[sample, recorded % twice] = outgoing
                        recorded += 1
                clock[RECORDED] = wp.float64(recorded)
            if batch.support_moves == 1:
                planned = platen_position(batch, batch.support_motion[sample], following + dt_next)
                lower_speed = (planned - lower_next) / dt_next
            all_read()
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
            all_read()
            fault = diverged
        if fault != 0:
            clock[STATUS] = wp.float64(fault)
            clock[GOING] = ZERO
        if force_due >= NEVER and surface_due >= NEVER:  # nothing is left to record
            clock[STATUS] = ZERO
            clock[GOING] = ZERO

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
        """The outcome of a failure that the walkers' totals show, or 0."""
        most_work = wp.max(wp.float64(clock[MOST_WORK]), get_total(parts, WORK_DONE))
        all_read()
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
        all_read()
        # The bound was measured one step ago, where the specimen stood before the step that is under way.
        if step % batch.measure_every == 0:
            omega_squared = get_largest(parts, STIFFEST + step % 2)
            dt = wp.min(batch.safety * TWO / wp.sqrt(omega_squared), batch.largest_step)
            rate = ONE / dt
            if step == 0:
                clock[FIRST_STEP] = dt
            all_read()
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
            all_read()
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

    return ClockFunctions(start, settle, depart, look, plan)
