"""The two sweeps over a simulation's elements: corner forces, and energies at the times of the ledger."""

from dataclasses import dataclass
from functools import cache
from typing import Any

import warp as wp

from explicit.elements import ElementFunctions
from explicit.precision import Precision
from explicit.time_loop.grouped_tables import entries_function
from explicit.time_loop.lanes import LaneFunctions
from explicit.time_loop.slots import Share
from explicit.time_loop.state_layout import StateLayout
from explicit.time_loop.structs import Structs, simulation_structs


@dataclass(frozen=True)
class CornerFunctions:
    """Functions of an element's corners, for the sweeps."""

    nodes: Any
    """``nodes(body, e) -> vec4i``: the corner nodes of element e."""
    values: Any
    """``values(field, corners) -> vec4``: a field there."""


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
    lost, restrained = int(Share.POWER), int(Share.ARTIFICIAL)
    corner = corner_functions(precision, structs)
    nodes, values = corner.nodes, corner.values
    read_shape, corner_stride, place_of = element.read_shape, layout.corner_stride, layout.element
    element_forces, element_energies = element.forces, element.energies

    @wp.func
    def sweep_elements(
        body: Body,
        solid: Solid,
        row: wp.array(dtype=real),
        fields: Fields,
        lane: int,
        measure: int,
    ):
        """Corner forces of this lane's elements; the largest omega^2; powers lost, as of the element."""
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
            power = add_share(power, lost, wp.float64(dissipated), e)
            artificial = add_share(artificial, restrained, wp.float64(controlled), e)
            e += n_workers()
        return wp.float64(worst), power, artificial

    @wp.func
    def sweep_energies(
        body: Body,
        solid: Solid,
        row: wp.array(dtype=real),
        limit_s: real,
        fields: Fields,
        lane: int,
    ):
        """Strain and hourglass energy, volume past the data and the largest s of this lane's elements."""
        elastic, hourglass, past = empty_sum(), empty_sum(), empty_sum()
        most = real(0.0)
        e = sum_first(lane)
        while e < body.n_elements:
            q = nodes(body, e)
            shape = read_shape(body.shapes, e, 0)
            w, h, s = element_energies(
                shape,
                solid,
                row,
                values(fields.u_r, q),
                values(fields.u_y, q),
            )
            elastic = add_to(elastic, wp.float64(w), e)
            hourglass = add_to(hourglass, wp.float64(h), e)
            most = wp.max(most, s)
            if s > limit_s:
                past = add_to(past, wp.float64(shape.volume), e)
            e += n_workers()
        return elastic, hourglass, past, wp.float64(most)

    return SweepFunctions(sweep_elements, sweep_energies)
