"""The motion of the nodes: corner forces gathered, the velocity they would give, and where a node goes.

Interior nodes move freely; a boundary node first meets its platen (`explicit.time_loop.boundary`). Both come
in sweeps of their own, so that only boundary nodes pay for contact.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any

import warp as wp

from explicit.precision import Precision
from explicit.time_loop.boundary import LOWER, UPPER, BoundaryFunctions
from explicit.time_loop.grouped_tables import entries_function
from explicit.time_loop.lanes import LaneFunctions
from explicit.time_loop.slots import Control
from explicit.time_loop.state_layout import StateLayout
from explicit.time_loop.structs import Structs, simulation_structs

VALENCE = 4
"""Elements that meet at a node, at most."""


@dataclass(frozen=True)
class NodeSweeps:
    """The sweeps over a simulation's nodes."""

    interior: Any
    """``interior(body, fields, step, alpha, lane, kinetic, damped) -> (kinetic, damped)``: move this worker's
    interior nodes; sums of kinetic energy and of what mass-proportional damping `alpha` takes [J]."""
    boundary: Any
    """``boundary(body, batch, state, sample, fields, surface, control, step, friction, alpha, lane, kinetic,
    damped) -> (kinetic, damped, rubbed, landed, worked)``: the same for its boundary nodes, with the work of
    friction, of landing and of the platens [J]."""


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
        """Velocity before, velocity after an interval without contact, and the node's mass; its fields are
        `at` a place of their own."""
        f_r, f_y = real(0.0), real(0.0)
        corners, masses = corners_at(body.corners, 0, n), numbers(body.masses, 0, n)
        for c in range(valence):
            f_r += fields.corner_r[corners[c]]
            f_y += fields.corner_y[corners[c]]
        old = vec2(fields.v_r[at], fields.v_y[at])
        # Forces resist, so they enter with a minus; the drag of alpha acts on the old velocity. On the axis
        # the radial inverse mass is zero.
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
            # Impulses of the platen on the node, and where their work goes.
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
