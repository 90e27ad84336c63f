"""Run a batch: from a constant `Model` and its `Samples` to a `Response`, on a CPU or a CUDA device."""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, as_completed
from typing import Any

import numpy as np
import warp as wp

from explicit.boundary import BAR_HISTORY, LOWER, SIDE, UPPER
from explicit.device import select_device
from explicit.elements import element
from explicit.energy import EnergyLedger
from explicit.geometry import element_geometry
from explicit.march import MarchKernel, march_kernel
from explicit.materials import bulk_modulus
from explicit.model import Model, Samples, Sampling, Stepping
from explicit.outcome import Outcome
from explicit.precision import Precision, precision
from explicit.response import Response

BLOCK = 256
"""Threads that share one simulation on a GPU."""


def run(
    model: Model,
    samples: Samples,
    sampling: Sampling,
    *,
    stepping: Stepping | None = None,
    device: str = "cpu",
    threads: int | None = None,
    progress: Callable[[int], None] | None = None,
) -> Response:
    """Simulate every sample of a batch.

    Parameters
    ----------
    model, samples, sampling
        What to simulate, with which parameters, and what to record.
    stepping : Stepping, optional
        Numerical choices of the time loop; default `Stepping()`.
    device : str
        "cpu", or a CUDA device such as "cuda" or "cuda:0".
    threads : int, optional
        CPU threads; default all cores. A result does not depend on it.
    progress : callable, optional
        Called with the number of simulations finished since the last call.

    Returns
    -------
    Response
        One row per sample. A simulation that ends early has its `Outcome` and NaN after its end; it
        does not disturb its neighbours.

    Raises
    ------
    ValueError
        If a requested time is before the model's start, or a sample names a material or motion the
        model does not have.
    """
    stepping = stepping or Stepping()
    _check(model, samples, sampling)
    numbers = precision(stepping.precision)
    where = select_device(device)
    kernel = march_kernel(type(model.materials[0]), model.faces, model.side, numbers, model.element)
    nodes = np.arange(model.mesh.n_nodes) if sampling.all_nodes else model.mesh.side
    body = _body(kernel, model, numbers, where)
    batch = _batch(kernel, model, samples, stepping, numbers, where)
    state = _state(kernel, model, len(samples), numbers, where)
    output = _output(kernel, len(samples), sampling, nodes, where)
    if where.is_cuda:
        wp.launch(
            kernel.kernel,
            dim=(len(samples), BLOCK),
            inputs=[body, batch, state, output, 0],
            device=where,
            block_dim=BLOCK,
        )
        wp.synchronize_device(where)
        if progress:
            progress(len(samples))
    else:
        wp.load_module(kernel.kernel.module, device=where, block_dim=1)
        workers = min(threads or os.cpu_count() or 1, len(samples))

        def one(sample: int) -> None:
            wp.launch(
                kernel.kernel,
                dim=(1, 1),
                inputs=[body, batch, state, output, sample],
                device=where,
                block_dim=1,
            )

        with ThreadPoolExecutor(workers) as pool:
            for done in as_completed([pool.submit(one, i) for i in range(len(samples))]):
                done.result()
                if progress:
                    progress(1)
    return _response(model, sampling, output, nodes)


def _check(model: Model, samples: Samples, sampling: Sampling) -> None:
    first = min(float(sampling.force_times[0]), float(sampling.surface_times[0]))
    if first < model.start:
        raise ValueError(f"requested time {first:.9g} s is before the model's start {model.start:.9g} s")
    for name, index, count in (
        ("material", samples.material, len(model.materials)),
        ("motion", samples.motion, len(model.motions)),
    ):
        wrong = index[(index < 0) | (index >= count)]
        if wrong.size:
            raise ValueError(f"a sample names {name} {wrong[0]}, the model has 0 to {count - 1}")


def _body(kernel: MarchKernel, model: Model, numbers: Precision, where: Any) -> Any:
    mesh, geometry = model.mesh, element_geometry(model.mesh)
    corner_mass = model.density * geometry.corner_volume
    mass = np.zeros(mesh.n_nodes)
    np.add.at(mass, mesh.quads.ravel(), corner_mass.ravel())
    shapes = element(model.element).shapes(mesh, model.density, kernel.element.Shape.numpy_dtype())
    kind = np.zeros(mesh.n_nodes, dtype=np.int32)
    kind[mesh.side] = SIDE
    kind[mesh.lower_face] = LOWER
    kind[mesh.upper_face] = UPPER
    start, corner = mesh.corners_of_node
    body = kernel.structs.Body()
    body.n_elements, body.n_nodes, body.length = mesh.n_elements, mesh.n_nodes, mesh.length
    body.shapes = wp.array(shapes, dtype=kernel.element.Shape, device=where)
    body.quads = wp.array(mesh.quads.astype(np.int32), dtype=wp.vec4i, device=where)
    body.first_corner = wp.array(start.astype(np.int32), dtype=int, device=where)
    body.corners = wp.array(corner.astype(np.int32), dtype=int, device=where)
    body.reference_r = wp.array(mesh.nodes[:, 0], dtype=wp.float64, device=where)
    body.reference_y = wp.array(mesh.nodes[:, 1] - mesh.nodes[:, 1].min(), dtype=wp.float64, device=where)
    body.mass = wp.array(mass, dtype=numbers.real, device=where)
    body.inverse_mass = wp.array(1.0 / mass, dtype=numbers.real, device=where)
    body.on_axis = wp.array(mesh.on_axis.astype(np.int32), dtype=int, device=where)
    body.kind = wp.array(kind, dtype=int, device=where)
    return body


