"""The arguments of the time loop on a device: constant body and batch, varying state, room for the output."""

from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from explicit.boundary import BAR_HISTORY, INTERIOR, LOWER, SIDE, UPPER
from explicit.elements import element
from explicit.geometry import element_geometry
from explicit.lanes import fits_on_chip
from explicit.march import MarchKernel
from explicit.materials import bulk_modulus
from explicit.model import Model, Samples, Sampling, Stepping
from explicit.precision import Precision

SPARE = 16
"""Entries behind every row that a pack may read: the most lanes there are."""


def body_of(kernel: MarchKernel, model: Model, numbers: Precision, where: Any) -> Any:
    """The mesh's constants."""
    mesh, geometry = model.mesh, element_geometry(model.mesh)
    corner_mass = model.density * geometry.corner_volume
    mass = np.zeros(mesh.n_nodes)
    np.add.at(mass, mesh.quads.ravel(), corner_mass.ravel())
    shapes = element(model.element).shapes(mesh, model.density, kernel.element.Shape.numpy_dtype())
    kind = np.full(mesh.n_nodes, INTERIOR, dtype=np.int32)
    kind[mesh.side] = SIDE
    kind[mesh.lower_face] = LOWER
    kind[mesh.upper_face] = UPPER
    on_boundary = kind != INTERIOR
    start, corner = mesh.corners_of_node
    corner = corner % 4 * mesh.n_elements + corner // 4  # corner by corner, elements side by side
    body = kernel.structs.Body()
    body.n_elements, body.n_nodes, body.length = mesh.n_elements, mesh.n_nodes, mesh.length
    body.n_seats = int(on_boundary.sum())
    body.on_chip = int(fits_on_chip(mesh.n_nodes, mesh.n_elements, body.n_seats, numbers.dtype().itemsize))
    for name, values, dtype in (
        ("shapes", _side_by_side(shapes, numbers.dtype), numbers.real),
        ("quads", np.ascontiguousarray(mesh.quads.T), int),
        ("first_corner", start, int),
        ("corners", corner, int),
        ("reference_r", mesh.nodes[:, 0], wp.float64),
        ("reference_y", mesh.nodes[:, 1] - mesh.nodes[:, 1].min(), wp.float64),
        ("mass", mass, numbers.real),
        ("inverse_mass", 1.0 / mass, numbers.real),
        ("on_axis", mesh.on_axis, int),
        ("kind", kind, int),
        ("seat", np.where(on_boundary, np.cumsum(on_boundary) - 1, -1), int),
    ):
        setattr(body, name, wp.array(_spare(values), dtype=dtype, device=where))
    return body


def _spare(values: NDArray[Any]) -> NDArray[Any]:
    """An array with room behind every row: a pack that begins inside may reach past the end."""
    kind = np.int32 if values.dtype.kind in "ib" else np.float64
    return np.pad(values.astype(kind), [(0, 0)] * (values.ndim - 1) + [(0, SPARE)])


def _side_by_side(shapes: NDArray[Any], dtype: Any) -> NDArray[Any]:
    """The numbers of structs, shape [numbers of a struct, n_elements]."""
    numbers = shapes.view(dtype).reshape(len(shapes), -1)
    if shapes.dtype.itemsize != numbers.shape[1] * numbers.dtype.itemsize:
        raise TypeError("an element's shape must consist of real numbers alone")
    return numbers.T


