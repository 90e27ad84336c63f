"""Profile likelihood: how much worse the best fit gets while one parameter is held elsewhere."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq
from scipy.special import chdtri

from doe.arrays import FloatArray
from doe.uncertainty.likelihood import Fit, Likelihood

LEVEL = float(chdtri(1, 0.05))
"""Rise of -2 ln L at the ends of a 95 % interval, 3.84 (Wilks)."""
BEYOND = 2.0
"""Rise over the level up to which small steps are taken."""
WIDEST_STEP = 1.0 / 12.0
"""Largest step in the unit box; beyond the interval too, so that a second one is not missed."""
LOWER = 0.01
"""A profile lower than the optimum by more found a better one, and the search starts again there."""
RESTARTS = 5
"""Most fresh starts from better optima."""

Interval = tuple[float | None, float | None]
"""Ends in parameter units; None where the box ends before the level is reached."""


@dataclass(frozen=True)
class Profile:
    """The profile likelihood of one parameter."""

    name: str
    """The parameter."""
    values: FloatArray
    """Where it was held, ascending, in its units, shape [n]."""
    rise: FloatArray
    """Deviance less that of the optimum, shape [n]."""
    points: FloatArray
    """Most likely points there, in parameter units, shape [n, d]."""
    discrepancies: FloatArray
    """Most likely discrepancies there, shape [n, n_channels]."""
    interval: Interval
    """Where the rise stays below the level, about the optimum."""
    alone: Interval
    """The same with all other parameters held at the optimum: what the data would say of this parameter
    if the others were known."""
    elsewhere: tuple[float, ...]
    """Values beyond the interval whose rise is below the level again: another optimum."""
    not_converged: int
    """Fits that were cut short; their rise is an upper bound."""
    level: float = LEVEL
    """Rise at the ends of the interval."""

    @property
    def closed(self) -> bool:
        """True if the interval has two ends."""
        return None not in self.interval


@dataclass(frozen=True)
class Profiles:
    """The most likely point and the profile of every parameter."""

    optimum: Fit
    """The most likely point of all that were met."""
    profiles: tuple[Profile, ...]
    """One a parameter, in the box's order."""
    level: float
    """Rise at the ends of the intervals of uncorrelated residuals."""
    restarts: int
    """How often a profile found a better optimum than the search before."""

    def __getitem__(self, name: str) -> Profile:
        """The profile of a parameter.

        Raises
        ------
        KeyError
            If there is none of that name.
        """
        for profile in self.profiles:
            if profile.name == name:
                return profile
        raise KeyError(f"no profile of {name!r}; there are {[profile.name for profile in self.profiles]}")


def profile_likelihoods(
    likelihood: Likelihood, start: ArrayLike, *, level: float = LEVEL, correlation: ArrayLike = 1.0
) -> Profiles:
    """Profile every parameter by re-optimisation over all others.

    From the optimum the parameter walks to both faces of the box, each fit starting from the one before,
    and back, each starting from the one outside it; the lower of the two counts. Ends of the intervals
    are roots of the re-optimised function, not interpolated. If a walk comes upon a better optimum, all
    profiles are taken again from there.

    Parameters
    ----------
    likelihood
        Of the data; its model is asked some hundred times a parameter, so give it a surrogate.
    start
        Where to begin, in parameter units, shape [d].
    level
        Rise of -2 ln L at the ends of the intervals, > 0; 3.84 for 95 %.
    correlation
        Factors > 0 on the level, one or one a parameter: by how much residuals that are correlated in a
        way the likelihood does not know raise the parameter's variance. With one parameter of interest the
        rise is then this factor times a chi-square variable (Rotnitzky and Jewell 1990).

    Raises
    ------
    ValueError
        If the start is outside the box or a level not > 0.
    RuntimeError
        If better optima keep appearing: the model is too rough for its derivatives.
    """
    if not 0.0 < level < np.inf:
        raise ValueError(f"level must be > 0, got {level}")
    box = likelihood.box
    levels = level * np.broadcast_to(np.asarray(correlation, dtype=np.float64), (box.dimension,))
    if not np.all((levels > 0.0) & np.isfinite(levels)):
        raise ValueError(f"correlation must be > 0, got {correlation!r}")
    x = box.require(np.atleast_2d(np.asarray(start, dtype=np.float64)), what="start")[0]
    best = likelihood.maximise(box.unit(x))
    for restarts in range(RESTARTS + 1):
        better: Fit | None = None
        profiles = []
        for j in range(box.dimension):
            walk = _Walk(likelihood, best, j, tuple(i for i in range(box.dimension) if i != j))
            alone = _Walk(likelihood, best, j, ())
            fits = walk.both_ways(levels[j])
            lowest = min(fits, key=lambda fit: fit.deviance)
            if lowest.deviance < best.deviance - LOWER and (
                better is None or lowest.deviance < better.deviance
            ):
                better = lowest
            if better is None:
                profiles.append(_profile(likelihood, walk, fits, alone, float(levels[j])))
        if better is None:
            return Profiles(best, tuple(profiles), level, restarts)
        best = likelihood.maximise(better.unit_point)
    raise RuntimeError(
        f"{RESTARTS} better optima in a row were met on the way: the model is not smooth enough for its "
        "differences; take a surrogate with a smaller leave-one-out error"
    )


