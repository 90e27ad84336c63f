"""The phases of a time step as differentiable Warp kernels: corner forces, the nodes, the support.

They call the same functions of element, law and boundary as the time loop in one kernel
(`explicit.time_loop.kernel`). A kernel of their own is needed because Warp does not differentiate a loop
that carries state: here a launch is one phase of one step, and row k + 1 of every field follows from row k,
so nothing is overwritten that the reverse pass still reads.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any

import warp as wp

from explicit.elements import element as element_named
from explicit.precision import PRECISIONS
from explicit.time_loop.boundary import LOWER, UPPER, boundary_functions
from explicit.time_loop.structs import batch_structs


@dataclass(frozen=True)
class PhaseKernels:
    """The phases of one law, element and pair of contact laws, in double precision."""

    elements: Any
    """Corner forces of row k; launch with dim = n_elements."""
    nodes: Any
    """Velocities and displacements of row k + 1 and the platens' impulses; launch with dim = n_nodes."""
    support: Any
    """Motion of the transmission platen in front of a bar, row k + 1; launch with dim = 1."""


@cache
def phase_kernels(
    law: type, faces: str, side: str, element_name: str, valence: int, bound: str, volumetric: str
) -> PhaseKernels:
    """Generate the phases; `valence` is the largest number of elements that meet at a node, `bound` that of
    `explicit.model.Stepping`, `volumetric` that of `explicit.Model`."""
    precision = PRECISIONS["fp64"]
    real, vec2, vec4 = precision.real, precision.vec2, precision.vec4
    functions = element_named(element_name).functions(law, precision, bound, volumetric)
    Solid, read_shape, forces = functions.Solid, functions.read_shape, functions.forces
    structs = batch_structs(precision, functions.Shape, Solid)
    Body, Batch, State = structs.Body, structs.Batch, structs.State
    contact = boundary_functions(faces, side, precision, structs).contact
    zero, one, two = real(0.0), real(1.0), real(2.0)
    lower, upper, corners_met = int(LOWER), int(UPPER), int(valence)

    @wp.kernel(module="unique")
    def elements(
        k: int,
        measure: int,
        quads: wp.array2d(dtype=int),
        shapes: wp.array2d(dtype=real),
        solids: wp.array(dtype=Solid),
        row: wp.array(dtype=real),
        u_r: wp.array2d(dtype=real),
        u_y: wp.array2d(dtype=real),
        v_r: wp.array2d(dtype=real),
        v_y: wp.array2d(dtype=real),
        corner_r: wp.array3d(dtype=real),
        corner_y: wp.array3d(dtype=real),
        worst: wp.array(dtype=real),
    ):
        e = wp.tid()
        i, j, m, n = quads[0, e], quads[1, e], quads[2, e], quads[3, e]
        f_r, f_y, omega_squared, _power, _artificial = forces(
            read_shape(shapes, e, measure),
            solids[0],
            row,
            vec4(u_r[k, i], u_r[k, j], u_r[k, m], u_r[k, n]),
            vec4(u_y[k, i], u_y[k, j], u_y[k, m], u_y[k, n]),
            vec4(v_r[k, i], v_r[k, j], v_r[k, m], v_r[k, n]),
            vec4(v_y[k, i], v_y[k, j], v_y[k, m], v_y[k, n]),
            measure,
        )
        for a in range(4):
            corner_r[k, a, e] = f_r[a]
            corner_y[k, a, e] = f_y[a]
        wp.atomic_max(worst, 0, omega_squared)

    @wp.kernel(module="unique")
    def nodes(
        k: int,
        body: Body,
        batch: Batch,
        state: State,
        timing: wp.array2d(dtype=wp.float64),
        length: wp.float64,
        boundary_node: wp.array(dtype=int),
        element_of: wp.array2d(dtype=int),
        corner_of: wp.array2d(dtype=int),
        mass: wp.array(dtype=real),
        inverse_mass: wp.array(dtype=real),
        on_axis: wp.array(dtype=int),
        kind: wp.array(dtype=int),
        reference_y: wp.array(dtype=wp.float64),
        solids: wp.array(dtype=Solid),
        friction: wp.array(dtype=real),
        corner_r: wp.array3d(dtype=real),
        corner_y: wp.array3d(dtype=real),
        touched: wp.array2d(dtype=int),
        u_r: wp.array2d(dtype=real),
        u_y: wp.array2d(dtype=real),
        v_r: wp.array2d(dtype=real),
        v_y: wp.array2d(dtype=real),
        push: wp.array2d(dtype=wp.float64),
        lower_platen: wp.array2d(dtype=wp.float64),
        loaded: wp.array(dtype=wp.float64),
    ):
        n = wp.tid()
        dt, interval, flyer_next = timing[k, 0], timing[k, 1], timing[k, 2]
        solid = solids[0]
        # The corners are unrolled, not looped over: an absent one reads a column that stays zero.
        f_r, f_y = real(0.0), real(0.0)
        for c in range(corners_met):
            f_r += corner_r[k, corner_of[c, n], element_of[c, n]]
            f_y += corner_y[k, corner_of[c, n], element_of[c, n]]
        old = vec2(v_r[k, n], v_y[k, n])
        free = old - interval * (vec2(f_r, f_y) * inverse_mass[n] + solid.mass_damping * old)
        if on_axis[n] == 1:
            free = vec2(zero, free[1])
        new = free
        mark = touched[k, n]
        if kind[n] != 0:
            height = reference_y[n] + u_y[k, n]
            to_lower = (lower_platen[k, 0] + lower_platen[k, 1] * dt - height) / dt
            to_upper = (length - flyer_next - height) / dt
            met, platen, now = contact(
                body, batch, state, 0, boundary_node[n],
                kind[n], touched[k, n], free, to_lower, to_upper, friction[0], interval, dt,
            )  # fmt: skip
            new = met
            mark = now
            kick = mass[n] * (met[1] - free[1])
            if platen == lower:
                wp.atomic_add(push, k, 1, kick)
                if met[1] == to_lower:
                    wp.atomic_add(loaded, k, mass[n])
            elif platen == upper:
                wp.atomic_add(push, k, 0, kick)
        touched[k + 1, n] = mark
        v_r[k + 1, n] = new[0]
        v_y[k + 1, n] = new[1]
        u_r[k + 1, n] = u_r[k, n] + dt * new[0]
        u_y[k + 1, n] = u_y[k, n] + dt * new[1]

    @wp.kernel(module="unique")
    def support(
        k: int,
        timing: wp.array2d(dtype=wp.float64),
        impedance: wp.float64,
        push: wp.array2d(dtype=wp.float64),
        loaded: wp.array(dtype=wp.float64),
        returned: wp.array(dtype=wp.float64),
        lower_platen: wp.array2d(dtype=wp.float64),
        outgoing: wp.array(dtype=wp.float64),
    ):
        # As the time loop does it: v = F / Z + 2 h, together with the mass that the platen carries.
        dt, interval = timing[k, 0], timing[k, 1]
        speed = lower_platen[k, 1]
        inertia = loaded[k] / (interval * impedance)
        answer = -(push[k, 1] / interval / impedance + two * returned[k])
        new = (inertia * speed + answer) / (one + inertia)
        lower_platen[k + 1, 0] = lower_platen[k, 0] + speed * dt
        lower_platen[k + 1, 1] = new
        outgoing[k] = -new - returned[k]

    return PhaseKernels(elements, nodes, support)
