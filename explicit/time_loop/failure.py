"""Failure of a simulation: its signs while the loop runs, and the element where it happened.

None of this is part of a step. Every `CHECK_EVERY` steps the time loop asks for the specimen's motion; where
a run is to stop at the end of the material's data, it asks for the strain at every step; once, after its end,
a simulation that failed is searched for the element.

A run has *diverged* when the specimen moves with more energy than the platens ever gave it. It starts at rest
and stores no less than nothing, so

    E_kin(t) <= max over t' <= t of W(t')

whatever the material, the mesh and the contact; `MOTION_LIMIT` leaves room for the error of the time step. An
unstable step feeds its motion from nowhere, and a law whose energy falls with strain feeds it from a store
that has no bottom: both pass the limit within a few steps of being seen, long before a number overflows.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any

import warp as wp

from explicit.elements import ElementFunctions
from explicit.outcome import Outcome
from explicit.precision import Precision
from explicit.time_loop.element_sweeps import corner_functions
from explicit.time_loop.grouped_tables import entry_function
from explicit.time_loop.lanes import LaneFunctions
from explicit.time_loop.slots import Total
from explicit.time_loop.state_layout import StateLayout
from explicit.time_loop.structs import Structs, simulation_structs

CHECK_EVERY = 8
"""Steps between two checks of a simulation: a divergence or a turned element is noticed at most so many steps
late."""
MOTION_LIMIT = 2.0
"""Kinetic energy over the largest work of the platens so far at which a simulation has diverged [-]; energy
is kept to 0.1 % (verification manual), so that no sound run comes near."""
STRAY_ENERGY = 1e-6
"""Kinetic energy that is never called motion, over mu_0 V [-]: that of a strain of 1e-3. A specimen that
waits for the flyer may tremble with round-off though no platen has worked on it yet."""


@dataclass(frozen=True)
class FailureFunctions:
    """Checks of the time loop beside its steps."""

    motion: Any
    """``motion(body, fields, lane)``: this worker's share of the kinetic energy [J], a sum that begins with
    ``empty_sum``."""
    strain: Any
    """``strain(body, limit, fields, lane)``: the largest s of this worker's elements past the data limit of
    their law, or 0 [-]."""
    failed_element: Any
    """``failed_element(body, solid, row, fields, partials, lane, status)``: the element that answers most for
    a failure, of equal ones the first; one whose number is not finite beats all others. Every lane calls
    it."""


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
                read_shape(body.shapes, e, 0),
                values(fields.u_r, q),
                values(fields.u_y, q),
            )
            if s > limit:
                past = wp.max(past, s)
            e += n_workers()
        return wp.float64(past)

    @wp.func
    def worst_of_lane(
        body: Body,
        solid: Solid,
        row: wp.array(dtype=real),
        fields: Fields,
        lane: int,
        status: int,
    ):
        best, found = wp.float64(least), int(-1)
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
            known = wp.float64(score)
            if not wp.isfinite(known):
                known = wp.float64(most)
            if known > best:
                best = known
                found = e
            e += wp.block_dim()
        return best, found

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
