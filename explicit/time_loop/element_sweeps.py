"""Sweeps over a simulation's elements: corner forces, relaxation, energies, and the detection of failure.

The corner forces of a law with relaxation use its instantaneous stiffness. The relaxation functions subtract
the relaxed stress of the branches. Every `CHECK_EVERY` steps the specimen's motion is checked. A run has
*diverged* if the kinetic energy exceeds the largest work that the platens have done so far. The specimen
starts at rest and its stored energy is never negative, so

    E_kin(t) <= max over t' <= t of W(t')

for every material, mesh and contact. `MOTION_LIMIT` is a margin for the error of the time step. After a
failure one search finds the element that caused it.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any

import warp as wp

from explicit.elements import ElementFunctions
from explicit.layout.lanes import LaneFunctions
from explicit.layout.state import StateLayout
from explicit.layout.structs import (
    Control,
    Plan,
    Share,
    Structs,
    Total,
    entries_function,
    entry_function,
    simulation_structs,
)
from explicit.precision import Precision
from explicit.relaxation.base import Relaxation
from explicit.response import Outcome


@dataclass(frozen=True)
class CornerFunctions:
    """Functions of an element's corners, for the sweeps."""

    nodes: Any
    """``nodes(body, e) -> vec4i``: the corner nodes of element e."""
    values: Any
    """``values(field, corners) -> vec4``: a field at the corner nodes."""


@cache
def corner_functions(precision: Precision, structs: Structs) -> CornerFunctions:
    """Generate the corners' functions."""
    real, vec4, Body = precision.real, precision.vec4, structs.Body
    nodes_at = entries_function(wp.int32)

    @wp.func
    def nodes(body: Body, e: int):
        return nodes_at(body.quads, 0, e)

    @wp.func
    def values(field: wp.array(dtype=real), corners: wp.vec4i):
        return vec4(field[corners[0]], field[corners[1]], field[corners[2]], field[corners[3]])

    return CornerFunctions(nodes, values)


@dataclass(frozen=True)
class SweepFunctions:
    """The sweeps of one law and precision."""

    elements: Any
    """``elements(body, solid, row, fields, lane, measure) -> (omega_squared, power, artificial)``: corner
    forces."""
    energies: Any
    """``energies(body, solid, row, limit_s, fields, lane) -> (elastic, hourglass, volume past data, s)``."""


@cache
def sweep_functions(
    precision: Precision,
    element: ElementFunctions,
    structs: Structs,
    layout: StateLayout,
    lanes: LaneFunctions,
) -> SweepFunctions:
    """Generate the sweeps."""
    real = precision.real
    Body, Solid, Fields = structs.Body, element.Solid, simulation_structs(precision).Fields
    empty_sum, add_to, n_workers = lanes.empty_sum, lanes.add_to, lanes.n_workers
    add_share, sum_first = lanes.add_share, lanes.sum_first
    first_element, end_element = lanes.first_element, lanes.end_element
    viscous_power, restrained = int(Share.POWER), int(Share.ARTIFICIAL)
    corner = corner_functions(precision, structs)
    nodes, values = corner.nodes, corner.values
    read_shape, corner_stride, place_of = element.read_shape, layout.corner_stride, layout.element
    element_forces, element_energies = element.forces, element.energies

    @wp.func
    def sweep_elements(
        body: Body, solid: Solid, row: wp.array(dtype=real), fields: Fields, lane: int, measure: int
    ):
        """Corner forces of this lane's elements, their largest omega^2, and the sums of the powers of
        `ElementFunctions.forces`."""
        worst, power, artificial = real(0.0), empty_sum(), empty_sum()
        stride = corner_stride(body.n_elements)
        e = first_element(lane, body.n_elements)
        end = end_element(body.n_elements)
        while e < end:
            q = nodes(body, e)
            f_r, f_y, omega_squared, dissipated, controlled = element_forces(
                read_shape(body.shapes, e, measure),
                solid,
                row,
                values(fields.u_r, q),
                values(fields.u_y, q),
                values(fields.v_r, q),
                values(fields.v_y, q),
                measure,
            )
            at = place_of(e)
            for a in range(4):
                fields.corner_r[a * stride + at] = f_r[a]
                fields.corner_y[a * stride + at] = f_y[a]
            worst = wp.max(worst, omega_squared)
            power = add_share(power, viscous_power, wp.float64(dissipated), e)
            artificial = add_share(artificial, restrained, wp.float64(controlled), e)
            e += n_workers()
        return wp.float64(worst), power, artificial

    @wp.func
    def sweep_energies(
        body: Body, solid: Solid, row: wp.array(dtype=real), limit_s: real, fields: Fields, lane: int
    ):
        """Strain and hourglass energy, volume beyond the data and largest s of this lane's elements."""
        elastic, hourglass, past = empty_sum(), empty_sum(), empty_sum()
        most = real(0.0)
        e = sum_first(lane)
        while e < body.n_elements:
            q = nodes(body, e)
            shape = read_shape(body.shapes, e, 0)
            w, h, s = element_energies(shape, solid, row, values(fields.u_r, q), values(fields.u_y, q))
            elastic = add_to(elastic, wp.float64(w), e)
            hourglass = add_to(hourglass, wp.float64(h), e)
            most = wp.max(most, s)
            if s > limit_s:
                past = add_to(past, wp.float64(shape.volume), e)
            e += n_workers()
        return elastic, hourglass, past, wp.float64(most)

    return SweepFunctions(sweep_elements, sweep_energies)


