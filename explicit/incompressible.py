"""Nearly incompressible specimens at the cost of compressible ones, with a correction for nu on a coarser
mesh.

The stable step is proportional to sqrt(1 - 2 nu) on every mesh. The effect of nu on the result is smooth in
space: a change of volume, and waves as long as the specimen. It is therefore computed on a coarse mesh, where
steps need little time,

    Q(fine, nu) = Q(fine, nu_0) + [Q(coarse, nu) - Q(coarse, nu_0)],

These are two levels of the combination technique (Griebel, Schneider and Zenger 1992). The change of the
bracket from the coarse to the fine mesh is neglected. A third, even coarser mesh measures its size.
"""

from collections.abc import Callable
from dataclasses import dataclass, fields, replace

import numpy as np
from scipy.interpolate import CubicSpline

from explicit.arrays import FloatArray
from explicit.mesh import Mesh
from explicit.model import Model, Samples, Sampling, Stepping
from explicit.response import EnergyLedger, Response
from explicit.run_batch import run

COMPRESSIBLE = 0.495
"""Poisson's ratio of the runs on the fine mesh [-]."""
SAME_SIZE = 1e-9
"""Two meshes count as the same specimen if they differ by at most this [-]."""


@dataclass(frozen=True)
class NearlyIncompressible:
    """A batch at its nearly incompressible Poisson's ratios, with estimates of its error."""

    response: Response
    """Corrected histories and strain measures of the fine mesh (`extrapolated_share` within 0 and 1). `steps`
    and `smallest_step` are those of the run on the fine mesh at the compressible ratio."""
    force_change: FloatArray
    """Change of the transmission force's correction from the coarser to the coarse mesh [N], shape
    [n_samples, n_force_times]. Its size estimates the error. Filter it first in the same way as the force."""
    radius_change: FloatArray
    """The same change for the surface's radius [m], shape [n_samples, n_surface_times, n_surface_nodes]."""
    element_steps: FloatArray
    """Sum of elements times steps over the five runs of a sample [-], shape [n_samples]."""
    compressible_element_steps: FloatArray
    """Elements times steps of the run on the fine mesh at the compressible ratio [-], shape [n_samples]."""

    @property
    def cost(self) -> FloatArray:
        """Work over that of the compressible batch on the fine mesh [-], shape [n_samples]."""
        return self.element_steps / self.compressible_element_steps


def run_nearly_incompressible(
    model: Model,
    coarse: tuple[Mesh, Mesh],
    samples: Samples,
    sampling: Sampling,
    *,
    compressible: float = COMPRESSIBLE,
    stepping: Stepping | None = None,
    device: str = "cpu",
    threads: int | None = None,
    progress: Callable[[int], None] | None = None,
) -> NearlyIncompressible:
    """Simulate a batch whose Poisson's ratios are close to 1/2.

    Parameters
    ----------
    model : Model
        What to simulate, with the fine mesh.
    coarse : tuple of Mesh
        First the mesh of the correction, with about half the number of elements in each direction. Then a
        coarser one, with about three quarters of that number; it is used only to estimate the error.
    samples : Samples
        Parameters; `poisson` above `compressible`.
    sampling : Sampling
        What to record; without `all_nodes`.
    compressible : float
        Poisson's ratio of the runs on the fine mesh [-].
    stepping, device, threads, progress
        As in `explicit.run`. Progress counts the runs on the fine mesh, which are the last ones.

    Returns
    -------
    NearlyIncompressible
        The response at `samples.poisson`. A sample has the `Outcome` of its first run that did not complete,
        and NaN after its end. The corrected `extrapolated_share` is kept between 0 and 1.

    Raises
    ------
    ValueError
        If a Poisson's ratio is not above `compressible`. If the meshes are not of one specimen or not
        successively coarser. If all nodes are to be recorded.
    """
    _check(model.mesh, coarse, samples, sampling, compressible)
    soft = replace(samples, poisson=np.full(len(samples), compressible))

    def simulate(mesh: Mesh, batch: Samples, progress: Callable[[int], None] | None = None) -> Response:
        return run(
            replace(model, mesh=mesh),
            batch,
            sampling,
            stepping=stepping,
            device=device,
            threads=threads,
            progress=progress,
        )

    pairs = [(simulate(mesh, samples), simulate(mesh, soft)) for mesh in coarse]
    base = simulate(model.mesh, soft, progress)
    changes = [_Change.of(mesh, model.mesh, *pair) for mesh, pair in zip(coarse, pairs, strict=True)]
    first, second = changes
    compressible_work = base.steps.astype(np.float64) * model.mesh.n_elements
    work = compressible_work + sum(
        mesh.n_elements * (stiffer.steps + softer.steps)
        for mesh, (stiffer, softer) in zip(coarse, pairs, strict=True)
    )
    return NearlyIncompressible(
        response=first.applied_to(base, pairs[0]),
        force_change=first.force_transmission - second.force_transmission,
        radius_change=first.surface_r - second.surface_r,
        element_steps=work,
        compressible_element_steps=compressible_work,
    )


