"""The motion of the nodes: gathering of corner forces, boundary conditions, and update of the positions.

Interior nodes move freely. A boundary node may touch a platen: the flyer with its motion, or the support with
its wave. Interior and boundary nodes have separate sweeps; contact takes time for boundary nodes only.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any

import warp as wp

from explicit.contact import contact_law
from explicit.contact.base import RELEASED, touch_struct
from explicit.layout.lanes import LaneFunctions
from explicit.layout.state import StateLayout
from explicit.layout.structs import Control, Structs, entries_function, simulation_structs
from explicit.precision import Precision

INTERIOR, LOWER, UPPER, SIDE = 0, 1, 2, 3
"""Node kinds: the platen that a node can touch. LOWER and UPPER also mark the platen that a node has touched.
After a release UPPER is added to the mark."""

BAR_HISTORY = 1024
"""Number of stored samples of the wave per round trip in a characteristic bar."""


@dataclass(frozen=True)
class BoundaryFunctions:
    """Functions of the boundary for one pair of contact laws and one precision."""

    platen_position: Any
    """``platen_position(batch, motion, time)``: displacement of a platen whose motion is tabulated [m]."""
    returned_wave: Any
    """``returned_wave(state, sample, elapsed, round_trip)``: h(t) of `explicit.platens` [m/s]."""
    contact: Any
    """``contact(body, batch, state, sample, node, kind, touched, free, to_lower, to_upper, friction,
    interval, step) -> (velocity, platen, touched)``."""


@cache
def boundary_functions(faces: str, side: str, precision: Precision, structs: Structs) -> BoundaryFunctions:
    """Generate the boundary for two contact laws."""
    real, vec2 = precision.real, precision.vec2
    Body, Batch, State = structs.Body, structs.Batch, structs.State
    face_law, side_law = contact_law(faces), contact_law(side)
    face_contact, side_contact = face_law.kernel_function(precision), side_law.kernel_function(precision)
    Touch = touch_struct(precision)
    ZERO = wp.float64(0.0)
    lower, upper, on_side, released = int(LOWER), int(UPPER), int(SIDE), int(RELEASED)
    remembers = int(face_law.remembers_slip or side_law.remembers_slip)
    history, twice = int(BAR_HISTORY), int(2 * BAR_HISTORY)

    @wp.func
    def platen_position(batch: Batch, motion: int, time: wp.float64):
        last = batch.motion_table.shape[1] - 1
        position = (time - batch.start) * batch.motion_rate[motion]
        k = wp.clamp(int(position), 0, last)
        x = position - wp.float64(k)
        f, d = batch.motion_table[motion, k, 0], batch.motion_table[motion, k, 1]
        a, c = batch.motion_table[motion, k, 2], batch.motion_table[motion, k, 3]
        return f + x * (d + x * (a + x * c))

    @wp.func
    def returned_wave(state: State, sample: int, elapsed: wp.float64, round_trip: wp.float64):
        """The wave h(t) = g(t - 2 L / c) that returns from the bar's free end."""
        wave = wp.float64(0.0)
        late = elapsed - round_trip
        if late > ZERO:
            position = late / round_trip * wp.float64(history)
            k = int(position)
            share = position - wp.float64(k)
            early = state.bar_wave[sample, k % twice]
            following = state.bar_wave[sample, (k + 1) % twice]
            wave = early + share * (following - early)
        return wave

    @wp.func
    def of_either(touch: Touch, kind: int):
        new, status, slip = face_contact(touch)
        if kind == on_side:
            new, status, slip = side_contact(touch)
        return new, status, slip

    @wp.func
    def of_both(touch: Touch, kind: int):
        return face_contact(touch)

    contact_of = of_both if faces == side else of_either

    @wp.func
    def contact(
        body: Body,
        batch: Batch,
        state: State,
        sample: int,
        node: int,
        kind: int,
        touched: int,
        free: vec2,
        to_lower: real,
        to_upper: real,
        friction: real,
        interval: real,
        step: real,
    ):
        """Admissible velocity of a boundary node, the platen it touches (or 0) and its new touch mark."""
        new, platen, mark = vec2(free), int(0), int(touched)
        before, status, slip = int(touched), int(touched > 0), real(0.0)
        if touched > upper:
            before = touched - upper
            status = released
        target, normal = real(to_lower), real(1.0)
        if before == upper or (before == 0 and free[1] > to_upper):
            platen = upper
        if before == lower or (before == 0 and free[1] < to_lower):
            platen = lower
        if kind != on_side:
            platen = kind
        if platen == upper:
            target = to_upper
            normal = real(-1.0)
        if platen != 0:
            if remembers == 1:
                slip = state.slip[sample, node]
            release, stiffness = batch.release_stress[sample], batch.contact_stiffness[sample]
            touch = Touch(
                free[0], free[1], target, normal, status, slip,
                friction, release, stiffness, body.surface_mass[node], interval, step,
            )  # fmt: skip
            new, status, slip = contact_of(touch, kind)
        if kind == on_side and (free[1] < to_lower or free[1] > to_upper):
            mark = platen
        if status == released:
            mark = before + upper
        if remembers == 1:
            state.slip[sample, node] = slip
        return new, platen, mark

    return BoundaryFunctions(platen_position, returned_wave, contact)


