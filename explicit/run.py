"""Run a batch: from a constant `Model` and its `Samples` to a `Response`, on a CPU or a CUDA device."""

import os
from collections.abc import Callable
from typing import Any

import numpy as np

from explicit.arguments import batch_of, output_of
from explicit.device import select_device
from explicit.drivers import Plan, run_in_lanes, run_on_gpu
from explicit.energy import EnergyLedger
from explicit.geometry import element_geometry
from explicit.march import march_kernel
from explicit.model import Model, Samples, Sampling, Stepping
from explicit.outcome import Outcome
from explicit.precision import precision
from explicit.response import Response


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
    nodes = np.arange(model.mesh.n_nodes) if sampling.all_nodes else model.mesh.side
    kernel = march_kernel(type(model.materials[0]), model.faces, model.side, numbers, model.element)
    output = output_of(kernel, len(samples), sampling, nodes, where)
    batch = batch_of(kernel, model, samples, sampling, stepping, numbers, where)
    plan = Plan(kernel, model, numbers, where, batch, output, len(samples))
    if where.is_cuda:
        run_on_gpu(plan, progress)
    else:
        run_in_lanes(plan, threads or os.cpu_count() or 1, progress)
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
        energy=EnergyLedger(*(energy[:, :, k] for k in range(8))),
        outcomes=tuple(Outcome(int(code)) for code in output.outcome.numpy()),
        end_times=output.end_time.numpy().copy(),
        steps=output.steps.numpy().astype(np.int64),
        smallest_step=output.smallest_step.numpy().copy(),
        extrapolated_share=output.past_data.numpy() / element_geometry(model.mesh).volume.sum(),
        largest_strain_measure=output.strain_measure.numpy().copy(),
        nodes=position if sampling.all_nodes else None,
    )
