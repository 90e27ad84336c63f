"""Watching a simulation for its failure, and finding the element where it happened.

None of this is part of a step. Every `WATCH_EVERY` steps the time loop asks for the specimen's motion; where
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
from explicit.lanes import field_function, lane_functions
from explicit.outcome import Outcome
from explicit.precision import Precision
from explicit.structs import Structs

WATCH_EVERY = 8
"""Steps between two looks at a simulation: a divergence or a turned element is noticed at most so many steps
late."""
MOTION_LIMIT = 2.0
"""Kinetic energy over the largest work of the platens so far at which a simulation has diverged [-]; energy
is kept to 0.1 % (verification manual), so that no sound run comes near."""
STRAY_ENERGY = 1e-6
"""Kinetic energy that is never called motion, over mu_0 V [-]: that of a strain of 1e-3. A specimen that
waits for the flyer may tremble with round-off though no platen has worked on it yet."""


@dataclass(frozen=True)
class FailureFunctions:
    """What the time loop asks beside its steps."""

    motion: Any
    """``motion(body, state, sample, lane)``: this lane's share of the kinetic energy [J], a sum that begins
    with ``empty_sum``."""
    strain: Any
    """``strain(body, batch, state, sample, lane)``: the largest s of this lane's elements past the data limit
    of their law, or 0 [-]."""
    culprit: Any
    """``culprit(body, batch, state, sample, lane, status) -> (score, element)``: which of this lane's
    elements answers most for a failure; a number that is not finite beats all others."""


@cache
def failure_functions(precision: Precision, element: ElementFunctions, structs: Structs) -> FailureFunctions:
    """Generate the functions."""
    real, vec4 = precision.real, precision.vec4
    Body, Batch, State = structs.Body, structs.Batch, structs.State
    lanes = lane_functions()
    empty_sum, add_to, field = lanes.empty_sum, lanes.add_to, field_function(precision)
    read_shape, element_forces, element_strains = element.read_shape, element.forces, element.strains
    half = real(0.5)
    least, most = wp.float64(-1e300), wp.float64(1e300)
    inverted, diverged = int(Outcome.INVERTED), int(Outcome.DIVERGED)
    exceeded = int(Outcome.TABLE_EXCEEDED)

    @wp.func
    def motion(body: Body, state: State, sample: int, lane: int):
        nodes, chip = body.n_nodes, body.on_chip
        v_r, v_y = field(state.v_r, sample, chip, 2 * nodes), field(state.v_y, sample, chip, 3 * nodes)
        kinetic = empty_sum()
        n = lane
        while n < body.n_nodes:
            squared = v_r[n] * v_r[n] + v_y[n] * v_y[n]
            kinetic = add_to(kinetic, wp.float64(half * body.mass[n] * squared), n)
            n += wp.block_dim()
        return kinetic

    @wp.func
    def strain(body: Body, batch: Batch, state: State, sample: int, lane: int):
        limit = batch.data_limit[batch.material[sample]]
        chip = body.on_chip
        u_r, u_y = field(state.u_r, sample, chip, 0), field(state.u_y, sample, chip, body.n_nodes)
        past = real(0.0)
        e = lane
        while e < body.n_elements:
            q = wp.vec4i(body.quads[0, e], body.quads[1, e], body.quads[2, e], body.quads[3, e])
            _jacobian, s = element_strains(
                read_shape(body.shapes, e),
                vec4(u_r[q[0]], u_r[q[1]], u_r[q[2]], u_r[q[3]]),
                vec4(u_y[q[0]], u_y[q[1]], u_y[q[2]], u_y[q[3]]),
            )
            if s > limit:
                past = wp.max(past, s)
            e += wp.block_dim()
        return wp.float64(past)

    @wp.func
    def culprit(body: Body, batch: Batch, state: State, sample: int, lane: int, status: int):
        solid = batch.solids[sample]
        row = batch.rows[batch.material[sample]]
        nodes, chip = body.n_nodes, body.on_chip
        u_r, u_y = field(state.u_r, sample, chip, 0), field(state.u_y, sample, chip, nodes)
        v_r, v_y = field(state.v_r, sample, chip, 2 * nodes), field(state.v_y, sample, chip, 3 * nodes)
        best, place = wp.float64(least), int(-1)
        e = lane
        while e < body.n_elements:
            q = wp.vec4i(body.quads[0, e], body.quads[1, e], body.quads[2, e], body.quads[3, e])
            shape = read_shape(body.shapes, e)
            ur = vec4(u_r[q[0]], u_r[q[1]], u_r[q[2]], u_r[q[3]])
            uy = vec4(u_y[q[0]], u_y[q[1]], u_y[q[2]], u_y[q[3]])
            vr = vec4(v_r[q[0]], v_r[q[1]], v_r[q[2]], v_r[q[3]])
            vy = vec4(v_y[q[0]], v_y[q[1]], v_y[q[2]], v_y[q[3]])
            jacobian, s = element_strains(shape, ur, uy)
            _f_r, _f_y, omega_squared, _power = element_forces(shape, solid, row, ur, uy, vr, vy, 1)
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
                place = e
            e += wp.block_dim()
        return best, place

    return FailureFunctions(motion, strain, culprit)
