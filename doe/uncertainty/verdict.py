"""Verdicts on the parameters from their profiles: one word each, with its reasons."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

from doe.uncertainty.likelihood import Likelihood
from doe.uncertainty.profile import Interval, Profile, Profiles
from doe.uncertainty.ridge import Partner, partners

INFLATION = 3.0
"""Length of an interval over its length with the other parameters known, from which on it is said that
it rests on them: a correlation above 0.94 for a quadratic."""


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
    """The parameter."""
    kind: VerdictKind
    """In one word."""
    interval: Interval
    """From the profile likelihood; None where it is open."""
    inflation: float | None
    """Length of the interval over its length with the others known [-]; None if one of them is open."""
    partners: tuple[Partner, ...]
    """Parameters that make up for this one's change, the most needed first."""
    text: str
    """The verdict in a sentence."""


def verdicts(likelihood: Likelihood, profiles: Profiles) -> tuple[Verdict, ...]:
    """A verdict for each parameter, from its profile and from what it does alone.

    A profile that passes the level on both sides identifies its parameter inside the box. On a side
    where it does not, the parameter is held at that face with the others at the optimum: if this alone
    passes the level, the data do see the parameter and others make up for it, a ridge. If not, the data
    bound it on one side, or on none: not seen.

    Parameters
    ----------
    likelihood
        Of the data.
    profiles
        Its profiles.
    """
    return tuple(_verdict(likelihood, profiles, profile) for profile in profiles.profiles)


def _verdict(likelihood: Likelihood, profiles: Profiles, profile: Profile) -> Verdict:
    made_up = any(
        end is None and alone is not None for end, alone in zip(profile.interval, profile.alone, strict=True)
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
    others = partners(likelihood, profiles, profile) if leans else ()
    text = _sentence(profile, kind, inflation if leans else None, others)
    return Verdict(profile.name, kind, profile.interval, inflation, others, text)


def _inflation(profile: Profile) -> float | None:
    (lower, upper), (below, above) = profile.interval, profile.alone
    if lower is None or upper is None or below is None or above is None:
        return None
    return (upper - lower) / (above - below)


def _sentence(
    profile: Profile, kind: VerdictKind, inflation: float | None, others: tuple[Partner, ...]
) -> str:
    name, (lower, upper) = profile.name, profile.interval
    bounds = _bounds(lower, upper)
    box = f"in the box [{profile.values[0]:.5g}, {profile.values[-1]:.5g}]"
    path = "; ".join(
        f"{other.name} {other.change:+.3g} makes up for {name} {other.per:+.3g}" for other in others
    )
    if kind is VerdictKind.NOT_SEEN:
        return f"{name} is not seen: no value {box} fits significantly worse, the others held or not"
    if kind is VerdictKind.RIDGE:
        who = " and ".join(other.name for other in others) or "the others together"
        text = f"{name} lies on a ridge with {who} that runs out of the box"
        text += f" ({bounds})" if bounds else ""
        text += f": {path}" if path else ""
    elif kind is VerdictKind.ONE_SIDED:
        text = f"{name} is {bounds}; {box} nothing bounds it on the other side"
    else:
        text = f"{name} is identified, {bounds}"
        if inflation is not None:
            text += f"; its interval is {inflation:.1f} times longer than with the others known"
            text += f" ({path})" if path else ""
    if profile.elsewhere:
        text += f"; values about {', '.join(f'{value:.4g}' for value in profile.elsewhere)} fit as well"
    if profile.not_converged:
        text += f"; {profile.not_converged} fits were cut short"
    return text


def _bounds(lower: float | None, upper: float | None) -> str:
    if lower is not None and upper is not None:
        # As many digits as tell the ends apart to a hundredth of their distance.
        size = max(abs(lower), abs(upper)) / (upper - lower)
        digits = max(5, 3 + math.ceil(math.log10(size)))
        return f"between {lower:.{digits}g} and {upper:.{digits}g}"
    if lower is not None:
        return f"at least {lower:.5g}"
    return "" if upper is None else f"at most {upper:.5g}"