@dataclass(frozen=True)
class _Change:
    """Histories at one Poisson's ratio minus those at another, on one mesh; surfaces at the fine nodes."""

    force_flyer: FloatArray
    force_transmission: FloatArray
    impulse_flyer: FloatArray
    impulse_transmission: FloatArray
    surface_r: FloatArray
    surface_y: FloatArray
    extrapolated_share: FloatArray
    largest_strain_measure: FloatArray
    energy: dict[str, FloatArray]

    @classmethod
    def of(cls, mesh: Mesh, fine: Mesh, stiff: Response, soft: Response) -> "_Change":
        def histories(name: str) -> FloatArray:
            return np.asarray(getattr(stiff, name) - getattr(soft, name))

        def surface(name: str) -> FloatArray:
            change = histories(name)
            finite = np.isfinite(change).all(axis=2)
            refined = np.full((*change.shape[:2], len(fine.side)), np.nan)
            heights, fine_heights = _heights(mesh), _heights(fine)
            refined[finite] = CubicSpline(heights, change[finite], axis=1)(fine_heights)
            return refined

        return cls(
            **{name: histories(name) for name in (*_FORCES, *_STRAINS)},
            **{name: surface(name) for name in _SURFACES},
            energy={
                f.name: getattr(stiff.energy, f.name) - getattr(soft.energy, f.name)
                for f in fields(EnergyLedger)
            },
        )

    def applied_to(self, base: Response, pair: tuple[Response, Response]) -> Response:
        """The response of the fine mesh with this change; the outcome is that of the first failed run."""
        runs = (base, *pair)
        outcomes = tuple(
            next((o for o in of_sample if not o.ok), of_sample[0])
            for of_sample in zip(*(r.outcomes for r in runs), strict=True)
        )
        ledger = {name: getattr(base.energy, name) + change for name, change in self.energy.items()}
        corrected = {
            name: getattr(base, name) + getattr(self, name) for name in (*_FORCES, *_SURFACES, *_STRAINS)
        }
        # a share of the volume: if it is almost zero, the sum of three shares can be negative
        corrected["extrapolated_share"] = np.clip(corrected["extrapolated_share"], 0.0, 1.0)
        return replace(
            base,
            **corrected,
            energy=EnergyLedger(**ledger),
            outcomes=outcomes,
            end_times=np.min([r.end_times for r in runs], axis=0),
        )


_FORCES = ("force_flyer", "force_transmission", "impulse_flyer", "impulse_transmission")
_SURFACES = ("surface_r", "surface_y")
_STRAINS = ("extrapolated_share", "largest_strain_measure")


def _heights(mesh: Mesh) -> FloatArray:
    """Undeformed heights of the side's nodes over the lower face [m]."""
    return np.asarray(mesh.nodes[mesh.side, 1] - mesh.nodes[:, 1].min())


def _check(
    fine: Mesh, coarse: tuple[Mesh, Mesh], samples: Samples, sampling: Sampling, compressible: float
) -> None:
    if not (samples.poisson > compressible).all():
        raise ValueError(
            f"poisson must be above compressible = {compressible:g}, got {samples.poisson.min():g}: "
            "explicit.run simulates it directly"
        )
    if sampling.all_nodes:
        raise ValueError("all_nodes is not available: the meshes' nodes differ; request the surface")
    meshes = (fine, *coarse)
    for name, size in (
        ("radius", [m.nodes[:, 0].max() for m in meshes]),
        ("length", [m.length for m in meshes]),
    ):
        if np.ptp(size) > SAME_SIZE * size[0]:
            raise ValueError(f"the meshes must be of one specimen, got {name} = {size} m")
    counts = [mesh.n_elements for mesh in meshes]
    if not counts[0] > counts[1] > counts[2]:
        raise ValueError(f"each mesh must have fewer elements than the one before, got {counts}")