class _Walk:
    """Fits with parameter j held, the parameters in `free` re-optimised."""

    def __init__(self, likelihood: Likelihood, best: Fit, j: int, free: tuple[int, ...]) -> None:
        self.likelihood, self.best, self.j = likelihood, best, j
        self.held = tuple(i for i in range(likelihood.box.dimension) if i not in free)
        jacobian = likelihood.jacobian(best.unit_point, best.discrepancies)
        information = float(jacobian[:, j] @ jacobian[:, j])
        # Half a conditional standard deviation: never wider than the profile's own.
        self.first = min(0.5 / np.sqrt(information), WIDEST_STEP) if information > 0.0 else WIDEST_STEP
        self.first = max(self.first, 1e-7)

    def at(self, u: float, warm: Fit) -> Fit:
        start = warm.unit_point.copy()
        start[self.j] = u
        return self.likelihood.maximise(start, held=self.held)

    def rise(self, fit: Fit) -> float:
        return fit.deviance - self.best.deviance

    def out(self, sign: float, level: float) -> list[Fit]:
        """Fits from the optimum to a face, in order, the optimum first."""
        fits, step = [self.best], self.first
        u, end = float(self.best.unit_point[self.j]), 0.5 * (1.0 + sign)
        while u != end:
            u = end if abs(end - u) <= 1.2 * step else u + sign * step
            fits.append(self.at(u, fits[-1]))
            change = abs(self.rise(fits[-1]) - self.rise(fits[-2]))
            if self.rise(fits[-1]) > BEYOND * level or change < 0.25 * level:
                step = min(1.6 * step, WIDEST_STEP)
            elif change > 0.5 * level:
                step = max(0.5 * step, 1e-7)
        # Back again: a valley that opens only further out is found from there.
        for i in range(len(fits) - 2, 0, -1):
            again = self.at(float(fits[i].unit_point[self.j]), fits[i + 1])
            if again.deviance < fits[i].deviance:
                fits[i] = again
        return fits

    def both_ways(self, level: float) -> list[Fit]:
        return [*reversed(self.out(-1.0, level)[1:]), *self.out(1.0, level)]

    def end(self, fits: list[Fit], level: float) -> tuple[float | None, int]:
        """Unit coordinate at which the rise first passes the level, and the index of the fit beyond."""
        for i in range(1, len(fits)):
            if self.rise(fits[i]) <= level:
                continue
            inside, outside = fits[i - 1], fits[i]
            a, b = float(inside.unit_point[self.j]), float(outside.unit_point[self.j])

            def excess(u: float, warm: tuple[Fit, Fit] = (inside, outside)) -> float:
                return min(self.rise(self.at(u, fit)) for fit in warm) - level

            if excess(b) <= 0.0:  # the other warm start found a better fit there
                continue
            return float(brentq(excess, a, b, xtol=1e-9, rtol=1e-9)), i
        return None, len(fits)

    def interval(self, fits: list[Fit], level: float) -> tuple[Interval, tuple[float, ...]]:
        """Ends in parameter units, and values beyond them whose rise is below the level again."""
        centre = next(i for i, fit in enumerate(fits) if fit is self.best)
        ends, elsewhere = [], []
        for side in (list(reversed(fits[: centre + 1])), fits[centre:]):
            u, beyond = self.end(side, level)
            ends.append(None if u is None else self._value(u))
            elsewhere += [float(f.point[self.j]) for f in side[beyond:] if self.rise(f) <= level]
        return (ends[0], ends[1]), tuple(sorted(elsewhere))

    def _value(self, u: float) -> float:
        point = self.best.unit_point.copy()
        point[self.j] = u
        return float(self.likelihood.box.scale(point)[self.j])


def _profile(likelihood: Likelihood, walk: _Walk, fits: list[Fit], alone: _Walk, level: float) -> Profile:
    interval, elsewhere = walk.interval(fits, level)
    single, _ = alone.interval(alone.both_ways(level), level)
    return Profile(
        name=likelihood.box.names[walk.j],
        values=np.array([fit.point[walk.j] for fit in fits]),
        rise=np.array([walk.rise(fit) for fit in fits]),
        points=np.stack([fit.point for fit in fits]),
        discrepancies=np.stack([fit.discrepancies for fit in fits]),
        interval=interval,
        alone=single,
        elsewhere=elsewhere,
        not_converged=sum(not fit.converged for fit in fits),
        level=level,
    )
