"""The inverse problem of one shot: prepared data, settings, free parameters, provenance.

Stiffness factor, Poisson's ratio and damping are free by default. If the specimen sticks to the platens, the
ringing of the force constrains the last two better than a data sheet. The table [uncertainty] of shot.toml is
used as follows:

- a standard uncertainty makes the declared value a Gaussian prior,
- an uncertainty of 0 holds the parameter at the declared value,
- without an entry, the parameter has a uniform prior over the range of its design.

Constants of relaxation are free if [relaxation] declares them free and an outline was measured. Only the
stiffness factor is free without an outline, or if a surface slides or lets go.
"""

from __future__ import annotations

import platform
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

import explicit
from doe import Box
from kolsky.bars.flyer.path import FlyerPath
from kolsky.base.apparatus import SLIDING_LAW
from kolsky.base.arrays import FloatArray
from kolsky.base.records import FlyerMotion, ForceHistory
from kolsky.inverse.forward import Forward, coarser_graded, curve_replicates, graded, material_law
from kolsky.inverse.objective import Prior
from kolsky.inverse.observations import SAME_TIME, Observations, observe
from kolsky.inverse.parameters import PARAMETERS, checked_value, design_box, parameter, slides
from kolsky.inverse.settings import Numerics, Settings, require_finer
from kolsky.shot.curve import conditioned_ratio, with_pull
from kolsky.shot.recordings import recording_facts
from kolsky.shot.records import Shot

BINS = 30
"""Number of force bins if no camera frames define their width. A wave transit of a soft specimen then has
about ten bins. They are wide enough to average the ringing of the mesh."""
OUTLINES = 65
"""Number of output times of the simulated outline if none was measured, first and last included."""


@dataclass(frozen=True)
class PreparedShot:
    """A shot prepared for simulation: forward model, observations, figures about the data."""

    forward: Forward
    observations: Observations
    checks: dict[str, Any]
    """Numbers that show whether the declared noise is plausible and which strains the curve covers."""
    motion_sigma_gain: float = 0.0
    """Standard uncertainty of the scale of the front face's motion [-], not in the path's covariance."""

    @property
    def shot(self) -> Shot:
        """The shot."""
        return self.forward.shot

    def with_shot(self, shot: Shot) -> PreparedShot:
        """The same data and path with another apparatus, specimen or material."""
        return replace(self, forward=replace(self.forward, shot=shot))

    @property
    def path(self) -> FlyerPath:
        """The fitted flyer path."""
        return self.forward.paths[0]

    def with_replicates(
        self, n: int, rng: np.random.Generator, *, curves: int | None = None, path: FlyerPath | None = None
    ) -> Forward:
        """The forward model with `n` paths and `n` or `curves` curves more, drawn from their noise.

        If the scale of the motion is uncertain, the last path is the first one scaled up by its sigma; this
        single number needs no draws. ``path``: mean of the drawn paths; default: the fitted path.
        """
        path = path or self.path
        scaled = (path.scaled(1.0 + self.motion_sigma_gain),) if self.motion_sigma_gain > 0.0 else ()
        drawn = curve_replicates(self.forward.shot.curve, n if curves is None else curves, rng)
        return replace(
            self.forward, paths=(path, *path.replicates(n, rng), *scaled), laws=(self.forward.laws[0], *drawn)
        )


