"""A shot made ready for simulation and comparison: observations, flyer path, material law."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

import explicit
from kolsky.bars.flyer.path import FlyerPath
from kolsky.base.arrays import FloatArray
from kolsky.base.records import FlyerMotion, ForceHistory
from kolsky.inverse.forward import Forward, curve_replicates, material_law
from kolsky.inverse.observations import SAME_TIME, Observations, observe
from kolsky.shot.curve import conditioned_ratio
from kolsky.shot.records import Shot

BINS = 30
"""Bins of the force where no camera's frames give their width: some ten a transit of a soft specimen, and few
enough that what rings in a mesh is averaged."""
OUTLINES = 65
"""Times at which the simulated outline is kept where none was measured, first and last included."""


@dataclass(frozen=True)
class PreparedShot:
    """A shot ready for simulation: the forward model, the observations, figures about the data."""

    forward: Forward
    """The shot ready to run."""
    observations: Observations
    """What its instruments saw inside the window."""
    checks: dict[str, Any]
    """Figures that tell whether the declared noise is believable and how far the curve reaches."""
    motion_sigma_gain: float = 0.0
    """Standard uncertainty of the scale of the front face's motion [-]; not in the path's covariance."""

    @property
    def path(self) -> FlyerPath:
        """The fitted flyer path."""
        return self.forward.paths[0]

    def with_replicates(self, n: int, rng: np.random.Generator, *, curves: int | None = None) -> Forward:
        """The forward model with `n` more flyer paths, `n` or `curves` more curves, drawn from their noise.

        Where the scale of the motion is uncertain the last path is the first one, larger by its sigma: one
        number needs no draws.
        """
        scaled = (self.path.scaled(1.0 + self.motion_sigma_gain),) if self.motion_sigma_gain > 0.0 else ()
        drawn = curve_replicates(self.forward.shot.curve, n if curves is None else curves, rng)
        return replace(
            self.forward,
            paths=(self.path, *self.path.replicates(n, rng), *scaled),
            laws=(self.forward.laws[0], *drawn),
        )


def prepare_shot(shot: Shot) -> PreparedShot:
    """Turn a shot's recordings into observations and the solver's inputs.

    Raises
    ------
    ValueError
        If the flyer's record or the curve cannot be used; the message says why.
    """
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
    """Width of the force's bins [s]: a share of the window, not below the sampling."""
    inside = force.time[(force.time >= window[0]) & (force.time <= window[1])]
    if inside.size < 2:
        raise ValueError(
            f"the window {window[0]:.9g} to {window[1]:.9g} s holds {inside.size} force samples, at least 2"
            f" are needed; the record spans {force.time[0]:.9g} to {force.time[-1]:.9g} s"
        )
    return max(float(inside[-1] - inside[0]) / BINS, float(np.diff(inside).max()))
