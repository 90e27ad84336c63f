"""The two sweeps over a simulation's elements: corner forces, and energies at the times of the ledger."""

from dataclasses import dataclass
from functools import cache
from typing import Any

import warp as wp

from explicit.corners import corner_functions
from explicit.elements import ElementFunctions
from explicit.lanes import lane_functions
from explicit.places import Rooms
from explicit.precision import Precision
from explicit.structs import Structs


@dataclass(frozen=True)
class SweepFunctions:
    """The sweeps of one law and precision."""

    elements: Any
    """``elements(body, solid, row, u_r, u_y, v_r, v_y, corner_r, corner_y, lane, measure) -> (omega_squared,
    power, artificial)``."""
    energies: Any
    """``energies(body, solid, row, limit_s, u_r, u_y, lane) -> (elastic, hourglass, volume past data,
    s)``."""


@cache
def sweep_functions(
    precision: Precision, element: ElementFunctions, structs: Structs, place: Rooms
) -> SweepFunctions:
    """Generate the sweeps."""
    real = precision.real
    Body, Solid = structs.Body, element.Solid
    lanes = lane_functions()
    empty_sum, add_to, walkers = lanes.empty_sum, lanes.add_to, lanes.walkers
    corner = corner_functions(precision, structs)
    nodes, values = corner.nodes, corner.values
    read_shape, corner_places = element.read_shape, place.corner_places
    element_forces, element_energies = element.forces, element.energies

    @wp.func
    def sweep_elements(
        body: Body,
        solid: Solid,
        row: wp.array(dtype=real),
        u_r: wp.array(dtype=real),
        u_y: wp.array(dtype=real),
        v_r: wp.array(dtype=real),
        v_y: wp.array(dtype=real),
        corner_r: wp.array(dtype=real),
        corner_y: wp.array(dtype=real),
        lane: int,
        measure: int,
    ):
        """Corner forces of this lane's elements; the largest omega^2; powers lost, as of the element."""
        worst, power, artificial = real(0.0), empty_sum(), empty_sum()
        places = corner_places(body.n_elements)
        e = lane
        while e < body.n_elements:
            q = nodes(body, e)
            f_r, f_y, omega_squared, dissipated, controlled = element_forces(
                read_shape(body.shapes, e, measure),
                solid,
                row,
                values(u_r, q),
                values(u_y, q),
                values(v_r, q),
                values(v_y, q),
                measure,
            )
            for a in range(4):
                corner_r[a * places + e] = f_r[a]
                corner_y[a * places + e] = f_y[a]
            worst = wp.max(worst, omega_squared)
            power = add_to(power, wp.float64(dissipated), e)
            artificial = add_to(artificial, wp.float64(controlled), e)
            e += walkers()
        return wp.float64(worst), power, artificial

    @wp.func
    def sweep_energies(
        body: Body,
        solid: Solid,
        row: wp.array(dtype=real),
        limit_s: real,
        u_r: wp.array(dtype=real),
        u_y: wp.array(dtype=real),
        lane: int,
    ):
        """Strain and hourglass energy, volume past the data and the largest s of this lane's elements."""
        elastic, hourglass, past = empty_sum(), empty_sum(), empty_sum()
        most = real(0.0)
        e = lane
        while e < body.n_elements:
            q = nodes(body, e)
            shape = read_shape(body.shapes, e, 0)
            w, h, s = element_energies(
                shape,
                solid,
                row,
                values(u_r, q),
                values(u_y, q),
            )
            elastic = add_to(elastic, wp.float64(w), e)
            hourglass = add_to(hourglass, wp.float64(h), e)
            most = wp.max(most, s)
            if s > limit_s:
                past = add_to(past, wp.float64(shape.volume), e)
            e += walkers()
        return elastic, hourglass, past, wp.float64(most)

    return SweepFunctions(sweep_elements, sweep_energies)
