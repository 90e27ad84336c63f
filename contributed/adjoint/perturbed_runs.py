"""Derivatives of a response by its parameters: one batch of perturbed runs with verified difference steps.

A large step h gives a central difference an error proportional to h^2. A small step gives it an error of
round-off over h. One batch computes every derivative with a series of steps (the ladder). The changes between
neighbouring steps form a V; the step at its minimum is chosen, and the changes are returned.

Both runs of a difference must take the same time steps. A step that depends on the deformation also depends
on the parameter. The response then has a kink wherever a requested time moves from one step to the next.
`same_steps` avoids this. Contact still causes jumps: a node lands in one step or in the next. The discrete
response is smooth only between two such changes (`README.md`).
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from math import inf

import numpy as np
from numpy.typing import NDArray

from explicit.arrays import FloatArray
from explicit.contact import contact_law
from explicit.materials.volumetric import POISSON_LIMIT
from explicit.model import Model, Samples, Sampling, Stepping, scale_of
from explicit.response import Response
from explicit.run_batch import run


@dataclass(frozen=True)
class Histories:
    """Forces, impulses and the side surface at the times of an `explicit.Sampling`. Leading axes depend on
    the use: samples, parameters or none. Units are those of the values. A derivative is per unit of its
    parameter; a cotangent is per unit of the value."""

    force_flyer: FloatArray
    """Force of the flyer's platen [N], shape [..., n_force_times]."""
    force_transmission: FloatArray
    """Force on the transmission platen [N], shape [..., n_force_times]."""
    impulse_flyer: FloatArray
    """Time integral of the flyer force [N s], shape [..., n_force_times]."""
    impulse_transmission: FloatArray
    """Time integral of the transmission force [N s], shape [..., n_force_times]."""
    surface_r: FloatArray
    """Radius of the side surface's nodes [m], shape [..., n_surface_times, n_surface_nodes]."""
    surface_y: FloatArray
    """Height of the same nodes [m], shape [..., n_surface_times, n_surface_nodes]."""

    @classmethod
    def of(cls, response: Response) -> "Histories":
        """The histories of a batch, samples first."""
        return cls(**{name: getattr(response, name) for name in NAMES})

    @classmethod
    def zeros(cls, n_force_times: int, n_surface_times: int, n_surface_nodes: int) -> "Histories":
        """Histories of zeros without leading axes, the initial value of a cotangent."""
        surface: tuple[int, ...] = (n_surface_times, n_surface_nodes)
        shapes = [(n_force_times,)] * 4 + [surface] * 2
        return cls(**{name: np.zeros(shape) for name, shape in zip(NAMES, shapes, strict=True)})

    def items(self) -> Iterator[tuple[str, FloatArray]]:
        """Name and array of every history."""
        return ((name, getattr(self, name)) for name in NAMES)

    def map(self, change: Callable[[FloatArray], FloatArray]) -> "Histories":
        """Histories with a function applied to every array."""
        return Histories(**{name: change(values) for name, values in self.items()})


NAMES: tuple[str, ...] = tuple(field.name for field in fields(Histories))
"""Names of the histories, in order."""


LADDER = tuple(10.0 ** (-0.5 * k) for k in range(2, 14))
"""Relative steps from 0.1 to 3e-7, two a decade."""
STEP_MARGIN = 0.9
"""Ratio of the time step of all runs to the smallest step of a trial batch [-]."""
FORCES, IMPULSES, PROFILE = NAMES[:2], NAMES[2:4], NAMES[4:]


BOUNDS: dict[str, tuple[float, float]] = {
    "stiffness_factor": (0.0, inf),
    "poisson": (0.0, POISSON_LIMIT),
    "damping": (0.0, inf),
    "friction": (0.0, inf),
    "mass_damping": (0.0, inf),
}
"""The parameters that can be varied, with their valid ranges."""


@dataclass(frozen=True)
class Stencil:
    """Points where a response is evaluated. Its slope is sum_j weights[j] f(value + offsets[j] h) / h."""

    offsets: FloatArray
    """Distances from the value in steps, the first one 0 [-], shape [3]."""
    weights: FloatArray
    """Weights of the responses [-], shape [3]."""


CENTRAL = Stencil(np.array([0.0, 1.0, -1.0]), np.array([0.0, 0.5, -0.5]))
"""(f(p + h) - f(p - h)) / 2 h."""
FORWARD = Stencil(np.array([0.0, 1.0, 2.0]), np.array([-1.5, 2.0, -0.5]))
"""(-3 f(p) + 4 f(p + h) - f(p + 2 h)) / 2 h."""
BACKWARD = Stencil(-FORWARD.offsets, -FORWARD.weights)
"""The same formula on the other side."""


