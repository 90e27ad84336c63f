"""Relaxation in the time loop: the stress that branches have given up, and the energy they took.

The law's own stress enters at its instantaneous stiffness, through the element's forces and its step bound;
the functions here subtract what the branches have relaxed since. Every stress point remembers a few numbers
a branch, every element what its branches were worth so far, side by side over the elements.
A sample without rate dependence runs none of this.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any

import warp as wp

from explicit.elements import ElementFunctions
from explicit.precision import Precision
from explicit.relaxation.base import Relaxation
from explicit.time_loop.element_sweeps import SweepFunctions, corner_functions
from explicit.time_loop.lanes import LaneFunctions
from explicit.time_loop.slots import Control, Plan
from explicit.time_loop.state_layout import StateLayout
from explicit.time_loop.structs import Structs, simulation_structs


@dataclass(frozen=True)
class RelaxationFunctions:
    """Functions of the branches for the time loop."""

    sweep: Any
    """``sweep(body, solid, row, branches, memory, control, step, fields, lane, measure)``: subtract the
    forces of what has relaxed from the corners; returns the largest omega^2 of theirs [1/s^2], 0 unless
    `measure` is 1."""
    energies: Any
    """``energies(body, solid, row, limit_s, branches, memory, fields, lane)``: as of the sweep over energies,
    of the long-term law, and what was done on the branches [J]."""
    memory: int
    """Numbers that an element remembers."""


@cache
def relaxation_functions(
    kind: Relaxation | None,
    law: type,
    precision: Precision,
    bound: str,
    element: ElementFunctions,
    structs: Structs,
    layout: StateLayout,
    sweeps: SweepFunctions,
    lanes: LaneFunctions,
) -> RelaxationFunctions:
    """Generate the functions of a kind of branches, or those of none."""
    if kind is None:
        return _nothing(precision, element, structs, sweeps, lanes)
    real = precision.real
    Body, Solid, Fields = structs.Body, element.Solid, simulation_structs(precision).Fields
    empty_sum, add_to, n_workers = lanes.empty_sum, lanes.add_to, lanes.n_workers
    sum_first, first_element, end_element = lanes.sum_first, lanes.first_element, lanes.end_element
    corner = corner_functions(precision, structs)
    nodes, values = corner.nodes, corner.values
    read_shape, corner_stride, place_of = element.read_shape, layout.corner_stride, layout.element
    stress_point, sweep_energies = element.stress_point, sweeps.energies
    point = kind.point(law, precision, bound)
    relax, held = point.relax, point.held
    n_points, per_point = int(element.n_points), int(point.memory)
    worth, index_of_rest = int(n_points * per_point), int(kind.index_of_rest)
    zero = real(0.0)

    @wp.func
    def sweep(
        body: Body,
        solid: Solid,
        row: wp.array(dtype=real),
        branches: wp.array(dtype=real),
        memory: wp.array(dtype=real),
        control: wp.array(dtype=wp.float64),
        step: int,
        fields: Fields,
        lane: int,
        measure: int,
    ):
        # The step that led here, and the time between the velocities before and after.
        moved, interval = real(0.0), real(0.0)
        if step >= 0:
            plan = Control.PLANS + Plan.SIZE * (step % 2)
            moved = real(control[plan + Plan.STEP_BEFORE])
            interval = real(control[plan + Plan.INTERVAL])
        most = real(0.0)
        n_elements, stride = body.n_elements, corner_stride(body.n_elements)
        e = first_element(lane, n_elements)
        end = end_element(n_elements)
        while e < end:
            q = nodes(body, e)
            shape = read_shape(body.shapes, e, measure)
            ur, uy, vr, vy = (
                values(fields.u_r, q),
                values(fields.u_y, q),
                values(fields.v_r, q),
                values(fields.v_y, q),
            )
            done, stiffer, at = real(0.0), real(0.0), place_of(e)
            for g in range(n_points):
                weight, gradient_r, gradient_y, hoop = stress_point(shape, g)
                f_r, f_y, more, omega_squared = relax(
                    weight, gradient_r, gradient_y, hoop, shape.inverse_mass_r, shape.inverse_mass_y,
                    solid.scale, row, branches, memory, g * per_point, n_elements, e,
                    ur, uy, vr, vy, moved, interval, measure,
                )  # fmt: skip
                for a in range(4):
                    fields.corner_r[a * stride + at] = fields.corner_r[a * stride + at] + f_r[a]
                    fields.corner_y[a * stride + at] = fields.corner_y[a * stride + at] + f_y[a]
                done += more
                stiffer += omega_squared
            memory[worth * n_elements + e] = memory[worth * n_elements + e] + done
            most = wp.max(most, stiffer)
            e += n_workers()
        return wp.float64(most)

    @wp.func
    def energies(
        body: Body,
        solid: Solid,
        row: wp.array(dtype=real),
        limit_s: real,
        branches: wp.array(dtype=real),
        memory: wp.array(dtype=real),
        fields: Fields,
        lane: int,
    ):
        rest = branches[index_of_rest]
        lasting = Solid(solid.scale * rest, solid.bulk, solid.hourglass, zero, zero, zero, zero, zero)
        elastic, hourglass, past, most = sweep_energies(body, lasting, row, limit_s, fields, lane)
        taken = empty_sum()
        n_elements = body.n_elements
        e = sum_first(lane)
        while e < body.n_elements:
            q = nodes(body, e)
            shape = read_shape(body.shapes, e, 0)
            ur, uy = values(fields.u_r, q), values(fields.u_y, q)
            stored = real(0.0)
            for g in range(n_points):
                weight, gradient_r, gradient_y, hoop = stress_point(shape, g)
                stored += held(
                    weight, gradient_r, gradient_y, hoop,
                    solid.scale, row, branches, memory, g * per_point, n_elements, e, ur, uy,
                )  # fmt: skip
            taken = add_to(taken, wp.float64(stored + memory[worth * n_elements + e]), e)
            e += n_workers()
        return elastic, hourglass, past, most, taken

    return RelaxationFunctions(sweep, energies, n_points * per_point + 1)


def _nothing(
    precision: Precision,
    element: ElementFunctions,
    structs: Structs,
    sweeps: SweepFunctions,
    lanes: LaneFunctions,
) -> RelaxationFunctions:
    real = precision.real
    Body, Solid, Fields = structs.Body, element.Solid, simulation_structs(precision).Fields
    sweep_energies, empty_sum = sweeps.energies, lanes.empty_sum

    @wp.func
    def sweep(
        body: Body,
        solid: Solid,
        row: wp.array(dtype=real),
        branches: wp.array(dtype=real),
        memory: wp.array(dtype=real),
        control: wp.array(dtype=wp.float64),
        step: int,
        fields: Fields,
        lane: int,
        measure: int,
    ):
        return wp.float64(0.0)

    @wp.func
    def energies(
        body: Body,
        solid: Solid,
        row: wp.array(dtype=real),
        limit_s: real,
        branches: wp.array(dtype=real),
        memory: wp.array(dtype=real),
        fields: Fields,
        lane: int,
    ):
        elastic, hourglass, past, most = sweep_energies(body, solid, row, limit_s, fields, lane)
        return elastic, hourglass, past, most, empty_sum()

    return RelaxationFunctions(sweep, energies, 0)