VALENCE = 4
"""Largest number of elements at a node."""


@dataclass(frozen=True)
class NodeSweeps:
    """The sweeps over a simulation's nodes."""

    interior: Any
    """``interior(body, fields, step, alpha, lane, kinetic, damped) -> (kinetic, damped)``: move this worker's
    interior nodes and add to the sums of kinetic energy and of energy lost to mass-proportional damping
    `alpha` [J]."""
    boundary: Any
    """``boundary(body, batch, state, sample, fields, surface, control, step, friction, alpha, lane, kinetic,
    damped) -> (kinetic, damped, rubbed, landed, worked)``: the same for its boundary nodes, with the energies
    lost to friction and to landing and the work of the platens [J]."""


@cache
def node_sweeps(
    precision: Precision,
    structs: Structs,
    layout: StateLayout,
    platens: BoundaryFunctions,
    lanes: LaneFunctions,
) -> NodeSweeps:
    """Generate the sweeps."""
    real, vec2 = precision.real, precision.vec2
    Body, Batch, State = structs.Body, structs.Batch, structs.State
    simulation = simulation_structs(precision)
    Fields, Surface, Step = simulation.Fields, simulation.Surface, simulation.Step
    empty_sum, add_to, boundary_first = lanes.empty_sum, lanes.add_to, lanes.boundary_first
    first_inner, inner_stride, n_workers = lanes.first_inner, lanes.inner_stride, lanes.n_workers
    end_inner = lanes.end_inner
    contact, place_of = platens.contact, layout.node
    numbers, corners_at = entries_function(real), entries_function(wp.int32)
    valence, zero, half = int(VALENCE), real(0.0), real(0.5)
    lower, upper = int(LOWER), int(UPPER)

    @wp.func
    def free_velocity(body: Body, fields: Fields, n: int, at: int, interval: real, alpha: real):
        """Velocity before and after an interval without contact, and mass of node `n`. The fields of the node
        are at index `at`."""
        f_r, f_y = real(0.0), real(0.0)
        corners, masses = corners_at(body.corners, 0, n), numbers(body.masses, 0, n)
        for c in range(valence):
            f_r += fields.corner_r[corners[c]]
            f_y += fields.corner_y[corners[c]]
        old = vec2(fields.v_r[at], fields.v_y[at])
        # Internal forces resist the motion, so their sign is negative; the drag of alpha acts on the old
        # velocity. On the axis the radial inverse mass is zero.
        push = vec2(f_r * masses[1], f_y * masses[2])
        return old, old - interval * (push + alpha * old), masses[0]

    @wp.func
    def move(fields: Fields, at: int, new: vec2, dt: real):
        fields.v_r[at] = new[0]
        fields.v_y[at] = new[1]
        fields.u_r[at] = fields.u_r[at] + dt * new[0]
        fields.u_y[at] = fields.u_y[at] + dt * new[1]

    @wp.func
    def kinetic_energy(mass: real, old: vec2, new: vec2):
        return wp.float64(half * mass * wp.dot(old, new))

    @wp.func
    def drag_loss(mass: real, old: vec2, new: vec2, interval: real, alpha: real):
        return wp.float64(interval * alpha * mass * half * wp.dot(old, old + new))

    @wp.func
    def interior(
        body: Body,
        fields: Fields,
        step: Step,
        alpha: real,
        lane: int,
        kinetic: wp.float64,
        damped: wp.float64,
    ):
        dt, interval = real(step.dt), real(step.interval)
        adds = int(0)
        if step.ledger == 1 or alpha > zero:
            adds = 1
        n = first_inner(lane, body.n_inner, adds)
        end = end_inner(body.n_inner, adds)
        while n < end:
            at = place_of(body, n)
            old, new, mass = free_velocity(body, fields, n, at, interval, alpha)
            if step.ledger == 1:
                kinetic = add_to(kinetic, kinetic_energy(mass, old, new), n)
            if alpha > zero:
                damped = add_to(damped, drag_loss(mass, old, new, interval, alpha), n)
            move(fields, at, new, dt)
            n += inner_stride()
        return kinetic, damped

    @wp.func
    def boundary(
        body: Body,
        batch: Batch,
        state: State,
        sample: int,
        fields: Fields,
        surface: Surface,
        control: wp.array(dtype=wp.float64),
        step: Step,
        friction: real,
        alpha: real,
        lane: int,
        kinetic: wp.float64,
        damped: wp.float64,
    ):
        rubbed, landed, worked = empty_sum(), empty_sum(), empty_sum()
        dt, interval = real(step.dt), real(step.interval)
        lower_next, lower_speed = control[Control.LOWER_NEXT], control[Control.LOWER_SPEED]
        b = boundary_first(lane)
        while b < body.n_boundary:
            node = body.first_boundary + b
            at = place_of(body, node)
            kind, touched = body.kind[b], surface.touched[b]
            height = body.reference_y[node] + wp.float64(fields.u_y[at])
            old, free, mass = free_velocity(body, fields, node, at, interval, alpha)
            to_lower = real((lower_next - height) * step.rate)
            to_upper = real((body.length - step.flyer_next - height) * step.rate)
            new, platen, mark = contact(
                body, batch, state, sample, b,
                kind, touched, free, to_lower, to_upper, friction, interval, dt,
            )  # fmt: skip
            surface.touched[b] = mark
            # Impulses of the platen on the node, and the energies of their work.
            push = wp.float64(mass) * wp.float64(new[1] - free[1])
            rub = wp.float64(mass) * wp.float64(new[0] - free[0])
            speed = wp.float64(half * (old[1] + new[1]))
            slide = wp.float64(half * (old[0] + new[0]))
            from_below, from_above, riding = wp.float64(0.0), wp.float64(0.0), wp.float64(0.0)
            if platen == lower:
                from_below = push
            if platen == lower and new[1] == to_lower:
                riding = wp.float64(mass)
            met = wp.float64(lower_speed)
            if platen == upper:
                from_above = push
                met = step.upper_speed
            impulse = from_below + from_above
            landed = add_to(landed, impulse * (met - speed), b)
            worked = add_to(worked, impulse * met, b)
            rubbed = add_to(rubbed, -rub * slide, b)
            surface.push_lower[b] = from_below
            surface.push_upper[b] = from_above
            surface.carried[b] = riding
            if step.ledger == 1:
                kinetic = add_to(kinetic, kinetic_energy(mass, old, new), b)
            if alpha > zero:
                damped = add_to(damped, drag_loss(mass, old, new, interval, alpha), b)
            move(fields, at, new, dt)
            b += n_workers()
        return kinetic, damped, rubbed, landed, worked

    return NodeSweeps(interior, boundary)
