"""A shot made ready for simulation and comparison: observations, flyer path, material law."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

import explicit
from kolsky.flyer import fit_flyer
from kolsky.flyerpath import FlyerPath
from kolsky.forward import Forward, curve_replicates, material_law
from kolsky.misfit import Observations, observe
from kolsky.shots import Shot
from kolsky.transducers import force_history, noise_correlation


@dataclass(frozen=True)
class Prepared:
    """What every loop over simulations of one shot starts from."""

    forward: Forward
    """The shot ready to run."""
    observations: Observations
    """What its instruments saw inside the window."""
    checks: dict[str, Any]
    """Figures that tell whether the declared noise is believable and how far the curve reaches."""

    @property
    def path(self) -> FlyerPath:
        """The fitted flyer path."""
        return self.forward.paths[0]

    def with_replicates(self, n: int, rng: np.random.Generator) -> Forward:
        """The forward model with `n` more flyer paths and `n` more curves, drawn from their noise."""
        return replace(
            self.forward,
            paths=(self.path, *self.path.replicates(n, rng)),
            laws=(self.forward.laws[0], *curve_replicates(self.forward.shot.curve, n, rng)),
        )


def prepare(shot: Shot) -> Prepared:
    """Turn a shot's recordings into observations and the solver's inputs.

    Raises
    ------
    ValueError
        If the flyer's record or the curve cannot be used; the message says why.
    """
    start, _ = shot.window
    channel = shot.force
    force = force_history(
        channel.recording,
        channel.transducer,
        baseline=channel.baseline,
        clock_offset=channel.clock_offset,
    )
    frame_interval = float(np.median(np.diff(shot.flyer.time)))
    observations = observe(force, shot.centre_line, window=shot.window, bin_width=frame_interval)
    path = fit_flyer(shot.flyer, start=start)
    sampling = explicit.Sampling(
        force_times=observations.force.time, surface_times=np.unique(observations.centre_line.time)
    )
    law = material_law(shot.curve)
    forward = Forward(shot=shot, sampling=sampling, paths=(path,), laws=(law,))
    return Prepared(
        forward=forward,
        observations=observations,
        checks={
            "flyer_chi2_per_dof": path.chi2_per_dof,
            "flyer_noise_scale": path.noise_scale,
            "flyer_static_scatter": path.static_scatter,
            "force_noise_correlation": noise_correlation(force, channel.baseline),
            "force_baseline_samples": int(channel.baseline_volts().size),
            "curve_last_s": law.data_limit,
            "curve_last_strain": float(shot.curve.stretch[-1] - 1.0),
            "window_end": shot.window[1],
            "symmetry_end": float("inf") if shot.symmetry_end is None else shot.symmetry_end,
        },
    )
