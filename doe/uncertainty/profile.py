"""Profile likelihoods, and verdicts on the parameters.

A profile shows how much the best fit deteriorates if one parameter is fixed at another value. A verdict
classifies a parameter by one word and gives the reasons.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq
from scipy.special import chdtri

from doe.arrays import FloatArray
from doe.uncertainty.likelihood import Fit, Likelihood

LEVEL = float(chdtri(1, 0.05))
"""Rise of -2 ln L at the ends of a 95 % interval, 3.84 (Wilks)."""
BEYOND = 2.0
"""Small steps are used up to this rise over the level."""
WIDEST_STEP = 1.0 / 12.0
"""Largest step in the unit box. It also applies beyond the interval, to find a second interval."""
LOWER = 0.01
"""If a profile is below the optimum by more than this, it has found a better optimum. The search restarts
there."""
REST = 1e-6
"""Error of a rise by the end of a search [-]; small beside the level."""
RESTARTS = 5
"""Largest number of restarts from better optima."""

Interval = tuple[float | None, float | None]
"""Ends in parameter units; None if the level is not reached inside the box."""


@dataclass(frozen=True)
class Profile:
    """The profile likelihood of one parameter."""

    name: str
    values: FloatArray
    """Values at which the parameter was fixed, ascending, in its units, shape [n]."""
    rise: FloatArray
    """Deviance minus that of the optimum, shape [n]."""
    points: FloatArray
    """Most likely point at each of these values, in parameter units, shape [n, d]."""
    interval: Interval
    """Interval around the optimum in which the rise stays below the level."""
    conditional: Interval
    """The same interval with all other parameters fixed at the optimum: they count as known exactly."""
    other_optima: tuple[float, ...]
    """Values outside the interval with a rise below the level: another optimum."""
    not_converged: int
    """Number of fits that did not converge. Their rise is an upper bound."""
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
    """The most likely point of all fits."""
    profiles: tuple[Profile, ...]
    level: float
    """Rise at the ends of the intervals if residuals are uncorrelated."""
    restarts: int
    """Number of times that a profile found a better optimum than the search."""

    def __getitem__(self, name: str) -> Profile:
        """The profile of a parameter. Raises KeyError for an unknown name."""
        for profile in self.profiles:
            if profile.name == name:
                return profile
        raise KeyError(f"no profile of {name!r}; there are {[profile.name for profile in self.profiles]}")


def profile_likelihoods(
    likelihood: Likelihood, start: ArrayLike, *, correlation: ArrayLike = 1.0
) -> Profiles:
    """Profile likelihood of every parameter, by re-optimising all others.

    The parameter is stepped from the optimum to both faces of the box. Each fit starts from the previous one.
    The parameter is then stepped back, and the lower of the two deviances is used. Ends of the intervals are
    roots of the re-optimised function. If a better optimum is found, all profiles are recomputed from this
    optimum.

    Parameters
    ----------
    likelihood
        Likelihood of the data. Its model is evaluated some hundred times for each parameter, so use a
        surrogate.
    start
        First point, in parameter units, shape [d].
    correlation
        Factors > 0 on the rise of 3.84 at the ends of 95 % intervals: one for all parameters, or one for
        each. Correlations that the likelihood does not model increase the parameter's variance by this
        factor. With one parameter of interest the rise is then this factor times a chi-square variable
        (Rotnitzky and Jewell 1990).

    Raises
    ------
    ValueError
        If the start is outside the box, or a correlation is not > 0.
    RuntimeError
        If too many restarts find better optima: the model is too rough for its derivatives.
    """
    box = likelihood.box
    levels = LEVEL * np.broadcast_to(np.asarray(correlation, dtype=np.float64), (box.dimension,))
    if not np.all((levels > 0.0) & np.isfinite(levels)):
        raise ValueError(f"correlation must be > 0, got {correlation!r}")
    x = box.require(np.atleast_2d(np.asarray(start, dtype=np.float64)), what="start")[0]
    best = likelihood.maximise(box.unit(x))
    for restarts in range(RESTARTS + 1):
        better: Fit | None = None
        profiles = []
        for j in range(box.dimension):
            walk = _Walk(likelihood, best, j, tuple(i for i in range(box.dimension) if i != j))
            single = _Walk(likelihood, best, j, ())
            fits = walk.both_ways(levels[j])
            lowest = min(fits, key=lambda fit: fit.deviance)
            if lowest.deviance < best.deviance - LOWER and (
                better is None or lowest.deviance < better.deviance
            ):
                better = lowest
            if better is None:
                profiles.append(_profile(likelihood, walk, fits, single, float(levels[j])))
        if better is None:
            return Profiles(best, tuple(profiles), LEVEL, restarts)
        best = likelihood.maximise(better.unit_point)
    raise RuntimeError(
        f"{RESTARTS} better optima in a row were met on the way: the model is not smooth enough for its "
        "differences; take a surrogate with a smaller leave-one-out error"
    )


class _Walk:
    """Fits with parameter j fixed and the parameters in `free` re-optimised."""

    def __init__(self, likelihood: Likelihood, best: Fit, j: int, free: tuple[int, ...]) -> None:
        self.likelihood, self.best, self.j = likelihood, best, j
        self.held = tuple(i for i in range(likelihood.box.dimension) if i not in free)
        jacobian = likelihood.jacobian(best.unit_point)
        information = float(jacobian[:, j] @ jacobian[:, j])
        # Half a conditional standard deviation: never wider than the profile's own.
        self.first = min(0.5 / np.sqrt(information), WIDEST_STEP) if information > 0.0 else WIDEST_STEP
        self.first = max(self.first, 1e-7)

    def at(self, u: float, warm: Fit) -> Fit:
        start = warm.unit_point.copy()
        start[self.j] = u
        return self.likelihood.maximise(start, held=self.held, rest=REST)

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
        # Then back: this finds a valley that begins farther out.
        for i in range(len(fits) - 2, 0, -1):
            refit = self.at(float(fits[i].unit_point[self.j]), fits[i + 1])
            if refit.deviance < fits[i].deviance:
                fits[i] = refit
        return fits

    def both_ways(self, level: float) -> list[Fit]:
        return [*reversed(self.out(-1.0, level)[1:]), *self.out(1.0, level)]

    def end(self, fits: list[Fit], level: float) -> tuple[float | None, int]:
        """Unit coordinate at which the rise first passes the level, and the index of the next fit."""
        for i in range(1, len(fits)):
            if self.rise(fits[i]) <= level:
                continue
            inside, outside = fits[i - 1], fits[i]
            a, b = float(inside.unit_point[self.j]), float(outside.unit_point[self.j])

            def excess(u: float, warm: tuple[Fit, Fit] = (inside, outside)) -> float:
                return min(self.rise(self.at(u, fit)) for fit in warm) - level

            if excess(b) <= 0.0:  # the other start found a better fit there
                continue
            return float(brentq(excess, a, b, xtol=1e-9, rtol=1e-9)), i
        return None, len(fits)

    def interval(self, fits: list[Fit], level: float) -> tuple[Interval, tuple[float, ...]]:
        """Ends in parameter units, and values outside them with a rise below the level."""
        centre = next(i for i, fit in enumerate(fits) if fit is self.best)
        ends, beyond_ends = [], []
        for side in (list(reversed(fits[: centre + 1])), fits[centre:]):
            u, beyond = self.end(side, level)
            ends.append(None if u is None else self._value(u))
            beyond_ends += [float(f.point[self.j]) for f in side[beyond:] if self.rise(f) <= level]
        return (ends[0], ends[1]), tuple(sorted(beyond_ends))

    def _value(self, u: float) -> float:
        point = self.best.unit_point.copy()
        point[self.j] = u
        return float(self.likelihood.box.scale(point)[self.j])


def _profile(likelihood: Likelihood, walk: _Walk, fits: list[Fit], fixed: _Walk, level: float) -> Profile:
    interval, outside = walk.interval(fits, level)
    single, _ = fixed.interval(fixed.both_ways(level), level)
    return Profile(
        name=likelihood.box.names[walk.j],
        values=np.array([fit.point[walk.j] for fit in fits]),
        rise=np.array([walk.rise(fit) for fit in fits]),
        points=np.stack([fit.point for fit in fits]),
        interval=interval,
        conditional=single,
        other_optima=outside,
        not_converged=sum(not fit.converged for fit in fits),
        level=level,
    )


@dataclass(frozen=True)
class Partner:
    """A parameter that compensates for a change of another one."""

    name: str
    change: float
    """Change of this parameter along the profile, in its units."""
    per: float
    """Change of the profiled parameter over the same path, in that parameter's units."""
    cost: float
    """Rise of -2 ln L if only this parameter changed by that amount."""


