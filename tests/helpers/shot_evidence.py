"""A shot as evidence of rate dependence: its force is simulated for many rate models in one batch."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

import explicit
from kolsky.base.arrays import FloatArray
from kolsky.inverse.parameters import PARAMETERS
from kolsky.inverse.problem import PreparedShot
from kolsky.inverse.settings import Numerics
from kolsky.material.relaxation.rate_fit import RateModel


@dataclass(frozen=True)
class ShotEvidence:
    """Means of the transmitted force over successive bins."""

    model: explicit.Model  # the test. Its material and relaxation are those of the fit.
    edges: FloatArray  # edges of the bins [s], ascending, shape [n + 1]
    force: FloatArray  # mean force in each bin, compression-positive [N], shape [n]
    sigma: FloatArray  # its standard uncertainty [N], shape [n]
    held: Mapping[str, float]  # other parameters of a sample, e.g. "poisson" and "damping"
    threads: int | None = None  # CPU threads; all cores if left out
    label: str = "shot"  # name of the evidence, for tables

    @classmethod
    def of(cls, prepared: PreparedShot, numerics: Numerics) -> "ShotEvidence":
        """The evidence of a prepared shot. All values except rate and stiffness are those of the shot."""
        bins = prepared.observations.bins
        held = {
            name: float(p.held(prepared.forward.shot))
            for name, p in PARAMETERS.items()
            if name != "stiffness_factor" and not p.relaxes
        }
        return cls(
            prepared.forward.model(numerics), bins.edges, bins.mean, bins.sigma, held, numerics.threads
        )

    @property
    def values(self) -> FloatArray:
        """Mean force in each bin [N], shape [n]."""
        return self.force

    @property
    def time_scales(self) -> tuple[float, float]:
        """The narrowest bin and the whole window [s]."""
        return float(np.diff(self.edges).min()), float(self.edges[-1] - self.edges[0])

    def predict(self, law: Any, models: Sequence[RateModel]) -> FloatArray:
        """Mean force of each model [N], shape [n_models, n]; NaN where a simulation did not complete."""
        elastic = all(len(m.series) == 0 for m in models)
        model = replace(
            self.model, materials=(law,), relaxation=() if elastic else tuple(m.series for m in models)
        )
        samples = explicit.Samples.of(
            stiffness_factor=np.array([m.factor for m in models]),
            relaxation=np.zeros(len(models), np.int64) if elastic else np.arange(len(models)),
            **self.held,  # type: ignore[arg-type]
        )
        sampling = explicit.Sampling(self.edges, self.edges[-1:])
        response = explicit.run(model, samples, sampling, threads=self.threads)
        force = np.diff(response.impulse_transmission, axis=1) / np.diff(self.edges)
        completed = np.array([outcome.ok for outcome in response.outcomes])
        return np.where(completed[:, None], force, np.nan)