def stencil_for(name: str, value: float, widest: float) -> Stencil:
    """The central formula, or a one-sided one if a step would leave the parameter's range.

    ``value``, ``widest``: value of the parameter and largest step, in its unit.
    """
    low, high = BOUNDS[name]
    for stencil in (CENTRAL, FORWARD, BACKWARD):
        reached = value + stencil.offsets * widest
        above = reached.min() > low if name == "stiffness_factor" else reached.min() >= low
        if above and reached.max() <= high:
            return stencil
    raise ValueError(
        f"{name} = {value:.6g} has no room for a step of {widest:.3g} inside [{low:g}, {high:g}];"
        " use smaller relative steps"
    )


@dataclass(frozen=True)
class StepStudy:
    """Change of a derivative from one step of the ladder to the next smaller one (the V). Changes are root
    mean squares over both platens, or over radii and heights, relative to that of the derivative. They
    decrease with the square of a step that is too large. They increase again if the step is too small."""

    step: FloatArray
    """Steps, widest first, in the parameter's unit, shape [n_parameters, n_steps]."""
    force: FloatArray
    """Change of the forces' and impulses' derivatives [-], shape [n_parameters, n_steps - 1]."""
    profile: FloatArray
    """Change of the side surface's derivatives [-], shape [n_parameters, n_steps - 1]."""
    chosen: NDArray[np.int64]
    """Index of the step at the minimum, shape [n_parameters]."""
    smooth: NDArray[np.bool_]
    """Whether the change decreases faster than the step down to the minimum, shape [n_parameters]. If not,
    contact decisions (landing, sticking) change within the larger steps. The derivative is then valid between
    two such changes only, and a difference over a larger range has another value."""

    @property
    def change(self) -> FloatArray:
        """The larger of both changes [-], shape [n_parameters, n_steps - 1]."""
        return np.maximum(self.force, self.profile)


@dataclass(frozen=True)
class Jacobian:
    """Derivatives of one simulation's histories by some of its parameters."""

    parameters: tuple[str, ...]
    """Names, as in `explicit.Samples`, length n_parameters."""
    value: FloatArray
    """Their values, in their units, shape [n_parameters]."""
    derivative: Histories
    """Derivatives, parameters first, per unit of the parameter."""
    error: Histories
    """Estimated error of every entry, in the same shapes and units."""
    nominal: Histories
    """The histories at the unperturbed values, without leading axes."""
    study: StepStudy
    """The steps that were tried and the one that was chosen."""
    stepping: Stepping
    steps_shared: bool
    """Whether all runs took the same time steps; if not, the derivatives contain their noise."""


def jacobian(
    model: Model,
    samples: Samples,
    sampling: Sampling,
    *,
    parameters: Sequence[str] = ("stiffness_factor",),
    relative_steps: Sequence[float] = LADDER,
    stepping: Stepping | None = None,
    device: str = "cpu",
    threads: int | None = None,
) -> Jacobian:
    """Derivatives of forces, impulses and side surface by parameters, in one batch of perturbed runs.

    Differences are central, (f(p + h) - f(p - h)) / 2 h, and one-sided of second order where a bound of the
    parameter is near. The error of an entry is the Richardson estimate r^2 / (r^2 - 1) |D(h) - D(h / r)| from
    the chosen step and the next smaller one. For steps below the minimum of the V it is about the round-off.

    ``model``, ``sampling``: what to simulate and what to record. ``samples``: one sample: where to
    differentiate. ``parameters``: any of "stiffness_factor", "poisson", "damping", "friction",
    "mass_damping". ``relative_steps``: the ladder: steps over the parameter's scale
    (`explicit.model.scale_of`), descending, 3 or more. A step is chosen among all but the last. ``stepping``:
    numerical choices. Default: `same_steps` of the widest perturbations, which costs a trial batch.
    ``device``, ``threads``: as in `explicit.run`. Raises ValueError if there is not exactly one sample, or a
    run does not complete. If a parameter is unknown, repeated or without effect in the model, or a step
    leaves its range.
    """
    names, ladder = tuple(parameters), np.asarray(relative_steps, dtype=float)
    _check(model, samples, names, ladder)
    value = np.array([float(getattr(samples, name)[0]) for name in names])
    step = np.array([scale_of(name, x) for name, x in zip(names, value, strict=True)])[:, None] * ladder
    stencils = [stencil_for(*item) for item in zip(names, value, step[:, 0], strict=True)]
    if stepping is None:
        wide = _batch(samples, names, stencils, step[:, :1])
        stepping = same_steps(model, wide, sampling, device=device, threads=threads)
    batch = _batch(samples, names, stencils, step)
    quick = replace(sampling, ledger_every=len(sampling.surface_times), all_nodes=False)
    response = run(model, batch, quick, stepping=stepping, device=device, threads=threads)
    _require_completed(response, batch, names)
    histories = Histories.of(response)
    # Sample 0 is the unperturbed point, the first point of every formula; then parameters, steps, other
    # points.
    place = np.zeros((*step.shape, 3), dtype=np.intp)
    place[..., 1:] = 1 + np.arange(2 * step.size).reshape(*step.shape, 2)
    weight = np.array([s.weights for s in stencils])[:, None, :] / step[:, :, None]
    slopes = histories.map(lambda f: np.einsum("pkj,pkj...->pk...", weight, f[place]))
    study = _study(step, slopes)
    selected = np.arange(len(names)), study.chosen
    ratio = (step[selected] / step[selected[0], study.chosen + 1]) ** 2

    def error(slope: FloatArray) -> FloatArray:
        change = np.abs(slope[selected] - slope[selected[0], study.chosen + 1])
        return change * (ratio / (ratio - 1.0)).reshape(-1, *[1] * (change.ndim - 1))

    return Jacobian(
        parameters=names,
        value=value,
        derivative=slopes.map(lambda slope: slope[selected]),
        error=slopes.map(error),
        nominal=histories.map(lambda f: f[0]),
        study=study,
        stepping=stepping,
        steps_shared=bool((response.smallest_step == stepping.largest_step).all()),
    )