def prepare_shot(shot: Shot) -> PreparedShot:
    """Turn a shot's recordings into observations and the solver's inputs; ValueError if not usable."""
    force, motion, scale = shot.force.history(), shot.flyer, 0.0
    if isinstance(motion, FlyerMotion):
        width = float(np.median(np.diff(motion.time)))
        path = shot.flyer_path
        checks = {
            "flyer_chi2_per_dof": path.chi2_per_dof,
            "flyer_noise_scale": path.noise_scale,
            "flyer_static_scatter": path.static_scatter,
        }
    else:
        width = _bin_width(force, shot.window)
        path, scale = shot.flyer_path, motion.sigma_gain
        checks = {"front_noise_scale": path.noise_scale, "front_sigma_gain": scale}
    incident = None if shot.incident is None else shot.incident.channel.history()
    observations = replace(
        observe(force, shot.centre_line, window=shot.window, bin_width=width, incident=incident),
        force_sigma_gain=shot.force.sigma_gain,
    )
    outlines = observations.frame_times if observations.has_shape else np.linspace(*shot.window, OUTLINES)
    sampling = explicit.Sampling(force_times=_sampled(observations), surface_times=outlines)
    law, ratio = material_law(shot.curve), conditioned_ratio(shot.curve)
    forward = Forward(shot=shot, sampling=sampling, paths=(path,), laws=(law,))
    return PreparedShot(
        forward=forward,
        observations=observations,
        checks={
            **checks,
            **shot.force.noise_checks(),
            "curve_last_s": law.data_limit,
            "curve_last_strain": float(shot.curve.stretch[-1] - 1.0),
            "window_end": shot.window[1],
            **({} if ratio is None else {"conditioned_ratio": ratio}),
            **({} if shot.symmetry_end is None else {"symmetry_end": shot.symmetry_end}),
        },
        motion_sigma_gain=scale,
    )


def _sampled(observations: Observations) -> FloatArray:
    """Times of the recorded samples and of the incident force's bin edges between them [s]."""
    times = observations.force.time
    if observations.incident is None:
        return times
    edges = observations.incident.edges
    near = np.clip(np.searchsorted(times, edges), 1, len(times) - 1)
    apart = np.minimum(np.abs(times[near] - edges), np.abs(times[near - 1] - edges))
    return np.sort(np.concatenate([times, edges[apart > SAME_TIME]]))


def _bin_width(force: ForceHistory, window: tuple[float, float]) -> float:
    """Width of the force bins [s]: the window over `BINS`, at least the sampling interval."""
    inside = force.time[(force.time >= window[0]) & (force.time <= window[1])]
    if inside.size < 2:
        raise ValueError(
            f"the window {window[0]:.9g} to {window[1]:.9g} s holds {inside.size} force samples, at least 2"
            f" are needed; the record spans {force.time[0]:.9g} to {force.time[-1]:.9g} s"
        )
    return max(float(inside[-1] - inside[0]) / BINS, float(np.diff(inside).max()))


DEFAULT = ("stiffness_factor", "poisson", "damping")
"""Parameters that are free by default, if the data of a shot constrain them."""
ONE_FREE = ("stiffness_factor",)
"""Free parameters if a surface slides or lets go."""

HELD_AS_ASKED, EXACT = "held as asked", "declared exact in [uncertainty]"
NO_OUTLINE = "held because no outline was measured"
SLIDES = "held because a surface slides or is released"
BEYOND = "declared beyond the range of the search"
REASONS_BEFORE_RUNS = (HELD_AS_ASKED, EXACT, SLIDES, NO_OUTLINE, BEYOND)
"""Reasons to hold a parameter that are known before any run."""

Bounds = tuple[float, float] | None


@dataclass(frozen=True)
class Freed:
    """Settings in which every parameter is either free or held, and why some are held."""

    settings: Settings
    by_default: bool
    """True if the free parameters are the default choice; they are held if the data do not constrain them."""
    reasons: Mapping[str, str]

    @property
    def free(self) -> Mapping[str, Bounds]:
        """Free parameters and their bounds."""
        assert self.settings.free is not None
        return self.settings.free

    def prior(self, shot: Shot) -> Prior | None:
        """The priors of the free parameters from the shot's [uncertainty]; None if it declares none."""
        declared = {
            name: (PARAMETERS[name].held(shot), shot.uncertainty[name])
            for name in self.free
            if name in PARAMETERS and shot.uncertainty.get(name, 0.0) > 0.0
        }
        return Prior.of(tuple(self.free), declared)

    def said(self, shot: Shot) -> Iterator[str]:
        """One sentence for each parameter that the data did not constrain."""
        for name, why in self.reasons.items():
            if why not in REASONS_BEFORE_RUNS and name not in self.settings.held:
                p = PARAMETERS[name]
                value = f"{p.held(shot) * p.shown_factor:.6g}" + (
                    "" if p.shown_unit == "1" else f" {p.shown_unit}"
                )
                yield f"{name} = {value} as declared, {why}: the answer holds if that is right"

    def holding(self, reasons: Mapping[str, str], at: Mapping[str, float]) -> Freed:
        """The same with parameters held, each for a reason, at a given value or the shot's value."""
        free = {name: bounds for name, bounds in self.free.items() if name not in reasons}
        settings = replace(self.settings, free=free, held={**self.settings.held, **at})
        return replace(self, settings=settings, reasons={**self.reasons, **reasons})


