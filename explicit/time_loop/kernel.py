"""The complete time loop of one simulation inside one kernel: central differences with kinematic contact.

One launch index is one simulation. Its `lane`s share the elements and nodes (one lane on the CPU, one block
of threads on a GPU). Corner forces are stored per element and gathered per node in a fixed order. A result is
therefore bitwise repeatable. Every simulation has a separate time, step and end.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any

import warp as wp

from explicit.elements import ElementFunctions
from explicit.elements import element as element_named
from explicit.layout.lanes import BLOCK, SHARING, SMALL_BLOCK, lane_functions, lanes_of_chips
from explicit.layout.state import layout_on_chips, state_layout
from explicit.layout.structs import CONTROL_SIZE, Control, Share, Structs, Total, batch_structs
from explicit.precision import Precision
from explicit.relaxation.base import Relaxation
from explicit.time_loop.element_sweeps import (
    CHECK_EVERY,
    failure_functions,
    relaxation_functions,
    sweep_functions,
)
from explicit.time_loop.node_sweeps import boundary_functions, node_sweeps
from explicit.time_loop.steps import end_of_step_function, next_step_functions, record_functions


@dataclass(frozen=True)
class TimeLoopKernel:
    """A generated time loop and the struct types of its arguments."""

    kernel: Any
    """The Warp kernel; launch with dim = (n_samples, n_lanes)."""
    structs: Structs
    """Types of its arguments."""
    element: ElementFunctions
    """The element it sweeps, with the types of one element's and one sample's constants."""
    block: int
    """Threads of a block of a GPU."""
    cluster: int
    """Blocks of a GPU that share one simulation."""
    memory: int
    """Number of state variables of an element for the relaxation; 0 without relaxation."""


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
    cluster: int = 1,
) -> TimeLoopKernel:
    """Generate the time loop for a material law, two contact laws, a precision and an element.

    With `on_chip` a GPU stores the state of a simulation in shared memory. The state must fit
    (`explicit.layout.state.fits`). On a GPU the kernel is compiled for blocks of `block` threads; `cluster`
    blocks share one simulation. `bound` is that of `explicit.model.Stepping`, `volumetric` that of
    `explicit.Model`, `relaxation` its `relaxation_kind`.
    """
    element = element_named(element_name).functions(law, precision, bound, volumetric)
    structs = batch_structs(precision, element.Shape, element.Solid)
    spread = on_chip and cluster > 1
    lanes = lanes_of_chips(cluster) if spread else lane_functions(cluster)
    layout = (
        layout_on_chips(precision, structs, cluster)
        if spread
        else state_layout(precision, structs, on_chip, cluster)
    )
    sums, remembered, fields_of, surface_of = layout.sums, layout.remembered, layout.fields, layout.surface
    at_rest = layout.at_rest
    sweeps = sweep_functions(precision, element, structs, layout, lanes)
    branch = relaxation_functions(relaxation, law, precision, bound, element, structs, layout, sweeps, lanes)
    element_forces, relaxed_forces, energies = sweeps.elements, branch.sweep, branch.energies
    platens = boundary_functions(faces, side, precision, structs)
    nodes = node_sweeps(precision, structs, layout, platens, lanes)
    move_interior, move_boundary = nodes.interior, nodes.boundary
    record = record_functions(precision, structs, layout, lanes)
    put_stored, put_exchanged, record_ending = record.put_stored, record.put_exchanged, record.ending
    end_of_step = end_of_step_function(precision, structs, platens, record, lanes)
    planning = next_step_functions(precision, structs, platens, record, lanes, relaxation is not None)
    refresh = planning.reload_step if spread else planning.keep_step
    start, first_step, next_step, read_step = (
        planning.start, planning.first_step, planning.next_step, planning.read,
    )  # fmt: skip
    failure = failure_functions(precision, element, structs, layout, lanes)
    motion, beyond_data, failed_element = failure.motion, failure.strain, failure.failed_element
    check, check_every = planning.check, int(CHECK_EVERY)
    sync, is_worker, is_control, empty_sum = lanes.sync, lanes.is_worker, lanes.is_control, lanes.empty_sum
    enter, leave, announce = lanes.enter, lanes.leave, lanes.announce
    listen, inform = lanes.listen, lanes.inform
    put_total, put_largest = lanes.put_total, lanes.put_largest
    put_share, joined = lanes.put_share, lanes.joined
    settle, regroup, disband = lanes.settle, lanes.regroup, lanes.disband
    plans, relaxes = int(Control.PLANS), int(relaxation is not None)
    viscous_power, restraint_power = int(Share.POWER), int(Share.ARTIFICIAL)
    Body, Batch, State, Output = structs.Body, structs.Batch, structs.State, structs.Output
    HALF, ZERO = wp.float64(0.5), wp.float64(0.0)
    control_size = int(CONTROL_SIZE)
    residents = (
        SHARING if block <= SMALL_BLOCK else 1
    )  # a multiprocessor must have registers for these blocks

    @wp.kernel(module="unique", enable_backward=False, launch_bounds=(block, residents), cluster_dim=cluster)
    def time_loop(body: Body, batch: Batch, state: State, output: Output, first: int):
        index, lane = wp.tid()
        sample = first + index
        solid = batch.solids[sample]
        row = batch.rows[batch.material[sample]]
        branches = batch.branches[batch.relaxation[sample]]
        limit_s = batch.data_limit[batch.material[sample]]
        friction, alpha = batch.friction[sample], solid.mass_damping
        fields, surface = fields_of(body, state, sample), surface_of(body, state, sample)
        control, partials = sums(state.control, sample, 0), sums(state.partials, sample, control_size)
        memory = remembered(state.memory, sample, 0)
        enter(control)
        at_rest(body, fields, surface, partials, lane)
        if is_control(lane) == 1:
            start(batch, output, sample, control)
        sync()
        # Sums since the start: damping, friction, hourglass viscosity, landing, work of the platens [J].
        damped, rubbed, restrained = empty_sum(), empty_sum(), empty_sum()
        landed, worked = empty_sum(), empty_sum()
        going, step, until_measured, latched = int(1), int(-1), int(0), wp.float64(0.0)

        while going == 1:  # before the first step the elements only compute its bound
            step, until_measured, latched = regroup(step, until_measured, latched)
            # While the workers sweep the elements, the control warp finishes the previous step.
            measure = int(0)
            if until_measured == 0:
                measure = 1
                until_measured = batch.measure_every
            until_measured -= 1
            worst, power, artificial = element_forces(body, solid, row, fields, lane, measure)
            put_share(power, viscous_power)
            put_share(artificial, restraint_power)
            stiffer = relaxed_forces(body, solid, row, branches, memory, control, step, fields, lane, measure)
            latched = wp.max(latched, worst)  # this detects an element that inverts between two measurements
            if is_worker(lane) == 1:
                if step % check_every == 0:
                    put_total(partials, Total.MOTION, motion(body, fields, lane))
                    put_total(partials, Total.WORK_DONE, worked)
                    put_largest(partials, Total.TURNED, latched)
                if batch.stop_past_data == 1:
                    put_largest(partials, Total.BEYOND, beyond_data(body, limit_s, fields, lane))
                if measure == 1:
                    put_largest(partials, Total.STIFFEST + (step + 1) % 2, latched)
                    if relaxes == 1:
                        put_largest(partials, Total.STIFFER + (step + 1) % 2, stiffer)
            if measure == 1:
                latched = wp.float64(0.0)
            if is_control(lane) == 1:
                if step == 0:
                    first_step(control)
                if step > 0:
                    end_of_step(
                        body, batch, state, output, sample, lane, step - 1, control, partials, surface, fields
                    )
                announce(control, step)
            planned = read_step(control, step)
            sync()
            listen(control, step)
            now = refresh(planned, control, step)
            going = int(control[Control.GOING] > ZERO)
            if going == 1 and step >= 0:
                power = joined(power, viscous_power, body.n_elements)
                artificial = joined(artificial, restraint_power, body.n_elements)
                kinetic = empty_sum()
                if now.ledger == 1:
                    elastic, hourglass, past = empty_sum(), empty_sum(), empty_sum()
                    viscous, most = empty_sum(), wp.float64(0.0)
                    if is_worker(lane) == 1:
                        elastic, hourglass, past, most, viscous = energies(
                            body, solid, row, limit_s, branches, memory, fields, lane
                        )
                    put_stored(partials, elastic, hourglass, viscous, past, most)
                    sync()  # the node sweep below changes data that other lanes may still read
                # Half of this step's work is before the time of the positions, half is after it.
                damp_step, hold_step = power * now.interval, artificial * now.interval
                kinetic, damp_step = move_interior(body, fields, now, alpha, lane, kinetic, damp_step)
                kinetic, damp_step, rub_step, land_step, work_step = move_boundary(
                    body, batch, state, sample, fields, surface, control, now, friction, alpha, lane,
                    kinetic, damp_step,
                )  # fmt: skip
                if now.ledger == 1:
                    put_exchanged(
                        partials, kinetic,
                        worked + HALF * work_step, damped + HALF * damp_step, rubbed + HALF * rub_step,
                        landed + HALF * land_step, restrained + HALF * hold_step,
                    )  # fmt: skip
                worked += work_step
                damped += damp_step
                rubbed += rub_step
                restrained += hold_step
                landed += land_step
            if going == 1 and is_control(lane) == 1:
                next_step(batch, output, sample, step + 1, measure, control, partials)
            settle(latched)
            step += 1
            sync()
            if relaxes == 1:  # the relaxation reads the plan of the step in the sweep over elements
                inform(control, plans)

        inform(control, 0)
        latched = disband(latched)
        if int(control[Control.STATUS]) == 0:  # a last check covers the steps since the previous check
            if is_worker(lane) == 1:
                put_total(partials, Total.MOTION, motion(body, fields, lane))
                put_total(partials, Total.WORK_DONE, worked)
                put_largest(partials, Total.TURNED, latched)
            sync()
            if is_control(lane) == 1:
                control[Control.STATUS] = wp.float64(check(batch, sample, control, partials))
        sync()
        inform(control, 0)
        failed = int(-1)
        if int(control[Control.STATUS]) != 0:
            status = int(control[Control.STATUS])
            failed = failed_element(body, solid, row, fields, partials, lane, status)
        if lane == 0:
            record_ending(output, sample, control, failed)
        leave()

    return TimeLoopKernel(time_loop, structs, element, block, cluster, branch.memory)