def batch_of(
    kernel: MarchKernel,
    model: Model,
    samples: Samples,
    sampling: Sampling,
    stepping: Stepping,
    numbers: Precision,
    where: Any,
) -> Any:
    """Per-sample parameters and the tables they choose from."""
    mu = np.array([law.initial_shear_modulus for law in model.materials])[samples.material]
    mu = mu * samples.stiffness_factor
    bulk = bulk_modulus(mu, samples.poisson)
    solids = np.zeros(len(samples), dtype=kernel.element.Solid.numpy_dtype())
    solids["scale"] = samples.stiffness_factor
    solids["bulk"] = bulk
    stiff = model.hourglass if model.hourglass_form == "stiffness" else 0.0
    solids["hourglass"] = stiff * mu
    solids["shear_viscosity"] = samples.damping * mu
    solids["bulk_viscosity"] = samples.damping * bulk if model.damping_kind == "full" else 0.0
    solids["hourglass_viscosity"] = stiff * samples.damping * mu
    solids["hourglass_impedance"] = 2.0 * (model.hourglass - stiff) * np.sqrt(mu)
    solids["mass_damping"] = samples.mass_damping
    rows = [law.parameters() for law in model.materials]
    table = np.zeros((len(rows), max(len(row) for row in rows)))
    for i, row in enumerate(rows):
        table[i, : len(row)] = row
    n_knots = max(len(motion.position) for motion in model.motions)
    motions = np.empty((len(model.motions), n_knots, 2))
    for i, motion in enumerate(model.motions):
        if len(motion.position) != n_knots:
            raise ValueError("the motions of a model need equally many knots")
        motions[i] = np.column_stack([motion.position, motion.velocity])
    batch = kernel.structs.Batch()
    batch.start, batch.safety, batch.floor = model.start, stepping.safety, stepping.floor
    batch.largest_step = min(stepping.largest_step, 1.0)
    batch.measure_every, batch.max_steps = stepping.measure_every, stepping.max_steps
    batch.ledger_every = sampling.ledger_every
    batch.impedance = min(model.support.impedance, 1e300)
    batch.round_trip = min(model.support.round_trip, 1e300)
    limits = np.minimum([law.data_limit for law in model.materials], 1e30)
    batch.data_limit = wp.array(limits, dtype=numbers.real, device=where)
    batch.solids = wp.array(solids, dtype=kernel.element.Solid, device=where)
    batch.friction = wp.array(samples.friction, dtype=numbers.real, device=where)
    batch.material = wp.array(samples.material.astype(np.int32), dtype=int, device=where)
    batch.rows = wp.array(table, dtype=numbers.real, device=where)
    batch.motion = wp.array(samples.motion.astype(np.int32), dtype=int, device=where)
    batch.motion_step = wp.array([m.step for m in model.motions], dtype=wp.float64, device=where)
    batch.motion_table = wp.array(motions, dtype=wp.float64, device=where)
    return batch


def state_of(kernel: MarchKernel, model: Model, numbers: Precision, where: Any, rows: int, lanes: int) -> Any:
    """Fields that vary, at rest, of `rows` simulations one after the other or of `lanes` side by side."""
    mesh = model.mesh
    state = kernel.structs.State()

    def shape(n: int) -> tuple[int, int]:
        return (n, lanes) if lanes > 1 else (rows, n + SPARE)

    for name in ("u_r", "u_y", "v_r", "v_y"):
        setattr(state, name, wp.zeros(shape(mesh.n_nodes), dtype=numbers.real, device=where))
    for name in ("corner_r", "corner_y"):
        setattr(state, name, wp.zeros(shape(4 * mesh.n_elements), dtype=numbers.real, device=where))
    for name in ("push_lower", "push_upper", "carried"):
        setattr(state, name, wp.zeros(shape(mesh.n_nodes), dtype=wp.float64, device=where))
    touched = np.zeros(mesh.n_nodes, dtype=np.int32)
    touched[mesh.lower_face] = 1
    touched[mesh.upper_face] = 1
    marks = np.repeat(touched[:, None], lanes, axis=1) if lanes > 1 else np.tile(_spare(touched), (rows, 1))
    state.touched = wp.array(marks, dtype=int, device=where)
    state.bar_wave = wp.zeros(shape(2 * BAR_HISTORY), dtype=wp.float64, device=where)
    return state


def output_of(kernel: MarchKernel, n: int, sampling: Sampling, nodes: Any, where: Any) -> Any:
    """Room for the histories, NaN where a simulation does not get to."""
    n_force, n_surface = len(sampling.force_times), len(sampling.surface_times)
    output = kernel.structs.Output()
    output.force_times = wp.array(sampling.force_times, dtype=wp.float64, device=where)
    output.surface_times = wp.array(sampling.surface_times, dtype=wp.float64, device=where)
    output.n_recorded = len(nodes)
    output.nodes = wp.array(_spare(nodes), dtype=int, device=where)
    nan = float("nan")  # what the time loop does not reach stays marked, beside its Outcome
    for name, shape in (
        ("force", (n, n_force, 2)),
        ("impulse", (n, n_force, 2)),
        ("position", (n, n_surface, len(nodes), 2)),
        ("energy", (n, n_surface, 8)),
    ):
        setattr(output, name, wp.full(shape, nan, dtype=wp.float64, device=where))
    output.outcome = wp.zeros(n, dtype=int, device=where)
    output.steps = wp.zeros(n, dtype=int, device=where)
    for name in ("end_time", "smallest_step", "past_data", "strain_measure"):
        setattr(output, name, wp.zeros(n, dtype=wp.float64, device=where))
    return output