@dataclass(frozen=True)
class RelaxationFunctions:
    """Functions of the branches for the time loop."""

    sweep: Any
    """``sweep(body, solid, row, branches, memory, control, step, fields, lane, measure)``: subtract the
    forces of the relaxed stress from the corner forces; returns the largest omega^2 of the branches [1/s^2],
    0 unless `measure` is 1."""
    energies: Any
    """``energies(body, solid, row, limit_s, branches, memory, fields, lane)``: the results of
    `SweepFunctions.energies` for the long-term law, and the work done on the branches [J]."""
    memory: int
    """Number of state variables of an element."""


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
    """Generate the functions of a kind of branches. Without branches they do nothing."""
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
    relax, branch_energy = point.relax, point.branch_energy
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
        # The last step, and the time between the velocities before and after the positions.
        previous_step, interval = real(0.0), real(0.0)
        if step >= 0:
            plan = Control.PLANS + Plan.SIZE * (step % 2)
            previous_step = real(control[plan + Plan.STEP_BEFORE])
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
            work, stiffer, at = real(0.0), real(0.0), place_of(e)
            for g in range(n_points):
                weight, gradient_r, gradient_y, hoop = stress_point(shape, g)
                f_r, f_y, more, omega_squared = relax(
                    weight, gradient_r, gradient_y, hoop, shape.inverse_mass_r, shape.inverse_mass_y,
                    solid.scale, row, branches, memory, g * per_point, n_elements, e,
                    ur, uy, vr, vy, previous_step, interval, measure,
                )  # fmt: skip
                for a in range(4):
                    fields.corner_r[a * stride + at] = fields.corner_r[a * stride + at] + f_r[a]
                    fields.corner_y[a * stride + at] = fields.corner_y[a * stride + at] + f_y[a]
                work += more
                stiffer += omega_squared
            memory[worth * n_elements + e] = memory[worth * n_elements + e] + work
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
        long_term = branches[index_of_rest]
        lasting = Solid(solid.scale * long_term, solid.bulk, solid.hourglass, zero, zero, zero, zero, zero)
        elastic, hourglass, past, most = sweep_energies(body, lasting, row, limit_s, fields, lane)
        branch_sum = empty_sum()
        n_elements = body.n_elements
        e = sum_first(lane)
        while e < body.n_elements:
            q = nodes(body, e)
            shape = read_shape(body.shapes, e, 0)
            ur, uy = values(fields.u_r, q), values(fields.u_y, q)
            stored = real(0.0)
            for g in range(n_points):
                weight, gradient_r, gradient_y, hoop = stress_point(shape, g)
                stored += branch_energy(
                    weight, gradient_r, gradient_y, hoop,
                    solid.scale, row, branches, memory, g * per_point, n_elements, e, ur, uy,
                )  # fmt: skip
            branch_sum = add_to(branch_sum, wp.float64(stored + memory[worth * n_elements + e]), e)
            e += n_workers()
        return elastic, hourglass, past, most, branch_sum

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


CHECK_EVERY = 8
"""Number of steps between two checks of a simulation. It is the largest delay until a divergence or an
inverted element is detected."""
MOTION_LIMIT = 2.0
"""A simulation has diverged if the kinetic energy exceeds this multiple of the largest work of the platens so
far [-]. Energy is conserved to 0.1 % (verification manual), so a valid run is far below."""
STRAY_ENERGY = 1e-6
"""The check for divergence ignores a kinetic energy over mu_0 V below this [-]: that of a strain of 1e-3.
Before the flyer arrives no platen has done work, but round-off may move the specimen slightly."""