def same_steps(
    model: Model,
    samples: Samples,
    sampling: Sampling,
    *,
    stepping: Stepping | None = None,
    device: str = "cpu",
    threads: int | None = None,
) -> Stepping:
    """One constant time step for a whole batch, smaller than every step of a trial run of the batch."""
    quick = replace(sampling, ledger_every=len(sampling.surface_times), all_nodes=False)
    trial = run(model, samples, quick, stepping=stepping, device=device, threads=threads)
    _require_completed(trial, samples, ())
    smallest = STEP_MARGIN * float(trial.smallest_step.min())
    return replace(stepping or Stepping(), largest_step=smallest)


def _check(model: Model, samples: Samples, names: tuple[str, ...], ladder: FloatArray) -> None:
    if len(samples) != 1:
        raise ValueError(f"samples must be one sample, the point to differentiate at, got {len(samples)}")
    for name in names:
        if name not in BOUNDS or names.count(name) > 1:
            raise ValueError(f"parameters must be different names of {', '.join(BOUNDS)}, got {name!r}")
    laws = (contact_law(model.faces), contact_law(model.side))
    if "friction" in names and not any(law.needs_friction for law in laws):
        raise ValueError(
            f"friction has no effect with faces {model.faces!r} and side {model.side!r};"
            " leave it out or choose 'coulomb'"
        )
    if len(ladder) < 3 or not (ladder > 0.0).all() or not (np.diff(ladder) < 0.0).all():
        raise ValueError(f"relative_steps must be 3 or more, positive and descending, got {ladder.tolist()}")


def _batch(samples: Samples, names: tuple[str, ...], stencils: list[Stencil], step: FloatArray) -> Samples:
    """The unperturbed point, then the other two points of every stencil, in the order parameters, steps,
    points."""
    n, each = 1 + 2 * step.size, 2 * step.shape[1]
    values = {}
    for p, (name, stencil) in enumerate(zip(names, stencils, strict=True)):
        column = np.repeat(getattr(samples, name), n)
        first = 1 + p * each
        column[first : first + each] += np.outer(step[p], stencil.offsets[1:]).ravel()
        values[name] = column
    columns = {f.name: np.repeat(getattr(samples, f.name), n) for f in fields(Samples)}
    return Samples(**{**columns, **values})


def _require_completed(response: Response, samples: Samples, names: tuple[str, ...]) -> None:
    for i, outcome in enumerate(response.outcomes):
        if not outcome.ok:
            at = ", ".join(f"{name} = {getattr(samples, name)[i]:.6g}" for name in names)
            raise ValueError(
                f"run {i}{' at ' if at else ''}{at} ended at {response.end_times[i]:.6g} s: {outcome.cause}."
                f" Cure: {outcome.cure}; or use smaller relative steps"
            )


def _study(step: FloatArray, slopes: Histories) -> StepStudy:
    def change(names: tuple[str, ...]) -> FloatArray:
        # Both platens together: before the wave arrives, the values of a platen are round-off only.
        slope = np.concatenate([getattr(slopes, name).reshape(*step.shape, -1) for name in names], axis=2)
        size = np.sqrt((slope[:, 1:] ** 2).mean(axis=2))
        difference = np.sqrt((np.diff(slope, axis=1) ** 2).mean(axis=2))
        return np.divide(difference, size, out=np.zeros_like(difference), where=size > 0.0)

    force, profile = np.maximum(change(FORCES), change(IMPULSES)), change(PROFILE)
    larger = np.maximum(force, profile)
    chosen = larger.argmin(axis=1)
    smooth = np.ones(len(step), dtype=bool)
    for p, k in enumerate(chosen):
        # Near the minimum, round-off makes the curve flat. At larger steps a change must decrease faster than
        # its step.
        fall = larger[p, 1:k] / larger[p, : max(k - 1, 0)]
        above = larger[p, 1:k] > 30.0 * larger[p, k]
        smooth[p] = not (above & (fall > step[p, 1:k] / step[p, : max(k - 1, 0)])).any()
    return StepStudy(step=step, force=force, profile=profile, chosen=chosen, smooth=smooth)
