"""The time loop of one simulation, whole, inside one kernel: central differences with kinematic contact.

One launch index is one simulation; its `lane`s share the elements and nodes (one lane on the CPU, one
block of threads on a GPU). Corner forces are stored per element and gathered per node in a fixed order,
so a result is bitwise repeatable, and every simulation has its own clock, step and end.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any

import warp as wp

from explicit.boundary import BAR_HISTORY, LOWER, UPPER, boundary_functions
from explicit.elements import ElementFunctions
from explicit.elements import element as element_named
from explicit.elements.base import INVERTED
from explicit.lanes import field_function, lane_functions
from explicit.outcome import Outcome
from explicit.precision import PRECISIONS, Precision
from explicit.record import record_functions
from explicit.structs import Structs, batch_structs
from explicit.sweeps import sweep_functions


@dataclass(frozen=True)
class MarchKernel:
    """A generated time loop with the structs its arguments have."""

    kernel: Any
    """The Warp kernel; launch with dim = (n_samples, n_lanes)."""
    structs: Structs
    """Types of its arguments."""
    element: ElementFunctions
    """The element it sweeps, with the types of one element's and one sample's constants."""


@cache
def march_kernel(
    law: type, faces: str, side: str, precision: Precision, element_name: str = "one_point"
) -> MarchKernel:
    """Generate the time loop for a material law, two contact laws, a precision and an element."""
    element = element_named(element_name).functions(law, precision)
    structs = batch_structs(precision, element.Shape, element.Solid)
    sweeps = sweep_functions(precision, element, structs)
    boundary = boundary_functions(faces, side, precision, structs)
    lanes = lane_functions()
    real, vec2 = precision.real, precision.vec2
    Body, Batch, State, Output = structs.Body, structs.Batch, structs.State, structs.Output
    sweep_elements, sweep_energies = sweeps.elements, sweeps.energies
    flyer_position, returned_wave, meet = boundary.flyer_position, boundary.returned_wave, boundary.meet
    record = record_functions(precision, structs)
    is_due, record_force = record.is_due, record.force
    record_positions, record_ledger = record.positions, record.ledger
    sync, total, largest = lanes.sync, lanes.total, lanes.largest
    empty_sum, add_to = lanes.empty_sum, lanes.add_to
    ordered_first, ordered_step = lanes.ordered_first, lanes.ordered_step
    ordered_total = lanes.ordered_total
    field, field64 = field_function(precision), field_function(PRECISIONS["fp64"], seats=True)
    zero, half = real(0.0), real(0.5)
    ZERO, HALF, TWO = wp.float64(0.0), wp.float64(0.5), wp.float64(2.0)
    inverted = wp.float64(INVERTED * 0.5)
    lower, upper = int(LOWER), int(UPPER)
    diverged, turned = int(Outcome.DIVERGED), int(Outcome.INVERTED)
    collapsed, limit = int(Outcome.STEP_COLLAPSED), int(Outcome.STEP_LIMIT)
    history, twice = int(BAR_HISTORY), int(2 * BAR_HISTORY)

    @wp.kernel(module="unique", enable_backward=False)
    def march(body: Body, batch: Batch, state: State, output: Output, first: int):
        index, lane = wp.tid()
        sample = first + index
        n_force, n_surface = output.force_times.shape[0], output.surface_times.shape[0]
        solid = batch.solids[sample]
        friction = batch.friction[sample]
        nodes, chip = body.n_nodes, body.on_chip
        u_r, u_y = field(state.u_r, sample, chip, 0), field(state.u_y, sample, chip, nodes)
        v_r, v_y = field(state.v_r, sample, chip, 2 * nodes), field(state.v_y, sample, chip, 3 * nodes)
        corner_r = field(state.corner_r, sample, chip, 4 * nodes)
        corner_y = field(state.corner_y, sample, chip, 4 * nodes + 4 * body.n_elements)
        push_lower = field64(state.push_lower, sample, chip, 0)
        push_upper = field64(state.push_upper, sample, chip, body.n_seats)
        carried = field64(state.carried, sample, chip, 2 * body.n_seats)
        rest = lane
        while rest < body.n_nodes:
            u_r[rest] = zero
            u_y[rest] = zero
            v_r[rest] = zero
            v_y[rest] = zero
            rest += wp.block_dim()
        sync()
        time, dt, dt_before = wp.float64(batch.start), wp.float64(0.0), wp.float64(0.0)
        next_force, next_surface, step, status = int(0), int(0), int(0), int(0)
        first_step, smallest = wp.float64(0.0), wp.float64(batch.largest_step)
        lower_y, lower_before = wp.float64(0.0), wp.float64(0.0)
        force_before = wp.vec2d()
        impulse = wp.vec2d()
        recorded_bar = int(0)
        damped, rubbed, restrained = empty_sum(), empty_sum(), empty_sum()
        landed, worked = empty_sum(), empty_sum()
        past_data, most_strained, latched = wp.float64(0.0), wp.float64(0.0), wp.float64(0.0)

        while status == 0 and (next_force < n_force or next_surface < n_surface):
            measure = int(0)
            if step % batch.measure_every == 0:
                measure = 1
            worst, power, artificial = sweep_elements(body, batch, state, sample, lane, measure)
            latched = wp.max(latched, worst)  # an element that turns between two measurements stays known
            if measure == 1:
                omega_squared = largest(latched)
                latched = wp.float64(0.0)
                dt = wp.min(batch.safety * TWO / wp.sqrt(omega_squared), batch.largest_step)
                if step == 0:
                    first_step = dt
                if omega_squared >= inverted:
                    status = turned
                elif dt < batch.floor * first_step:
                    status = collapsed
                elif not wp.isfinite(omega_squared):
                    status = diverged
            if step >= batch.max_steps:
                status = limit
            sync()
            # The velocity lives between the positions: the first interval is half a step from rest.
            interval = HALF * (dt + dt_before)
            flyer_now = flyer_position(batch, sample, time)
            flyer_next = flyer_position(batch, sample, time + dt)
            lower_next = lower_y + lower_before * dt
            upper_speed = -(flyer_next - flyer_now) / dt
            flush, ledger, coming = int(0), int(0), int(next_surface)
            while coming < n_surface and output.surface_times[coming] <= time + dt:
                flush = 1
                if is_due(coming, n_surface, batch.ledger_every):
                    ledger = 1
                coming += 1
            elastic, hourglass, past, kinetic = empty_sum(), empty_sum(), empty_sum(), empty_sum()
            most = wp.float64(0.0)
            if ledger == 1:
                elastic, hourglass, past, most = sweep_energies(body, batch, state, sample, lane)
                sync()  # the node sweep below moves what other lanes may still be reading
            # Half of this step's work belongs to the time of the positions, half to what follows.
            damp_step, rub_step = power * interval, empty_sum()
            hold_step = artificial * interval
            land_step, work_step = empty_sum(), empty_sum()
            h, tau = real(dt), real(interval)
            n = lane
            while n < body.n_nodes:
                f_r, f_y = real(0.0), real(0.0)
                for c in range(body.first_corner[n], body.first_corner[n + 1]):
                    corner = body.corners[c]
                    f_r += corner_r[corner]
                    f_y += corner_y[corner]
                mass = body.mass[n]
                old = vec2(v_r[n], v_y[n])
                # Forces resist, so they enter with a minus; the drag of alpha acts on the old velocity.
                free = old - tau * (vec2(f_r, f_y) * body.inverse_mass[n] + solid.mass_damping * old)
                if body.on_axis[n] == 1:
                    free = vec2(zero, free[1])
                new = free
                kind = body.kind[n]
                if kind != 0:
                    height = body.reference_y[n] + wp.float64(u_y[n])
                    to_lower = real((lower_next - height) / dt)
                    to_upper = real((body.length - flyer_next - height) / dt)
                    new, platen, mark = meet(
                        kind, state.touched[sample, n], free, to_lower, to_upper, friction
                    )
                    state.touched[sample, n] = mark
                    # Impulses of the platen on the node, and where their work goes.
                    kick = wp.float64(mass) * wp.float64(new[1] - free[1])
                    rub = wp.float64(mass) * wp.float64(new[0] - free[0])
                    if body.on_axis[n] == 1:
                        rub = ZERO
                    from_below, from_above, riding = wp.float64(0.0), wp.float64(0.0), wp.float64(0.0)
                    speed = wp.float64(half * (old[1] + new[1]))
                    slide = wp.float64(half * (old[0] + new[0]))
                    if platen == lower:
                        from_below = kick
                        if new[1] == to_lower:
                            riding = wp.float64(mass)
                        land_step = add_to(land_step, kick * (lower_before - speed), n)
                        work_step = add_to(work_step, kick * lower_before, n)
                    elif platen == upper:
                        from_above = kick
                        land_step = add_to(land_step, kick * (upper_speed - speed), n)
                        work_step = add_to(work_step, kick * upper_speed, n)
                    rub_step = add_to(rub_step, -rub * slide, n)
                    seat = body.seat[n]
                    push_lower[seat] = from_below
                    push_upper[seat] = from_above
                    carried[seat] = riding
                if ledger == 1:
                    kinetic = add_to(kinetic, wp.float64(half * mass * wp.dot(old, new)), n)
                if solid.mass_damping > zero:
                    drag = tau * solid.mass_damping * mass * half * wp.dot(old, old + new)
                    damp_step = add_to(damp_step, wp.float64(drag), n)
                v_r[n] = new[0]
                v_y[n] = new[1]
                u_r[n] = u_r[n] + h * new[0]
                u_y[n] = u_y[n] + h * new[1]
                n += wp.block_dim()
            sync()

            raised, lowered, loaded = wp.float64(0.0), wp.float64(0.0), wp.float64(0.0)
            b = ordered_first(lane)
            while b < body.n_seats:
                raised += push_lower[b]
                lowered += push_upper[b]
                loaded += carried[b]
                b += ordered_step()

            # Compression-positive forces at `time`: the flyer pushes down, the support pushes up.
            force = wp.vec2d(-ordered_total(lowered), ordered_total(raised)) / interval
            if not (wp.isfinite(force[0]) and wp.isfinite(force[1])):
                status = diverged
            if status == 0:
                while next_force < n_force and output.force_times[next_force] <= time:
                    requested = output.force_times[next_force]
                    blend = wp.float64(1.0)
                    if dt_before > ZERO:
                        blend = (requested - (time - dt_before)) / dt_before
                    value = force_before + blend * (force - force_before)
                    # `impulse` is known half a step behind `time`; the force holds over its interval.
                    since = requested - (time - HALF * dt_before)
                    sofar = impulse + force * since
                    if since < ZERO:
                        sofar = impulse + force_before * since
                    if lane == 0:
                        record_force(output, sample, next_force, value, sofar)
                    next_force += 1
                impulse += force * interval
                external, moving, stored, held = ZERO, ZERO, ZERO, ZERO
                damping, friction_loss, impact, restraint = ZERO, ZERO, ZERO, ZERO
                if ledger == 1:
                    stored, held, moving = total(elastic), total(hourglass), total(kinetic)
                    external = total(worked + HALF * work_step)
                    damping = total(damped + HALF * damp_step)
                    friction_loss = total(rubbed + HALF * rub_step)
                    impact = total(landed + HALF * land_step)
                    restraint = total(restrained + HALF * hold_step)
                    past_data = wp.max(past_data, total(past))
                    most_strained = wp.max(most_strained, largest(most))
                if flush == 1:
                    while next_surface < n_surface and output.surface_times[next_surface] <= time + dt:
                        back = real(time + dt - output.surface_times[next_surface])
                        record_positions(body, output, sample, lane, next_surface, back, u_r, u_y, v_r, v_y)
                        if lane == 0 and is_due(next_surface, n_surface, batch.ledger_every):
                            record_ledger(
                                output, sample, next_surface,
                                external, moving, stored, held, damping, friction_loss, impact, restraint,
                            )  # fmt: skip
                        next_surface += 1
                worked += work_step
                damped += damp_step
                rubbed += rub_step
                restrained += hold_step
                landed += land_step
                force_before = force
                # The support answers the force it just felt: v = F / Z + 2 h, away from the specimen. The
                # mass it carries answers with it: a light bar would overshoot one step later without it.
                lower_y = lower_next
                if batch.impedance < wp.float64(1.0e30):
                    returned = wp.float64(0.0)
                    elapsed = time + dt - batch.start
                    if batch.round_trip < wp.float64(1.0e30):
                        returned = returned_wave(state, sample, elapsed, batch.round_trip)
                    inertia = ordered_total(loaded) / (interval * batch.impedance)
                    answer = -(force[1] / batch.impedance + TWO * returned)
                    lower_before = (inertia * lower_before + answer) / (wp.float64(1.0) + inertia)
                    if batch.round_trip < wp.float64(1.0e30):
                        outgoing = -lower_before - returned
                        while wp.float64(recorded_bar) * batch.round_trip / wp.float64(history) <= elapsed:
                            if lane == 0:
                                state.bar_wave[sample, recorded_bar % twice] = outgoing
                            recorded_bar += 1
                time += dt
                dt_before = dt
                smallest = wp.min(smallest, dt)
                step += 1
        if lane == 0:
            output.outcome[sample] = status
            output.steps[sample] = step
            output.end_time[sample] = time
            output.smallest_step[sample] = smallest
            output.past_data[sample] = past_data
            output.strain_measure[sample] = most_strained

    return MarchKernel(march, structs, element)
