"""A shot as evidence of rate dependence: its transmitted force is simulated for many rate models in one
batch."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

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
    held: Mapping[str, float] = field(default_factory=dict)
    """Other parameters of a sample, such as "poisson", "damping" and "friction": arguments of
    `explicit.Samples.of`."""
    stepping: explicit.Stepping = field(default_factory=explicit.Stepping)
    """Numerical choices of the time loop."""
    device: str = "cpu"  # "cpu" or a CUDA device
    threads: int | None = None  # CPU threads; all cores if left out
    label: str = "shot"  # name of the evidence, for tables

    @classmethod
    def of(cls, prepared: PreparedShot, numerics: Numerics) -> "ShotEvidence":
        """The evidence of a prepared shot. All values except rate and stiffness are those of the shot.

        Raises ValueError if the transducer is behind the platen's face.
        """
        shot, bins = prepared.forward.shot, prepared.observations.bins
        if shot.transducer_depth or shot.behind or shot.flyer_body:
            raise ValueError(
                f"{shot.name}: a transducer behind the face, or elastic parts, are not known here; put it at "
                "the face of a rigid support or a bar"
            )
        held = {
            name: float(p.held(shot))
            for name, p in PARAMETERS.items()
            if name != "stiffness_factor" and not p.relaxes
        }
        return cls(
            model=prepared.forward.model(numerics),
            edges=bins.edges,
            force=bins.mean,
            sigma=bins.sigma,
            held=held,
            stepping=explicit.Stepping(safety=numerics.safety, precision=numerics.precision or "fp64"),
            device=numerics.device,
            threads=numerics.threads,
            label=f"shot {shot.name}",
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
        response = self.simulate(law, models)
        force = np.diff(response.impulse_transmission, axis=1) / np.diff(self.edges)
        completed = np.array([outcome.ok for outcome in response.outcomes])
        return np.where(completed[:, None], force, np.nan)

    def simulate(self, law: Any, models: Sequence[RateModel]) -> explicit.Response:
        """The simulations of this shot, one for each model."""
        elastic = all(len(m.series) == 0 for m in models)
        model = replace(
            self.model, materials=(law,), relaxation=() if elastic else tuple(m.series for m in models)
        )
        given: dict[str, ArrayLike] = dict(self.held)
        samples = explicit.Samples.of(
            stiffness_factor=np.array([m.factor for m in models]),
            relaxation=np.zeros(len(models), np.int64) if elastic else np.arange(len(models)),
            **given,  # type: ignore[arg-type]
        )
        sampling = explicit.Sampling(self.edges, self.edges[-1:])
        return explicit.run(
            model, samples, sampling, stepping=self.stepping, device=self.device, threads=self.threads
        )
