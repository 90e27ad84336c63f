"""The control warp's part of a step: its end, the records, and the next step.

At the end of a step it sums the forces and computes the support's motion. Then it writes the histories. It
computes the size of the next step and the platens' positions, and accepts or rejects the step.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any

import warp as wp

from explicit.elements.base import INVERTED
from explicit.layout.lanes import LaneFunctions
from explicit.layout.state import StateLayout
from explicit.layout.structs import (
    CONTROL_SIZE,
    NO_TIME,
    Control,
    Ending,
    Plan,
    Structs,
    Total,
    simulation_structs,
)
from explicit.precision import Precision
from explicit.response import Outcome
from explicit.time_loop.element_sweeps import CHECK_EVERY, MOTION_LIMIT
from explicit.time_loop.node_sweeps import BAR_HISTORY, BoundaryFunctions


@dataclass(frozen=True)
class RecordFunctions:
    """Recorders of the time loop."""

    is_due: Any
    """``is_due(row, n, every)``: whether the energies are recorded at a surface time."""
    force: Any
    """``force(output, sample, row, value, sofar)``: record forces [N] and impulses [N s] of the flyer's and
    the transmission platen."""
    positions: Any
    """``positions(body, output, sample, lane, row, late, fields)``: record the positions of the nodes at a
    time `late` [s] before they reached `u` with the velocity `v`."""
    put_stored: Any
    """``put_stored(partials, elastic, hourglass, viscous, past, most)``: the workers pass the elements'
    energies to the control warp."""
    put_exchanged: Any
    """``put_exchanged(partials, kinetic, external, damping, friction, impact, hourglass_damping)``: the same
    for the energies that the node sweeps have summed."""
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
        body: Body, output: Output, sample: int, lane: int, row: int, late: real, fields: Fields
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


@dataclass(frozen=True)
class NextStepFunctions:
    """Planning of the steps, from the initial state to the last check. All functions except `read` are for
    the control warp."""

    start: Any
    """``start(batch, output, sample, control)``: set the control record to the initial state."""
    first_step: Any
    """``first_step(control)``: begin the first step, or end the simulation if its plan has failed."""
    check: Any
    """``check(batch, sample, control, partials)``: the outcome of a failure that the workers' totals
    indicate, or 0."""
    next_step: Any
    """``next_step(batch, output, sample, step, measured, control, partials)``: plan the given step, with a
    new size if the bound was `measured`."""
    read: Any
    """``read(control, step) -> Step``: the plan of the current step, for every lane."""
    reload_step: Any
    """``reload_step(planned, control, step) -> Step``: read the plan after synchronisation. The record has
    then arrived from the other block."""
    keep_step: Any
    """``keep_step(planned, control, step) -> Step``: the plan that was read before."""


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
        platen = platen_position(batch, batch.motion[sample], batch.start)
        control[Control.PLANS + Plan.SIZE + Plan.FLYER_NEXT] = platen
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
        batch: Batch, sample: int, control: wp.array(dtype=wp.float64), partials: wp.array(dtype=wp.float64)
    ):
        most_work = wp.max(wp.float64(control[Control.MOST_WORK]), get_total(partials, Total.WORK_DONE))
        control_sync()
        control[Control.MOST_WORK] = most_work
        allowed = motion_limit * most_work + batch.stray_energy[sample]
        fault = int(0)
        if not (get_total(partials, Total.MOTION) <= allowed):  # also true for NaN
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
        # The bound was measured one step ago, in the configuration before the current step.
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
        interval = HALF * (dt + dt_before)  # velocities are defined between the positions
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
    def reload_step(planned: Step, control: wp.array(dtype=wp.float64), step: int):
        return read(control, step)

    @wp.func
    def keep_step(planned: Step, control: wp.array(dtype=wp.float64), step: int):
        return planned

    return NextStepFunctions(start, first_step, check, next_step, read, reload_step, keep_step)


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
                # `impulse` is known up to half a step before `time`; the force is constant over its interval.
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
                    stored, hourglass = (
                        get_total(partials, Total.ELASTIC),
                        get_total(partials, Total.HOURGLASS),
                    )
                    damping = get_total(partials, Total.DAMPING)
                    rubbing = get_total(partials, Total.FRICTION)
                    landing = get_total(partials, Total.LANDING)
                    restraint = get_total(partials, Total.RESTRAINT)
                    branches = get_total(partials, Total.VISCOUS)
                    if is_writer(lane) == 1:
                        record_ledger(
                            output, sample, row,
                            external, moving, stored, hourglass, damping, rubbing, landing,
                            restraint, branches,
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
        """Speed of the support under the force of this step: v = F / Z + 2 h, away from the specimen.

        It includes the inertia of the mass that the support carries. Without it the speed of a light bar
        would overshoot one step later.
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
        if control[Control.VOID] > ZERO:  # it began after a failure
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
        # There are no more records.
        if control[Control.FORCE_DUE] >= NEVER and control[Control.SURFACE_DUE] >= NEVER:
            control[Control.STATUS] = ZERO
            control[Control.GOING] = ZERO

    return end_of_step
