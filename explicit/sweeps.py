"""The two sweeps over a simulation's elements: corner forces, and energies at the times of the ledger."""

from dataclasses import dataclass
from functools import cache
from typing import Any

import warp as wp

from explicit.elements import ElementFunctions
from explicit.lanes import field_function, lane_functions
from explicit.precision import Precision
from explicit.structs import Structs


@dataclass(frozen=True)
class SweepFunctions:
    """The sweeps of one law and precision."""

    elements: Any
    """``elements(body, batch, state, sample, lane, measure) -> (omega_squared, power, artificial)``."""
    energies: Any
    """``energies(body, batch, state, sample, lane) -> (elastic, hourglass, volume past data, s)``."""


@cache
def sweep_functions(precision: Precision, element: ElementFunctions, structs: Structs) -> SweepFunctions:
    """Generate the sweeps."""
    real, vec4 = precision.real, precision.vec4
    Body, Batch, State = structs.Body, structs.Batch, structs.State
    lanes = lane_functions()
    empty_sum, add_to, field = lanes.empty_sum, lanes.add_to, field_function(precision)
    read_shape = element.read_shape
    element_forces, element_energies = element.forces, element.energies

    @wp.func
    def sweep_elements(body: Body, batch: Batch, state: State, sample: int, lane: int, measure: int):
        """Corner forces of this lane's elements; the largest omega^2; powers lost, as of the element."""
        solid = batch.solids[sample]
        row = batch.rows[batch.material[sample]]
        nodes, chip = body.n_nodes, body.on_chip
        u_r, u_y = field(state.u_r, sample, chip, 0), field(state.u_y, sample, chip, nodes)
        v_r, v_y = field(state.v_r, sample, chip, 2 * nodes), field(state.v_y, sample, chip, 3 * nodes)
        corner_r = field(state.corner_r, sample, chip, 4 * nodes)
        corner_y = field(state.corner_y, sample, chip, 4 * nodes + 4 * body.n_elements)
        worst, power, artificial = real(0.0), empty_sum(), empty_sum()
        e = lane
        while e < body.n_elements:
            q = wp.vec4i(body.quads[0, e], body.quads[1, e], body.quads[2, e], body.quads[3, e])
            f_r, f_y, omega_squared, dissipated, controlled = element_forces(
                read_shape(body.shapes, e),
                solid,
                row,
                vec4(u_r[q[0]], u_r[q[1]], u_r[q[2]], u_r[q[3]]),
                vec4(u_y[q[0]], u_y[q[1]], u_y[q[2]], u_y[q[3]]),
                vec4(v_r[q[0]], v_r[q[1]], v_r[q[2]], v_r[q[3]]),
                vec4(v_y[q[0]], v_y[q[1]], v_y[q[2]], v_y[q[3]]),
                measure,
            )
            for a in range(4):
                corner_r[a * body.n_elements + e] = f_r[a]
                corner_y[a * body.n_elements + e] = f_y[a]
            worst = wp.max(worst, omega_squared)
            power = add_to(power, wp.float64(dissipated), e)
            artificial = add_to(artificial, wp.float64(controlled), e)
            e += wp.block_dim()
        return wp.float64(worst), power, artificial

    @wp.func
    def sweep_energies(body: Body, batch: Batch, state: State, sample: int, lane: int):
        """Strain and hourglass energy, volume past the data and the largest s of this lane's elements."""
        solid = batch.solids[sample]
        row = batch.rows[batch.material[sample]]
        limit_s = batch.data_limit[batch.material[sample]]
        chip = body.on_chip
        u_r, u_y = field(state.u_r, sample, chip, 0), field(state.u_y, sample, chip, body.n_nodes)
        elastic, hourglass, past = empty_sum(), empty_sum(), empty_sum()
        most = real(0.0)
        e = lane
        while e < body.n_elements:
            q = wp.vec4i(body.quads[0, e], body.quads[1, e], body.quads[2, e], body.quads[3, e])
            shape = read_shape(body.shapes, e)
            w, h, s = element_energies(
                shape,
                solid,
                row,
                vec4(u_r[q[0]], u_r[q[1]], u_r[q[2]], u_r[q[3]]),
                vec4(u_y[q[0]], u_y[q[1]], u_y[q[2]], u_y[q[3]]),
            )
            elastic = add_to(elastic, wp.float64(w), e)
            hourglass = add_to(hourglass, wp.float64(h), e)
            most = wp.max(most, s)
            if s > limit_s:
                past = add_to(past, wp.float64(shape.volume), e)
            e += wp.block_dim()
        return elastic, hourglass, past, wp.float64(most)

    return SweepFunctions(sweep_elements, sweep_energies)
