"""The time loop of one simulation, whole, inside one kernel: central differences with kinematic contact.

One launch index is one simulation; its `lane`s share the elements and nodes (one lane on the CPU, one
block of threads on a GPU). Corner forces are stored per element and gathered per node in a fixed order,
so a result is bitwise repeatable, and every simulation has its own clock, step and end.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any

import warp as wp

from explicit.elements import ElementFunctions
from explicit.elements import element as element_named
from explicit.precision import Precision
from explicit.relaxation.base import Relaxation
from explicit.relaxation.kernels.branches import relaxation_functions
from explicit.time_loop.boundary import LOWER, UPPER, boundary_functions
from explicit.time_loop.element_sweeps import sweep_functions
from explicit.time_loop.end_of_step import end_of_step_function
from explicit.time_loop.failure import CHECK_EVERY, failure_functions
from explicit.time_loop.lanes import BLOCK, SHARING, SMALL_BLOCK, WARPS, lane_functions
from explicit.time_loop.next_step import next_step_functions
from explicit.time_loop.nodes import update_functions
from explicit.time_loop.record import record_functions
from explicit.time_loop.slots import (
    BEYOND,
    CLOCK,
    DAMPING,
    ELASTIC,
    END_TIME,
    ENDED_AS,
    FAILED_ELEMENT,
    FLYER_NEXT,
    FRICTION,
    GOING,
    HOURGLASS,
    INTERVAL,
    KINETIC,
    LANDING,
    LARGEST_S,
    LEAST_STEP,
    LEDGER,
    LOWER_NEXT,
    LOWER_SPEED,
    MOST,
    MOST_STRAINED,
    MOTION,
    N_TOTALS,
    PAST,
    PAST_DATA,
    PLAN,
    PLANS,
    RATE,
    RESTRAINT,
    SMALLEST_STEP,
    STATUS,
    STEP,
    STEPS,
    STEPS_TAKEN,
    STIFFER,
    STIFFEST,
    TIME,
    TURNED,
    UPPER_SPEED,
    VISCOUS,
    VOLUME_PAST_DATA,
    WORK,
    WORK_DONE,
)
from explicit.time_loop.state_layout import ON_CHIP_CONTROL, state_layout
from explicit.time_loop.structs import Structs, batch_structs


@dataclass(frozen=True)
class TimeLoopKernel:
    """A generated time loop with the structs its arguments have."""

    kernel: Any
    """The Warp kernel; launch with dim = (n_samples, n_lanes)."""
    structs: Structs
    """Types of its arguments."""
    element: ElementFunctions
    """The element it sweeps, with the types of one element's and one sample's constants."""
    block: int
    """Threads that share a simulation on a GPU."""
    memory: int
    """Numbers that an element remembers of what relaxes; 0 where nothing does."""


@cache
def time_loop_kernel(
    law: type,
    faces: str,
    side: str,
    precision: Precision,
    element_name: str = "one_point",
    on_chip: bool = False,
    block: int = BLOCK,
    bound: str = "trace",
    volumetric: str = "quadratic",
    relaxation: Relaxation | None = None,
) -> TimeLoopKernel:
    """Generate the time loop for a material law, two contact laws, a precision and an element.

    With `on_chip` a GPU keeps the state of a simulation in shared memory, where it must fit
    (`explicit.time_loop.state_layout.fits`). `block` is the number of threads it is compiled for there;
    `bound` is that of `explicit.model.Stepping`, `volumetric` that of `explicit.Model`, `relaxation` its
    `relaxation_kind`.
    """
    element = element_named(element_name).functions(law, precision, bound, volumetric)
    structs = batch_structs(precision, element.Shape, element.Solid)
    place = state_layout(precision, on_chip)
    field, sums, marks = place.field, place.sums, place.marks
    node_stride, corner_stride = place.node_stride, place.corner_stride
    sweeps = sweep_functions(precision, element, structs, place)
    sweep_elements = sweeps.elements
    branch = relaxation_functions(relaxation, law, precision, bound, element, structs, place, sweeps)
    relax, sweep_energies, remembered = branch.sweep, branch.energies, place.remembered
    boundary = boundary_functions(faces, side, precision, structs)
    meet = boundary.meet
    failure = failure_functions(precision, element, structs)
    motion, strain, culprit, watch_every = failure.motion, failure.strain, failure.culprit, int(CHECK_EVERY)
    update = update_functions(precision, structs)
    free_velocity, move = update.free_velocity, update.move
    kinetic_energy, drag_loss = update.kinetic, update.drag_loss
    record = record_functions(precision, structs)
    settle = end_of_step_function(precision, structs, boundary, record)
    planning = next_step_functions(structs, boundary, record)
    start, depart, look, plan = planning.start, planning.depart, planning.look, planning.plan
    lanes = lane_functions()
    sync, is_worker, is_control, n_workers = lanes.sync, lanes.is_worker, lanes.is_control, lanes.n_workers
    empty_sum, add_to, boundary_first = lanes.empty_sum, lanes.add_to, lanes.boundary_first
    first_inner, inner_stride = lanes.first_inner, lanes.inner_stride
    put_total, put_largest, get_largest = lanes.put_total, lanes.put_largest, lanes.get_largest
    real = precision.real
    Body, Batch, State, Output = structs.Body, structs.Batch, structs.State, structs.Output
    zero, half = real(0.0), real(0.5)
    ZERO, HALF = wp.float64(0.0), wp.float64(0.5)
    lower, upper = int(LOWER), int(UPPER)
    residents = SHARING if block <= SMALL_BLOCK else 1  # blocks that a multiprocessor must have registers for
    clock_places, parts_places = int(CLOCK), int(N_TOTALS * WARPS)

    @wp.kernel(module="unique", enable_backward=False, launch_bounds=(block, residents))
    def march(body: Body, batch: Batch, state: State, output: Output, first: int):
        index, lane = wp.tid()
        sample = first + index
        solid = batch.solids[sample]
        row = batch.rows[batch.material[sample]]
        branches = batch.branches[batch.relaxation[sample]]
        limit_s = batch.data_limit[batch.material[sample]]
        friction, alpha = batch.friction[sample], solid.mass_damping
        seats, nodes = body.n_boundary, node_stride(body.n_nodes)
        corners = 4 * corner_stride(body.n_elements) + 1
        u_r, u_y = field(state.u_r, sample, 0), field(state.u_y, sample, nodes)
        v_r, v_y = field(state.v_r, sample, 2 * nodes), field(state.v_y, sample, 3 * nodes)
        corner_r = field(state.corner_r, sample, 4 * nodes)
        corner_y = field(state.corner_y, sample, 4 * nodes + corners)
        clock, parts = sums(state.clock, sample, 0), sums(state.parts, sample, clock_places)
        push_lower = sums(state.push_lower, sample, ON_CHIP_CONTROL)
        push_upper = sums(state.push_upper, sample, ON_CHIP_CONTROL + seats)
        carried = sums(state.carried, sample, ON_CHIP_CONTROL + 2 * seats)
        touched = marks(state.touched, sample, 0)
        memory = remembered(state.memory, sample, 0)
        rest = lane
        while rest < body.n_nodes:
            u_r[rest] = zero
            u_y[rest] = zero
            v_r[rest] = zero
            v_y[rest] = zero
            rest += wp.block_dim()
        seat = lane
        while seat < body.n_boundary:
            touched[seat] = body.at_rest[seat]
            seat += wp.block_dim()
        part = lane
        while part < parts_places:  # the clerk's warp hands over no bound
            parts[part] = ZERO
            part += wp.block_dim()
        if lane == 0:  # nodes where fewer than four elements meet gather nothing from here
            corner_r[corners - 1] = zero
            corner_y[corners - 1] = zero
        if is_control(lane) == 1:
            start(batch, output, sample, clock)
        sync()
        damped, rubbed, restrained = empty_sum(), empty_sum(), empty_sum()
        landed, worked = empty_sum(), empty_sum()
        going, step, until_measured, latched = int(1), int(-1), int(0), wp.float64(0.0)

        while going == 1:  # before the first step the elements only say how large it may be
            # While the elements are swept, the step before is settled.
            power, artificial = empty_sum(), empty_sum()
            if is_worker(lane) == 1:
                measure = int(0)
                if until_measured == 0:
                    measure = 1
                    until_measured = batch.measure_every
                until_measured -= 1
                worst, power, artificial = sweep_elements(
                    body, solid, row, u_r, u_y, v_r, v_y, corner_r, corner_y, lane, measure
                )
                stiffer = relax(
                    body, solid, row, branches, memory, clock, step,
                    u_r, u_y, v_r, v_y, corner_r, corner_y, lane, measure,
                )  # fmt: skip
                latched = wp.max(latched, worst)  # an element that turns between two measurements stays known
                if step % watch_every == 0:
                    put_total(parts, MOTION, motion(body, v_r, v_y, lane))
                    put_total(parts, WORK_DONE, worked)
                    put_largest(parts, TURNED, latched)
                if batch.stop_past_data == 1:
                    put_largest(parts, BEYOND, strain(body, limit_s, u_r, u_y, lane))
                if measure == 1:
                    put_largest(parts, STIFFEST + (step + 1) % 2, latched)
                    put_largest(parts, STIFFER + (step + 1) % 2, stiffer)
                    latched = wp.float64(0.0)
            if is_control(lane) == 1 and step == 0:
                depart(clock)
            if is_control(lane) == 1 and step > 0:
                settle(
                    body, batch, state, output, sample, lane, step - 1, clock, parts,
                    push_lower, push_upper, carried, u_r, u_y, v_r, v_y,
                )  # fmt: skip
            sync()
            going = int(clock[GOING])
            if going == 1 and step >= 0:
                here = PLANS + PLAN * (step % 2)
                dt, interval, rate = clock[here + STEP], clock[here + INTERVAL], clock[here + RATE]
                flyer_next, upper_speed = clock[here + FLYER_NEXT], clock[here + UPPER_SPEED]
                lower_next, lower_speed = clock[LOWER_NEXT], clock[LOWER_SPEED]
                ledger = int(clock[here + LEDGER])
                elastic, hourglass, past, kinetic = empty_sum(), empty_sum(), empty_sum(), empty_sum()
                viscous = empty_sum()
                most = wp.float64(0.0)
                if ledger == 1:
                    if is_worker(lane) == 1:
                        elastic, hourglass, past, most, viscous = sweep_energies(
                            body, solid, row, limit_s, branches, memory, u_r, u_y, lane
                        )
                    sync()  # the node sweep below moves what other lanes may still be reading
                # Half of this step's work belongs to the time of the positions, half to what follows.
                damp_step, rub_step = power * interval, empty_sum()
                hold_step = artificial * interval
                land_step, work_step = empty_sum(), empty_sum()
                h, tau = real(dt), real(interval)

                if is_worker(lane) == 1:
                    n = first_inner(lane)
                    while n < body.n_inner:
                        old, new, mass = free_velocity(body, corner_r, corner_y, v_r, v_y, n, tau, alpha)
                        if ledger == 1:
                            kinetic = add_to(kinetic, kinetic_energy(mass, old, new), n)
                        if alpha > zero:
                            damp_step = add_to(damp_step, drag_loss(mass, old, new, tau, alpha), n)
                        move(u_r, u_y, v_r, v_y, n, new, h)
                        n += inner_stride()

                    b = boundary_first(lane)
                    while b < body.n_boundary:
                        node = body.first_boundary + b
                        old, free, mass = free_velocity(body, corner_r, corner_y, v_r, v_y, node, tau, alpha)
                        height = body.reference_y[node] + wp.float64(u_y[node])
                        to_lower = real((lower_next - height) * rate)
                        to_upper = real((body.length - flyer_next - height) * rate)
                        new, platen, mark = meet(
                            body, batch, state, sample, b,
                            body.kind[b], touched[b], free, to_lower, to_upper, friction, tau, h,
                        )  # fmt: skip
                        touched[b] = mark
                        # Impulses of the platen on the node, and where their work goes.
                        kick = wp.float64(mass) * wp.float64(new[1] - free[1])
                        rub = wp.float64(mass) * wp.float64(new[0] - free[0])
                        from_below, from_above, riding = wp.float64(0.0), wp.float64(0.0), wp.float64(0.0)
                        speed = wp.float64(half * (old[1] + new[1]))
                        slide = wp.float64(half * (old[0] + new[0]))
                        if platen == lower:
                            from_below = kick
                            if new[1] == to_lower:
                                riding = wp.float64(mass)
                            land_step = add_to(land_step, kick * (lower_speed - speed), b)
                            work_step = add_to(work_step, kick * lower_speed, b)
                        elif platen == upper:
                            from_above = kick
                            land_step = add_to(land_step, kick * (upper_speed - speed), b)
                            work_step = add_to(work_step, kick * upper_speed, b)
                        rub_step = add_to(rub_step, -rub * slide, b)
                        push_lower[b] = from_below
                        push_upper[b] = from_above
                        carried[b] = riding
                        if ledger == 1:
                            kinetic = add_to(kinetic, kinetic_energy(mass, old, new), b)
                        if alpha > zero:
                            damp_step = add_to(damp_step, drag_loss(mass, old, new, tau, alpha), b)
                        move(u_r, u_y, v_r, v_y, node, new, h)
                        b += n_workers()
                if ledger == 1:
                    put_total(parts, ELASTIC, elastic)
                    put_total(parts, HOURGLASS, hourglass)
                    put_total(parts, KINETIC, kinetic)
                    put_total(parts, WORK, worked + HALF * work_step)
                    put_total(parts, DAMPING, damped + HALF * damp_step)
                    put_total(parts, FRICTION, rubbed + HALF * rub_step)
                    put_total(parts, LANDING, landed + HALF * land_step)
                    put_total(parts, RESTRAINT, restrained + HALF * hold_step)
                    put_total(parts, PAST, past)
                    put_total(parts, VISCOUS, viscous)
                    put_largest(parts, MOST, most)
                worked += work_step
                damped += damp_step
                rubbed += rub_step
                restrained += hold_step
                landed += land_step
            if going == 1 and is_control(lane) == 1:
                plan(batch, output, sample, step + 1, clock, parts)
            step += 1
            sync()

        if int(clock[STATUS]) == 0:  # a last look at what happened since the one before
            if is_worker(lane) == 1:
                put_total(parts, MOTION, motion(body, v_r, v_y, lane))
                put_total(parts, WORK_DONE, worked)
                put_largest(parts, TURNED, latched)
            sync()
            if is_control(lane) == 1:
                clock[STATUS] = wp.float64(look(batch, sample, clock, parts))
        sync()
        failed = int(-1)
        if int(clock[STATUS]) != 0:
            score, place_of = culprit(body, solid, row, u_r, u_y, v_r, v_y, lane, int(clock[STATUS]))
            put_largest(parts, MOST, score)
            sync()
            candidate = wp.float64(-1.0e30)
            if score == get_largest(parts, MOST):
                candidate = -wp.float64(place_of)  # of equal ones the first
            put_largest(parts, TURNED, candidate)
            sync()
            failed = int(-get_largest(parts, TURNED))
        if lane == 0:
            output.ending[sample, ENDED_AS] = clock[STATUS]
            output.ending[sample, FAILED_ELEMENT] = wp.float64(failed)
            output.ending[sample, STEPS_TAKEN] = clock[STEPS]
            output.ending[sample, END_TIME] = clock[TIME]
            output.ending[sample, LEAST_STEP] = clock[SMALLEST_STEP]
            output.ending[sample, VOLUME_PAST_DATA] = clock[PAST_DATA]
            output.ending[sample, LARGEST_S] = clock[MOST_STRAINED]

    return TimeLoopKernel(march, structs, element, block, branch.memory)