def choose(settings: Settings, shot: Shot) -> Freed:
    """Choose the free parameters that the settings leave open.

    Raises ValueError if nothing would be free, or if a held parameter is unknown or outside its range.
    """
    for name, value in settings.held.items():
        checked_value(name, value)
    for name in settings.hold:
        parameter(name)
    if settings.free is not None:
        return Freed(settings, by_default=False, reasons={})
    relaxing = () if shot.relaxation is None else shot.relaxation.free_names
    default = (*DEFAULT, *relaxing)
    reasons = {name: HELD_AS_ASKED for name in (*settings.held, *settings.hold) if name in default}
    others = [name for name in default if name not in ONE_FREE]
    beyond = shot.model.poisson > PARAMETERS["poisson"].upper
    for why, names in (
        (EXACT, [name for name in default if shot.uncertainty.get(name) == 0.0]),
        (BEYOND, ["poisson"] if beyond else []),
        (SLIDES, others if rough(shot, settings.held) else []),
        (NO_OUTLINE, others if shot.centre_line is None else []),
    ):
        reasons |= {name: why for name in names if name not in reasons}
    free = {name: None for name in default if name not in reasons}
    if not free:
        raise ValueError(f"nothing is free: {', '.join(f'{name} is {why}' for name, why in reasons.items())}")
    return Freed(replace(settings, free=free), by_default=True, reasons=reasons)


def rough(shot: Shot, named: Iterable[str]) -> bool:
    """True if a surface slides or lets go, as declared or because of a named parameter."""
    from explicit.contact import contact_law

    declared = (shot.interface.faces, shot.interface.side)
    return slides(shot.interface, named) or any(contact_law(law).needs_release_stress for law in declared)


