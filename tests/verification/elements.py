"""Evaluate the solver's own element functions on every element of a mesh, outside the time loop."""

from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from explicit import Mesh
from explicit.device import select_device
from explicit.elements import element
from explicit.materials import MaterialLaw, bulk_modulus
from explicit.precision import precision

FloatArray = NDArray[np.float64]


Evaluated = SimpleNamespace


@cache
def _kernel(element_name: str, precision_name: str, bound: str, law: type, volumetric: str) -> Any:
    numbers = precision(precision_name)
    functions = element(element_name).functions(law, numbers, bound, volumetric)
    forces, energies = functions.forces, functions.energies
    real, vec4 = numbers.real, numbers.vec4
    Shape, Solid = functions.Shape, functions.Solid

    @wp.kernel(module="unique", enable_backward=False)
    def every_element(
        shapes: wp.array(dtype=Shape),
        solids: wp.array(dtype=Solid),
        row: wp.array(dtype=real),
        u: wp.array2d(dtype=vec4),
        v: wp.array2d(dtype=vec4),
        corner: wp.array2d(dtype=vec4),
        numbers: wp.array2d(dtype=real),
    ):
        e = wp.tid()
        f_r, f_y, omega_squared, lost, held = forces(
            shapes[e], solids[0], row, u[e, 0], u[e, 1], v[e, 0], v[e, 1], 1
        )
        elastic, hourglass, _s = energies(shapes[e], solids[0], row, u[e, 0], u[e, 1])
        corner[e, 0] = f_r
        corner[e, 1] = f_y
        numbers[e, 0] = omega_squared
        numbers[e, 1] = lost
        numbers[e, 2] = elastic
        numbers[e, 3] = hourglass
        numbers[e, 4] = held

    return every_element, functions


def evaluate(
    element_name: str,
    mesh: Mesh,
    law: MaterialLaw,
    motion: FloatArray,
    *,
    poisson: float,
    velocity: FloatArray | None = None,
    beta: float = 0.0,
    damping_kind: str = "deviatoric",
    hourglass: float = 1.0,
    hourglass_form: str = "stiffness",
    density: float = 1.0,
    precision_name: str = "fp64",
    bound: str = "trace",
    volumetric: str = "quadratic",
) -> Evaluated:
    """Ask every element; `motion` [m] and `velocity` [m/s] of its corners have shape [n_elements, 4, 2]."""
    numbers = precision(precision_name)
    device = select_device("cpu")
    kernel, functions = _kernel(element_name, precision_name, bound, type(law), volumetric)
    mu = law.initial_shear_modulus
    bulk = float(bulk_modulus(mu, poisson))
    solid = np.zeros(1, dtype=functions.Solid.numpy_dtype())
    stiff = hourglass if hourglass_form == "stiffness" else 0.0
    solid["scale"], solid["bulk"], solid["hourglass"] = 1.0, bulk, stiff * mu
    solid["shear_viscosity"], solid["hourglass_viscosity"] = beta * mu, stiff * beta * mu
    solid["hourglass_impedance"] = 2.0 * (hourglass - stiff) * np.sqrt(mu)
    solid["bulk_viscosity"] = beta * bulk if damping_kind == "full" else 0.0
    shapes = element(element_name).shapes(mesh, density, functions.Shape.numpy_dtype())

    def by_corner(field: FloatArray) -> Any:
        values = field.transpose(0, 2, 1)  # [element, component, corner]
        return wp.array(values.astype(numbers.dtype), dtype=numbers.vec4, device=device)

    corner = wp.zeros((mesh.n_elements, 2), dtype=numbers.vec4, device=device)
    answers = wp.zeros((mesh.n_elements, 5), dtype=numbers.real, device=device)
    inputs = [
        wp.array(shapes, dtype=functions.Shape, device=device),
        wp.array(solid, dtype=functions.Solid, device=device),
        wp.array(law.parameters(), dtype=numbers.real, device=device),
        by_corner(motion),
        by_corner(np.zeros_like(motion) if velocity is None else velocity),
        corner,
        answers,
    ]
    wp.launch(kernel, dim=mesh.n_elements, inputs=inputs, device=device)
    found = answers.numpy().astype(float)
    return Evaluated(
        forces=corner.numpy().astype(float).transpose(0, 2, 1),  # corner forces [N], shape [n_elements, 4, 2]
        omega_squared=found[:, 0],  # bound for the stable step [1/s^2], shape [n_elements]
        power=found[:, 1],  # power of the damping stress [W], shape [n_elements]
        elastic=found[:, 2],  # stored energy [J], shape [n_elements]
        hourglass=found[:, 3],  # energy stored by hourglass control [J], shape [n_elements]
        artificial=found[:, 4],  # power dissipated by hourglass control [W], shape [n_elements]
    )