def _batch(
    kernel: MarchKernel, model: Model, samples: Samples, stepping: Stepping, numbers: Precision, where: Any
) -> Any:
    mu = np.array([law.initial_shear_modulus for law in model.materials])[samples.material]
    mu = mu * samples.stiffness_factor
    bulk = bulk_modulus(mu, samples.poisson)
    solids = np.zeros(len(samples), dtype=kernel.element.Solid.numpy_dtype())
    solids["scale"] = samples.stiffness_factor
    solids["bulk"] = bulk
    solids["hourglass"] = model.hourglass * mu
    solids["shear_viscosity"] = samples.damping * mu
    solids["bulk_viscosity"] = samples.damping * bulk if model.damping_kind == "full" else 0.0
    solids["hourglass_viscosity"] = model.hourglass * samples.damping * mu
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


def _state(kernel: MarchKernel, model: Model, n: int, numbers: Precision, where: Any) -> Any:
    mesh = model.mesh
    state = kernel.structs.State()
    for name in ("u_r", "u_y", "v_r", "v_y"):
        setattr(state, name, wp.zeros((n, mesh.n_nodes), dtype=numbers.real, device=where))
    state.corner_r = wp.zeros((n, 4 * mesh.n_elements), dtype=numbers.real, device=where)
    state.corner_y = wp.zeros((n, 4 * mesh.n_elements), dtype=numbers.real, device=where)
    touched = np.zeros((n, mesh.n_nodes), dtype=np.int32)
    touched[:, mesh.lower_face] = 1
    touched[:, mesh.upper_face] = 1
    state.touched = wp.array(touched, dtype=int, device=where)
    state.bar_wave = wp.zeros((n, 2 * BAR_HISTORY), dtype=wp.float64, device=where)
    return state


def _output(kernel: MarchKernel, n: int, sampling: Sampling, nodes: Any, where: Any) -> Any:
    n_force, n_surface = len(sampling.force_times), len(sampling.surface_times)
    output = kernel.structs.Output()
    output.force_times = wp.array(sampling.force_times, dtype=wp.float64, device=where)
    output.surface_times = wp.array(sampling.surface_times, dtype=wp.float64, device=where)
    output.nodes = wp.array(nodes.astype(np.int32), dtype=int, device=where)
    nan = float("nan")  # what the time loop does not reach stays marked, beside its Outcome
    for name, shape in (
        ("force", (n, n_force, 2)),
        ("impulse", (n, n_force, 2)),
        ("position", (n, n_surface, len(nodes), 2)),
        ("energy", (n, n_surface, 7)),
    ):
        setattr(output, name, wp.full(shape, nan, dtype=wp.float64, device=where))
    output.outcome = wp.zeros(n, dtype=int, device=where)
    output.steps = wp.zeros(n, dtype=int, device=where)
    for name in ("end_time", "smallest_step", "past_data", "strain_measure"):
        setattr(output, name, wp.zeros(n, dtype=wp.float64, device=where))
    return output


def _response(model: Model, sampling: Sampling, output: Any, nodes: Any) -> Response:
    force, impulse = output.force.numpy().copy(), output.impulse.numpy().copy()
    position, energy = output.position.numpy().copy(), output.energy.numpy().copy()
    side = np.searchsorted(nodes, model.mesh.side) if sampling.all_nodes else slice(None)
    return Response(
        force_times=sampling.force_times.copy(),
        force_flyer=force[:, :, 0],
        force_transmission=force[:, :, 1],
        impulse_flyer=impulse[:, :, 0],
        impulse_transmission=impulse[:, :, 1],
        surface_times=sampling.surface_times.copy(),
        surface_r=position[:, :, side, 0],
        surface_y=position[:, :, side, 1],
        energy=EnergyLedger(*(energy[:, :, k] for k in range(7))),
        outcomes=tuple(Outcome(int(code)) for code in output.outcome.numpy()),
        end_times=output.end_time.numpy().copy(),
        steps=output.steps.numpy().astype(np.int64),
        smallest_step=output.smallest_step.numpy().copy(),
        extrapolated_share=output.past_data.numpy() / element_geometry(model.mesh).volume.sum(),
        largest_strain_measure=output.strain_measure.numpy().copy(),
        nodes=position if sampling.all_nodes else None,
    )
