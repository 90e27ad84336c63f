"""Constants of a branch that the data do not ask for: what is known of them, and what it would take.

The strength has a value and an interval, whose upper end is a finding. How fast nothing relaxes is not a
question: the slopes that would answer it are those of a strength that may be nothing, so that the time keeps
its range, each value of which is as likely.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from kolsky.inverse.parameters import PARAMETERS
from kolsky.inverse.result import Estimate, Verdict

STRENGTHS = ("prony_strength", "creep_ratio")
"""How the names of strengths begin."""
SEEN = 2.0
"""Strength over its standard uncertainty, that of the mesh included, above which it is one [-]."""
RANGE = "range of the search"
"""Source of the uncertainty of what is not seen."""


def is_strength(name: str) -> bool:
    """Whether a parameter says how strong what relaxes is."""
    return name.startswith(STRENGTHS)


def unseen(e: Estimate) -> Estimate:
    """An estimate of what the data do not ask for; other parameters stay as they are.

    Parameters
    ----------
    e
        As estimated.
    """
    if not PARAMETERS[e.name].relaxes:
        return e
    if is_strength(e.name):
        return replace(e, outcome=Verdict.NOT_SEEN)
    low, high = e.searched
    width = (high - low) / 12.0**0.5  # standard deviation of values that are evenly likely
    nothing = dict.fromkeys(e.noise_parts, 0.0)
    return replace(
        e,
        value=e.on_mesh,
        sigma_noise=width,
        sigma_numerical=0.0,
        sigma_systematic=0.0,
        mesh_shift=0.0,
        mesh_correction=0.0,
        noise_parts={**nothing, RANGE: width},
        numerical_parts=dict.fromkeys(e.numerical_parts, 0.0),
        outcome=Verdict.NOT_SEEN,
    )


def interval(e: Estimate, half: float) -> tuple[float, float]:
    """Interval of a half width, within the range that was searched; all of it where that alone is known.

    Parameters
    ----------
    e
        The estimate.
    half
        Half width of its 95 % interval, in its unit.
    """
    return e.searched if RANGE in e.noise_parts else e.within(half)


def needed(estimates: Mapping[str, Estimate]) -> list[str]:
    """What it would take to see constants that were not seen, a sentence a branch.

    Of a branch whose strength is none of the reasons (its time ends at a bound) nothing is said here.

    Parameters
    ----------
    estimates
        All shared parameters.
    """
    said = []
    for name, e in estimates.items():
        weak = e.value <= SEEN * e.sigma
        if not is_strength(name) or e.outcome is not Verdict.NOT_SEEN or not weak:
            continue
        other = rate_of(name)
        rest = f", and without one {other} has no value" if other in estimates else ""
        said.append(
            f"{name} and what depends on it are not seen: it takes a strength above {SEEN * e.sigma:.2g}, "
            f"{SEEN:g} standard uncertainties with the mesh's{rest}; more shots, finer meshes or a slow test "
            "as fast as the branch would see a weaker one"
        )
    return said


def rate_of(strength: str) -> str:
    """The parameter that says how fast what has a strength relaxes."""
    return "creep_resistance" if strength == "creep_ratio" else strength.replace("strength", "time")