def partners(likelihood: Likelihood, profiles: Profiles, profile: Profile) -> tuple[Partner, ...]:
    """Parameters that compensate for a change of another one along its profile, the most important first.

    The test is made at both ends of the interval, or of the box where the interval is open. Each other
    parameter is changed separately by its change along the profile. It compensates if this increases the
    deviance by more than the level.
    """
    box, best = likelihood.box, profiles.optimum
    j = box.names.index(profile.name)
    by_name: dict[str, Partner] = {}
    for i in _ends(profile, best.point[j]):
        away = box.unit(profile.points[i])
        for k, name in enumerate(box.names):
            if k == j:
                continue
            shifted = best.unit_point.copy()
            shifted[k] = away[k]
            residual = likelihood.residuals(shifted)[0]
            cost = likelihood.deviance(residual) - best.deviance
            change, per = (float(profile.points[i][m] - best.point[m]) for m in (k, j))
            if cost > profile.level and (name not in by_name or cost > by_name[name].cost):
                by_name[name] = Partner(name, change, per, cost)
    return tuple(sorted(by_name.values(), key=lambda partner: -partner.cost))


def _ends(profile: Profile, centre: float) -> list[int]:
    """Indices of the fits at the ends of the interval, or at the faces of the box where it is open."""
    lower, upper = profile.interval
    inside = np.flatnonzero(
        (profile.values >= (profile.values[0] if lower is None else lower))
        & (profile.values <= (profile.values[-1] if upper is None else upper))
    )
    return [int(i) for i in dict.fromkeys((inside[0], inside[-1])) if profile.values[i] != centre]