@dataclass(frozen=True)
class InverseProblem:
    """The inverse problem of one shot: data, free parameters, their bounds and priors."""

    prepared: PreparedShot
    freed: Freed
    """Free parameters, and the reasons for holding the others."""
    box: Box
    prior: Prior | None

    @classmethod
    def of(cls, shot: Shot, settings: Settings) -> InverseProblem:
        """The problem of a loaded shot; ValueError for unusable data, names, bounds or meshes."""
        require_finer(settings.refined_mesh, settings.numerics.mesh)
        prepared = prepare_shot(with_pull(shot, settings.pull))
        return cls.freeing(prepared, choose(settings, prepared.shot))

    @classmethod
    def freeing(cls, prepared: PreparedShot, freed: Freed) -> InverseProblem:
        """The problem of a prepared shot with given free parameters."""
        return cls(prepared, freed, design_box(freed.free), freed.prior(prepared.shot))

    def holding(self, reasons: Mapping[str, str], at: Mapping[str, float]) -> InverseProblem:
        """The problem with more parameters held, each for a reason, at a given or the shot's value."""
        return self.freeing(self.prepared, self.freed.holding(reasons, at))

    def of_one(self, name: str) -> InverseProblem:
        """The problem with one free parameter and no prior. The others keep the shot's values."""
        i = self.box.names.index(name)
        return replace(self, box=Box.of({name: (self.box.lower[i], self.box.upper[i])}), prior=None)

    @property
    def settings(self) -> Settings:
        """The settings, `free` filled in."""
        return self.freed.settings

    @property
    def shot(self) -> Shot:
        """The shot."""
        return self.prepared.forward.shot

    @property
    def observations(self) -> Observations:
        """The measurements that predictions are compared with."""
        return self.prepared.observations

    @property
    def numerics(self) -> Numerics:
        """The numerical choices of the surrogate's mesh."""
        return self.settings.numerics if self._is_rough else self.settings.numerics.for_search()

    @property
    def refined(self) -> Numerics:
        """Numerical choices of the refined mesh. It is graded, unless single runs jump because a surface
        slides, or a correction for Poisson's ratio uses other meshes.
        """
        if self._is_graded:
            return graded(self.settings.numerics, self.settings.refined_mesh)
        return self.settings.numerics.with_mesh(self.settings.refined_mesh)

    @property
    def halfway(self) -> Numerics:
        """Numerical choices of the steps to the refined mesh: a coarser graded mesh, or the refined mesh."""
        return coarser_graded(self.numerics, self.settings.refined_mesh) if self._is_graded else self.refined

    @property
    def _is_graded(self) -> bool:
        return self.settings.numerics.compressible is None and not self._is_rough

    @property
    def _is_rough(self) -> bool:
        return rough(self.shot, [*self.freed.free, *self.settings.held])

    @property
    def first(self) -> Numerics:
        """Numerical choices of the first runs: the coarser of the surrogate's and the replicates' mesh."""
        return self.numerics.with_mesh(min(self.numerics.mesh, self.settings.replicate_mesh))

    @property
    def declared(self) -> FloatArray:
        """The free parameters' values as the shot declares them, shape [d]."""
        return np.array([PARAMETERS[name].held(self.shot) for name in self.box.names])

    def point(self, x: ArrayLike) -> dict[str, Any]:
        """All named parameters, with the free ones at the given points of shape [d] or [n, d]."""
        columns = np.moveaxis(np.asarray(x, dtype=np.float64), -1, 0)
        return {**self.settings.held, **dict(zip(self.box.names, columns, strict=True))}


def provenance(shot: Shot, settings: Any, prepared: PreparedShot, *, sliding: bool) -> dict[str, Any]:
    """The record needed to repeat a result, of JSON types: hashes, settings, versions, machine class.

    ``settings``: the dataclass of settings of the result. ``sliding``: True if Coulomb's law replaced the
    declared interface, see `Forward.run`: "interface" is the simulated, "declared_interface" the declared
    one.
    """
    packages = {}
    for name in ("kolsky", "warp-lang", "numpy", "scipy"):
        try:
            packages[name] = version(name)
        except PackageNotFoundError:
            packages[name] = "not installed"
    declared = {"faces": shot.interface.faces, "side": shot.interface.side}
    interface = {"faces": SLIDING_LAW, "side": SLIDING_LAW} if sliding else declared
    return {
        "inputs": dict(shot.inputs),
        "settings": _plain(settings),
        "interface": interface,
        **({"declared_interface": declared} if interface != declared else {}),
        "specimen": _plain(shot.specimen),
        **({"specimen_length": _plain(shot.length_by_pictures)} if shot.length_by_pictures else {}),
        "support": shot.support,
        **({"transducer_depth": shot.transducer_depth} if shot.transducer_depth else {}),
        **({"behind": _plain(shot.behind)} if shot.behind else {}),
        **({"flyer_body": _plain(shot.flyer_body)} if shot.flyer_body else {}),
        **({"incident_force": "compared"} if shot.incident else {}),
        "window_s": list(shot.window),
        "checks": prepared.checks,
        "recordings": recording_facts(shot),
        "versions": {**packages, "python": platform.python_version()},
        "machine": platform.machine(),
        "seed": getattr(settings, "seed", None),
    }


def _plain(thing: Any) -> Any:
    """Dataclasses, mappings and tuples as JSON values."""
    if hasattr(thing, "__dataclass_fields__"):
        return {name: _plain(getattr(thing, name)) for name in thing.__dataclass_fields__}
    if isinstance(thing, Mapping):
        return {str(key): _plain(value) for key, value in thing.items()}
    if isinstance(thing, (list, tuple)):
        return [_plain(value) for value in thing]
    return thing