@dataclass(frozen=True)
class FailureFunctions:
    """Functions that detect a failure and find its element."""

    motion: Any
    """``motion(body, fields, lane)``: kinetic energy of this worker's nodes [J], a sum that begins with
    ``empty_sum``."""
    strain: Any
    """``strain(body, limit, fields, lane)``: the largest s of this worker's elements [-] if it exceeds the
    data limit of their law, otherwise 0."""
    failed_element: Any
    """``failed_element(body, solid, row, fields, partials, lane, status)``: the element that most likely
    caused a failure, the first of equal ones. An element whose value is not finite has priority. Every lane
    calls it."""


@cache
def failure_functions(
    precision: Precision,
    element: ElementFunctions,
    structs: Structs,
    layout: StateLayout,
    lanes: LaneFunctions,
) -> FailureFunctions:
    """Generate the functions."""
    real = precision.real
    Body, Solid, Fields = structs.Body, element.Solid, simulation_structs(precision).Fields
    empty_sum, add_to, n_workers = lanes.empty_sum, lanes.add_to, lanes.n_workers
    sum_first, first_element, end_element = lanes.sum_first, lanes.first_element, lanes.end_element
    sync, put_largest, get_largest = lanes.sync, lanes.put_largest, lanes.get_largest
    number, corner = entry_function(real), corner_functions(precision, structs)
    nodes, values = corner.nodes, corner.values
    read_shape, element_forces, element_strains = element.read_shape, element.forces, element.strains
    place_of = layout.node
    half = real(0.5)
    least, most, nobody = wp.float64(-1e300), wp.float64(1e300), wp.float64(-1.0e30)
    inverted, diverged = int(Outcome.INVERTED), int(Outcome.DIVERGED)
    exceeded = int(Outcome.TABLE_EXCEEDED)

    @wp.func
    def motion(body: Body, fields: Fields, lane: int):
        kinetic = empty_sum()
        n = sum_first(lane)
        while n < body.n_nodes:
            at = place_of(body, n)
            squared = fields.v_r[at] * fields.v_r[at] + fields.v_y[at] * fields.v_y[at]
            kinetic = add_to(kinetic, wp.float64(half * number(body.masses, 0, n) * squared), n)
            n += n_workers()
        return kinetic

    @wp.func
    def strain(body: Body, limit: real, fields: Fields, lane: int):
        past = real(0.0)
        e = first_element(lane, body.n_elements)
        end = end_element(body.n_elements)
        while e < end:
            q = nodes(body, e)
            _jacobian, s = element_strains(
                read_shape(body.shapes, e, 0), values(fields.u_r, q), values(fields.u_y, q)
            )
            if s > limit:
                past = wp.max(past, s)
            e += n_workers()
        return wp.float64(past)

    @wp.func
    def worst_of_lane(
        body: Body, solid: Solid, row: wp.array(dtype=real), fields: Fields, lane: int, status: int
    ):
        best, place = wp.float64(least), int(-1)
        e = lane
        while e < body.n_elements:
            q = nodes(body, e)
            shape = read_shape(body.shapes, e, 1)
            ur = values(fields.u_r, q)
            uy = values(fields.u_y, q)
            vr = values(fields.v_r, q)
            vy = values(fields.v_y, q)
            jacobian, s = element_strains(shape, ur, uy)
            _f_r, _f_y, omega_squared, _power, _artificial = element_forces(
                shape, solid, row, ur, uy, vr, vy, 1
            )
            score = omega_squared  # STEP_COLLAPSED, STEP_LIMIT: the shortest stable step
            if status == inverted:
                score = -jacobian
            elif status == exceeded:
                score = s
            elif status == diverged:
                score = wp.dot(vr, vr) + wp.dot(vy, vy)
            finite = wp.float64(score)
            if not wp.isfinite(finite):
                finite = wp.float64(most)
            if finite > best:
                best = finite
                place = e
            e += wp.block_dim()
        return best, place

    @wp.func
    def failed_element(
        body: Body,
        solid: Solid,
        row: wp.array(dtype=real),
        fields: Fields,
        partials: wp.array(dtype=wp.float64),
        lane: int,
        status: int,
    ):
        score, worst = worst_of_lane(body, solid, row, fields, lane, status)
        put_largest(partials, Total.MOST, score)
        sync()
        candidate = wp.float64(nobody)
        if score == get_largest(partials, Total.MOST):
            candidate = -wp.float64(worst)
        put_largest(partials, Total.TURNED, candidate)
        sync()
        return int(-get_largest(partials, Total.TURNED))

    return FailureFunctions(motion, strain, failed_element)