INFLATION = 3.0
"""Length of an interval over its length with the other parameters known. Above this ratio the dependence on
them is reported. For a quadratic this is a correlation above 0.94."""


class VerdictKind(Enum):
    """The kinds of verdict on a parameter."""

    IDENTIFIED = "identified"
    ONE_SIDED = "one-sided bound"
    RIDGE = "ridge"
    NOT_SEEN = "not seen"


@dataclass(frozen=True)
class Verdict:
    """The verdict on one parameter inside the box."""

    name: str
    kind: VerdictKind
    interval: Interval
    """Interval of the profile likelihood; None at an open end."""
    inflation: float | None
    """Length of the interval over its length with the others known [-]; None if one of them is open."""
    partners: tuple[Partner, ...]
    """Parameters that compensate for a change of this one, the most important first."""
    text: str


def verdicts(likelihood: Likelihood, profiles: Profiles) -> tuple[Verdict, ...]:
    """A verdict for each parameter, from its profile and from its effect with the others fixed.

    A profile that passes the level on both sides identifies its parameter inside the box. On the other sides
    the parameter is set to the face, with the other parameters at the optimum. If the rise then passes the
    level, the data depend on the parameter, but others compensate for it: a ridge. Otherwise the data bound
    it on one side only, or on no side: not seen.
    """
    return tuple(_verdict(likelihood, profiles, profile) for profile in profiles.profiles)


def _verdict(likelihood: Likelihood, profiles: Profiles, profile: Profile) -> Verdict:
    made_up = any(
        end is None and single is not None
        for end, single in zip(profile.interval, profile.conditional, strict=True)
    )
    if profile.closed:
        kind = VerdictKind.IDENTIFIED
    elif made_up:
        kind = VerdictKind.RIDGE
    elif profile.interval == (None, None):
        kind = VerdictKind.NOT_SEEN
    else:
        kind = VerdictKind.ONE_SIDED
    inflation = _inflation(profile)
    leans = kind is VerdictKind.RIDGE or (inflation is not None and inflation >= INFLATION)
    partners_of_profile = partners(likelihood, profiles, profile) if leans else ()
    text = _sentence(profile, kind, inflation if leans else None, partners_of_profile)
    return Verdict(profile.name, kind, profile.interval, inflation, partners_of_profile, text)


def _inflation(profile: Profile) -> float | None:
    (lower, upper), (below, above) = profile.interval, profile.conditional
    if lower is None or upper is None or below is None or above is None:
        return None
    return (upper - lower) / (above - below)


def _sentence(
    profile: Profile, kind: VerdictKind, inflation: float | None, partner_list: tuple[Partner, ...]
) -> str:
    name, (lower, upper) = profile.name, profile.interval
    bounds = _bounds(lower, upper)
    box = f"in the box [{profile.values[0]:.5g}, {profile.values[-1]:.5g}]"
    path = "; ".join(
        f"{partner.name} {partner.change:+.3g} makes up for {name} {partner.per:+.3g}"
        for partner in partner_list
    )
    if kind is VerdictKind.NOT_SEEN:
        return f"{name} is not seen: no value {box} fits significantly worse, the others held or not"
    if kind is VerdictKind.RIDGE:
        partner_names = " and ".join(partner.name for partner in partner_list) or "the others together"
        text = f"{name} lies on a ridge with {partner_names} that runs out of the box"
        text += f" ({bounds})" if bounds else ""
        text += f": {path}" if path else ""
    elif kind is VerdictKind.ONE_SIDED:
        text = f"{name} is {bounds}; {box} nothing bounds it on the other side"
    else:
        text = f"{name} is identified, {bounds}"
        if inflation is not None:
            text += f"; its interval is {inflation:.1f} times longer than with the others known"
            text += f" ({path})" if path else ""
    if profile.other_optima:
        text += f"; values about {', '.join(f'{value:.4g}' for value in profile.other_optima)} fit as well"
    if profile.not_converged:
        text += f"; {profile.not_converged} fits were cut short"
    return text


def _bounds(lower: float | None, upper: float | None) -> str:
    if lower is not None and upper is not None:
        # The digits resolve a hundredth of the distance between the ends.
        size = max(abs(lower), abs(upper)) / (upper - lower)
        digits = max(5, 3 + math.ceil(math.log10(size)))
        return f"between {lower:.{digits}g} and {upper:.{digits}g}"
    if lower is not None:
        return f"at least {lower:.5g}"
    return "" if upper is None else f"at most {upper:.5g}"
