"""A planted Prony pair: three simulated shots, relaxation and a slow test, fitted together, over draws."""

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scene import DENSITY, LENGTH, RADIUS, speed_after_rise
from shot_evidence import ShotEvidence

from explicit import Model, cylinder
from explicit.materials import neo_hookean
from explicit.relaxation import PronySeries
from kolsky.material.relaxation.evidence import Evidence, HistoryTest, RateModel
from kolsky.material.relaxation.rate_fit import fit_prony, required_branches

FloatArray = NDArray[np.float64]

LAW = neo_hookean(20e3)
PLANTED = RateModel(1.05, PronySeries((0.35,), (4e-4,)))
SPEEDS = (1.0, 2.0, 3.5)
"""Speeds of the flyer [m/s]: 150 to 540 per second."""
DEPTH = 0.4
"""Compression at which a shot ends [-]: past it the side of this coarse mesh lands node by node."""
NOISE, BINS, DRAWS = 0.2, 40, 12
"""Noise of a bin's mean force [N], bins of a shot, draws of the noise."""


@dataclass(frozen=True)
class ShotFit:
    """One shot of the first draw."""

    label: str
    """Its speed."""
    time: FloatArray
    """Middle of the bins [s]."""
    force: FloatArray
    """Data [N]."""
    with_branch: FloatArray
    """The fit with a branch [N]."""
    without: FloatArray
    """The best that a factor alone does [N]."""


@dataclass(frozen=True)
class Recovery:
    """The planted pair found again."""

    planted: FloatArray
    """Factor, strength, time, shape [3]."""
    values: FloatArray
    """Found in each draw, shape [n_draws, 3]."""
    sigmas: FloatArray
    """Standard uncertainties of their logarithms [-], shape [n_draws, 3]."""
    shots: tuple[ShotFit, ...]
    """The shots of the first draw."""
    sentence: str
    """The verdict of the first draw."""
    asked: tuple[int, int]
    """Branches asked for, of the relaxing and of the elastic specimen."""
    sentence_elastic: str
    """The verdict of the elastic specimen."""
    noise: float = NOISE
    """Noise of a bin [N]."""

    @property
    def normalised(self) -> FloatArray:
        """Errors over their standard uncertainties [-], shape [n_draws, 3]."""
        return np.asarray(np.log(self.values / self.planted) / self.sigmas)

    @property
    def rms(self) -> float:
        """Their root mean square [-]."""
        return float(np.sqrt(np.mean(self.normalised**2)))

    @property
    def speeds(self) -> str:
        """The speeds in words."""
        return ", ".join(f"{speed:g}" for speed in SPEEDS) + " m/s"


@cache
def clean(truth: RateModel) -> tuple[Evidence, ...]:
    """What noiseless instruments would have seen of a specimen."""
    found: list[Evidence] = []
    for speed in SPEEDS:
        end = DEPTH * LENGTH / speed
        model = Model(
            cylinder(RADIUS, LENGTH, n_radial=4, n_axial=6),
            DENSITY,
            (LAW,),
            (speed_after_rise(speed, 80e-6, end=end),),
        )
        blank = ShotEvidence(
            model=model,
            edges=np.linspace(0.0, end, BINS + 1),
            force=np.zeros(BINS),
            sigma=np.full(BINS, NOISE),
            held={"poisson": 0.49, "damping": 2.5e-5},
            threads=1,
            label=f"{speed:g} m/s",
        )
        found.append(replace(blank, force=blank.predict(LAW, [truth])[0]))
    held = HistoryTest.relaxation(np.geomspace(1e-2, 20.0, 30), np.zeros(30), 50.0, stretch=0.8, rise=5e-3)
    slow = HistoryTest(
        np.linspace(0.0, 60.0, 30), np.linspace(1.0, 0.6, 30), np.zeros(30), np.full(30, 80.0), "slow"
    )
    found += [replace(test, stress=test.predict(LAW, [truth])[0]) for test in (held, slow)]
    return tuple(found)


def noisy(truth: RateModel, seed: int) -> list[Evidence]:
    """The same with noise."""
    rng = np.random.default_rng(seed)
    made: list[Evidence] = []
    for one in clean(truth):
        noise = np.where(np.isfinite(one.sigma), one.sigma, 0.0) * rng.standard_normal(len(one.values))
        name = "force" if isinstance(one, ShotEvidence) else "stress"
        made.append(replace(one, **{name: one.values + noise}))  # type: ignore[type-var]
    return made


@cache
def recovery() -> Recovery:
    """The first draw from the grid of strengths and times, the others from the planted pair."""
    first = noisy(PLANTED, 3)
    verdict = required_branches(LAW, first, at_most=1, max_evaluations=20)
    elastic = required_branches(
        LAW, noisy(RateModel(1.05, PronySeries((), ())), 4), at_most=1, max_evaluations=20
    )
    fits = [verdict.fits[1]]
    fits += [
        fit_prony(LAW, noisy(PLANTED, 10 + k), 1, start=PLANTED, max_evaluations=10) for k in range(DRAWS - 1)
    ]
    shots = []
    for one in first[: len(SPEEDS)]:
        assert isinstance(one, ShotEvidence)
        with_branch = one.predict(LAW, [verdict.fits[1].model])[0]
        without = one.predict(LAW, [verdict.fits[0].model])[0]
        middle = 0.5 * (one.edges[1:] + one.edges[:-1])
        shots.append(ShotFit(one.label, middle, one.force, with_branch, without))
    return Recovery(
        planted=np.array([PLANTED.factor, *PLANTED.series.strengths, *PLANTED.series.times]),
        values=np.stack([fit.values for fit in fits]),
        sigmas=np.stack([np.sqrt(np.diag(fit.covariance)) for fit in fits]),
        shots=tuple(shots),
        sentence=verdict.sentence,
        asked=(verdict.branches, elastic.branches),
        sentence_elastic=elastic.sentence,
    )
