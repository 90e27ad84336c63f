"""The arguments of the time loop on a device: parameters of a batch, varying state, recorded output."""

from functools import cache
from math import prod
from typing import Any

import numpy as np
import warp as wp

from explicit.arrays import FloatArray
from explicit.contact import contact_law
from explicit.materials import bulk_modulus
from explicit.mesh import Mesh
from explicit.mesh_arguments import SPARE, node_order, padded
from explicit.model import Model, Samples, Sampling, Stepping
from explicit.one_copy import in_one_copy
from explicit.precision import Precision
from explicit.support import RIGID, CharacteristicBar, MovingSupport
from explicit.time_loop.boundary import BAR_HISTORY
from explicit.time_loop.failure import STRAY_ENERGY
from explicit.time_loop.kernel import TimeLoopKernel
from explicit.time_loop.lanes import WARPS
from explicit.time_loop.slots import CONTROL_SIZE, Ending, Total

PER_SAMPLE = ("friction", "release_stress", "contact_stiffness")
"""Numbers of every sample that are taken as they are."""


def batch_of(
    kernel: TimeLoopKernel,
    model: Model,
    samples: Samples,
    sampling: Sampling,
    stepping: Stepping,
    numbers: Precision,
    where: Any,
) -> Any:
    """Per-sample parameters and the tables they choose from."""
    mu = np.array([law.initial_shear_modulus for law in model.materials])[samples.material]
    lasting, stiffer = mu * samples.stiffness_factor, np.ones(len(samples))
    if model.relaxation:
        stiffer = np.array([branches.instantaneous for branches in model.relaxation])[samples.relaxation]
    mu = lasting * stiffer  # that of waves, which the volume and the hourglass patterns belong to
    bulk = bulk_modulus(mu, samples.poisson)
    solids = np.zeros(len(samples), dtype=kernel.element.Solid.numpy_dtype())
    solids["scale"] = samples.stiffness_factor * stiffer
    solids["bulk"] = bulk
    stiff = model.hourglass if model.hourglass_form == "stiffness" else 0.0
    solids["hourglass"] = stiff * mu
    solids["shear_viscosity"] = samples.damping * lasting
    solids["bulk_viscosity"] = samples.damping * bulk if model.damping_kind == "full" else 0.0
    solids["hourglass_viscosity"] = stiff * samples.damping * mu
    solids["hourglass_impedance"] = 2.0 * (model.hourglass - stiff) * np.sqrt(mu)
    solids["mass_damping"] = samples.mass_damping
    rows = [law.parameters() for law in model.materials]
    table = np.zeros((len(rows), -(-max(len(row) for row in rows) // 4) * 4))  # four are loaded at once
    for i, row in enumerate(rows):
        table[i, : len(row)] = row
    moving = model.support.motions if isinstance(model.support, MovingSupport) else ()
    counts = {len(motion.position) for motion in model.motions + moving}
    if len(counts) != 1:
        raise ValueError(
            f"the motions of a model need equally many knots, with those of its support, got {sorted(counts)}"
        )
    motions = np.stack([motion.cubics for motion in model.motions + moving])
    batch = kernel.structs.Batch()
    batch.start, batch.safety, batch.floor = model.start, stepping.safety, stepping.floor
    batch.largest_step = min(stepping.largest_step, 1.0)
    batch.measure_every, batch.max_steps = stepping.measure_every, stepping.max_steps
    batch.ledger_every = sampling.ledger_every
    bar = model.support if isinstance(model.support, CharacteristicBar) else RIGID
    batch.impedance, batch.round_trip = min(bar.impedance, 1e300), min(bar.round_trip, 1e300)
    batch.support_moves = int(bool(moving))
    moved = len(model.motions) + np.minimum(np.arange(len(samples)), max(len(moving) - 1, 0))
    support = moved if moving else np.zeros(len(samples))
    limits = np.minimum([law.data_limit for law in model.materials], 1e30)
    batch.stop_past_data = int(model.past_data == "stop")
    real = numbers.real
    arrays = {
        "data_limit": (limits, real),
        "stray_energy": (STRAY_ENERGY * mu * model.mesh.volume, wp.float64),
        "solids": (solids, kernel.element.Solid),
        **{name: (getattr(samples, name), real) for name in PER_SAMPLE},
        "material": (samples.material, wp.int32),
        "branches": (_branch_table(model), real),
        "relaxation": (samples.relaxation, wp.int32),
        "rows": (table, real),
        "motion": (samples.motion, wp.int32),
        "support_motion": (support, wp.int32),
        "motion_rate": (np.array([1.0 / motion.step for motion in model.motions + moving]), wp.float64),
        "motion_table": (motions, wp.float64),
    }
    for name, array in in_one_copy(arrays, where).items():
        setattr(batch, name, array)
    return batch


def _branch_table(model: Model) -> FloatArray:
    """The rows of what relaxes, as long as the longest asks for; one number where nothing does."""
    if not model.relaxation:
        return np.zeros((1, 1))
    most = max(len(branches) for branches in model.relaxation)
    return np.stack([branches.row(most) for branches in model.relaxation])


def state_of(
    kernel: TimeLoopKernel,
    model: Model,
    numbers: Precision,
    where: Any,
    rows: int,
    lanes: int,
    on_chip: bool = False,
) -> Any:
    """Fields that vary, at rest, of `rows` simulations one after the other or of `lanes` side by side.

    What a GPU keeps in shared memory needs no room here.
    """
    mesh = model.mesh
    _, n_inner, first_boundary = node_order(mesh)
    n_boundary = mesh.n_nodes - n_inner
    state = kernel.structs.State()
    bar = isinstance(model.support, CharacteristicBar) and model.support.round_trip < np.inf
    remembers = any(contact_law(name).remembers_slip for name in (model.faces, model.side))
    needed = {name for name, wanted in (("bar_wave", bar), ("slip", remembers)) if wanted}
    if kernel.memory > 0:
        needed.add("memory")
    for name, n, dtype in (
        *((name, first_boundary + n_boundary, numbers.real) for name in ("u_r", "u_y", "v_r", "v_y")),
        *((name, 4 * mesh.n_elements + SPARE, numbers.real) for name in ("corner_r", "corner_y")),
        *((name, n_boundary, wp.float64) for name in ("push_lower", "push_upper", "carried")),
        ("control", CONTROL_SIZE, wp.float64),
        ("partials", Total.COUNT * WARPS * kernel.cluster, wp.float64),
        ("touched", n_boundary, wp.int32),
        ("slip", n_boundary, numbers.real),
        ("memory", kernel.memory * mesh.n_elements, numbers.real),
        ("bar_wave", 2 * BAR_HISTORY, wp.float64),
    ):
        if on_chip and name not in needed:
            setattr(state, name, _no_room(dtype, where.alias))
            continue
        shape = (n, lanes) if lanes > 1 else (rows, n + SPARE)
        setattr(state, name, wp.zeros(shape, dtype=dtype, device=where))
    return state


@cache
def _no_room(dtype: Any, device: str) -> Any:
    """Placeholder of an array that the time loop never touches; to make one takes as long as a copy."""
    return wp.zeros((1, 1), dtype=dtype, device=device)


def output_of(
    kernel: TimeLoopKernel, mesh: Mesh, n: int, sampling: Sampling, nodes: Any, where: Any
) -> tuple[Any, Any]:
    """Room for the histories, NaN where a simulation does not get to, and the one array that they are in."""
    n_force, n_surface = len(sampling.force_times), len(sampling.surface_times)
    output = kernel.structs.Output()
    output.n_recorded = len(nodes)
    wanted = {
        "force_times": (sampling.force_times, wp.float64),
        "surface_times": (sampling.surface_times, wp.float64),
        "nodes": (padded(node_order(mesh)[0][nodes]), wp.int32),
    }
    for name, array in in_one_copy(wanted, where).items():
        setattr(output, name, array)
    shapes = {
        "force": (n, n_force, 2),
        "impulse": (n, n_force, 2),
        "position": (n, n_surface, len(nodes), 2),
        "energy": (n, n_surface, 9),
        "ending": (n, int(Ending.COUNT)),
    }
    size = sum(prod(shape) for shape in shapes.values())
    # What the time loop does not reach stays marked, beside its Outcome.
    whole: Any = wp.full(size, float("nan"), dtype=wp.float64, device=where)
    begin = 0
    for name, shape in shapes.items():
        place = whole.ptr + begin * wp.types.type_size_in_bytes(wp.float64)
        part: Any = wp.array(ptr=place, dtype=wp.float64, shape=shape, device=where)
        part._ref = whole  # which lives as long as its parts
        setattr(output, name, part)
        begin += prod(shape)
    return output, whole
