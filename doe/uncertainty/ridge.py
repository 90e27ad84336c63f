"""Directions in which the data do not decide: eigenvectors of the information, and the profile's path."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from doe.arrays import FloatArray
from doe.uncertainty.likelihood import Likelihood
from doe.uncertainty.profile import Profile, Profiles

LOADING = 0.1
"""Smallest component of a direction of length one, in the unit box, that is put into words."""


@dataclass(frozen=True)
class Direction:
    """An eigenvector of the information at the optimum, in the unit box."""

    vector: FloatArray
    """Its components, length one, largest positive [-], shape [d]."""
    reach: float
    """Distance along it at which -2 ln L has risen to the level, in edges of the box [-]: above 1 the
    box ends first; infinite if the data do not move at all."""
    words: str
    """The direction in words and numbers."""


def directions(likelihood: Likelihood, profiles: Profiles) -> tuple[Direction, ...]:
    """Eigenvectors of the information J^T C^-1 J at the optimum, the least decided first.

    They are those of parameters scaled to their bounds: another box has others.

    Parameters
    ----------
    likelihood
        Of the data.
    profiles
        Holds the optimum and the level.
    """
    best = profiles.optimum
    jacobian = likelihood.jacobian(best.unit_point, best.discrepancies)
    values, vectors = np.linalg.eigh(jacobian.T @ jacobian)
    found = []
    for value, column in zip(values, vectors.T, strict=True):
        vector = column * np.sign(column[np.argmax(np.abs(column))])
        reach = float(np.sqrt(profiles.level / value)) if value > 1e-12 * values[-1] else np.inf
        found.append(Direction(vector, reach, _words(likelihood.box.names, vector, reach)))
    return tuple(found)


def _words(names: tuple[str, ...], vector: FloatArray, reach: float) -> str:
    order = [j for j in np.argsort(-np.abs(vector)) if abs(vector[j]) >= LOADING]
    first, *others = [(names[j], float(vector[j])) for j in order]
    text = f"{first[0]} alone" if not others else f"{first[0]} up"
    for name, loading in others:
        text += f", {name} {'up' if loading > 0.0 else 'down'} by {abs(loading) / first[1]:.2g} times as much"
    unit = "" if not others else " (in edges of the box)"
    return text + unit + (f", undecided over {reach:.2g} edges" if np.isfinite(reach) else ", not seen")


@dataclass(frozen=True)
class Partner:
    """A parameter that makes up for another one's change."""

    name: str
    """Which."""
    change: float
    """How far it moves along the path, in its units."""
    per: float
    """How far the other one moves meanwhile, in that one's units."""
    cost: float
    """Rise of -2 ln L if this one moved so far alone."""


def partners(likelihood: Likelihood, profiles: Profiles, profile: Profile) -> tuple[Partner, ...]:
    """Parameters that make up for another one's change along its profile, the most needed first.

    At both ends of the interval, or of the box where the interval is open, it is asked what the move of
    each other parameter would cost alone. One whose move costs more than the level made the difference;
    one that drifts at no cost did not.

    Parameters
    ----------
    likelihood
        Of the data.
    profiles
        Holds the optimum and the level.
    profile
        Of the parameter in question.
    """
    box, best = likelihood.box, profiles.optimum
    j = box.names.index(profile.name)
    found: dict[str, Partner] = {}
    for i in _ends(profile, best.point[j]):
        away = box.unit(profile.points[i])
        for k, name in enumerate(box.names):
            if k == j:
                continue
            moved = best.unit_point.copy()
            moved[k] = away[k]
            residual = likelihood.residuals(moved)[0]
            cost = likelihood.deviance(residual, likelihood.discrepancies(residual)) - best.deviance
            change, per = (float(profile.points[i][m] - best.point[m]) for m in (k, j))
            if cost > profile.level and (name not in found or cost > found[name].cost):
                found[name] = Partner(name, change, per, cost)
    return tuple(sorted(found.values(), key=lambda partner: -partner.cost))


def _ends(profile: Profile, centre: float) -> list[int]:
    """Indices of the fits at the ends of the interval, the faces of the box where it is open."""
    lower, upper = profile.interval
    inside = np.flatnonzero(
        (profile.values >= (profile.values[0] if lower is None else lower))
        & (profile.values <= (profile.values[-1] if upper is None else upper))
    )
    return [int(i) for i in dict.fromkeys((inside[0], inside[-1])) if profile.values[i] != centre]
