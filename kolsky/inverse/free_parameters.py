"""Which parameters are free where the user does not say: those that the shot's data can tell.

The ringing of the force fixes Poisson's ratio and damping better than a data sheet does, as long as the
specimen keeps its hold on the platens. So the stiffness factor, Poisson's ratio and damping are free by
default. What shot.toml declares of them is used for what it says:

- a standard uncertainty in [uncertainty] makes the declared value a Gaussian prior,
- an uncertainty of 0 says that the value is exact: it is held,
- no entry says nothing of how wrong the value may be, and it has no part: the parameter is uniform in the
  range of its design. A width that nobody stated would be ours, and would pull the answer.

What relaxes is free where the shot's [relaxation] says so, and only where it has an outline: without one a
branch and the stiffness factor are told apart by the force's fall alone.

Where surfaces slide or let go the response is rough, contact and damping tell themselves apart badly, and the
stiffness factor alone is free; so it is where no outline was measured, and nothing contradicts the force.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace

from kolsky.inverse.parameters import PARAMETERS, any_slides
from kolsky.inverse.prior import Prior
from kolsky.inverse.settings import Settings
from kolsky.shot.records import Shot

DEFAULT = ("stiffness_factor", "poisson", "damping")
"""Parameters that are free where a shot's data can tell them."""
ALONE = ("stiffness_factor",)
"""What is free where a surface slides or lets go."""

ASKED, EXACT = "held as asked", "declared exact in [uncertainty]"
BLIND = "held because no outline was measured"
SLIDES = "held because a surface slides or lets go"
KNOWN = (ASKED, EXACT, SLIDES, BLIND)
"""Reasons to hold a parameter that are known before any run."""

Bounds = tuple[float, float] | None


@dataclass(frozen=True)
class Freed:
    """Settings in which every parameter is either free or held, and why some are held."""

    settings: Settings
    """With `free` filled in."""
    by_default: bool
    """Whether the free parameters are the default's choice, and may be held if the data cannot tell them."""
    reasons: Mapping[str, str]
    """Why a parameter of `DEFAULT` is held, by its name."""

    @property
    def free(self) -> Mapping[str, Bounds]:
        """Free parameters and their bounds."""
        assert self.settings.free is not None
        return self.settings.free

    def prior(self, shot: Shot) -> Prior | None:
        """The priors of the free parameters from the shot's [uncertainty]; None if it declares none."""
        declared = {
            name: (PARAMETERS[name].held(shot), shot.uncertainty[name])
            for name in self.free
            if name in PARAMETERS and shot.uncertainty.get(name, 0.0) > 0.0
        }
        return Prior.of(tuple(self.free), declared)

    def said(self, shot: Shot) -> Iterator[str]:
        """Say which parameters the data could not tell: one sentence each."""
        for name, why in self.reasons.items():
            if why not in KNOWN:
                p = PARAMETERS[name]
                value = f"{p.held(shot) * p.shown_factor:.6g}" + (
                    "" if p.shown_unit == "1" else f" {p.shown_unit}"
                )
                yield f"{name} = {value} as declared, {why}: the answer holds if that is right"

    def holding(self, reasons: Mapping[str, str]) -> Freed:
        """The same with parameters held at the shot's values, for a reason each."""
        free = {name: bounds for name, bounds in self.free.items() if name not in reasons}
        return replace(self, settings=replace(self.settings, free=free), reasons={**self.reasons, **reasons})


def choose(settings: Settings, shot: Shot) -> Freed:
    """Fill in what the settings leave open.

    Parameters
    ----------
    settings
        As the user gave them.
    shot
        What it declares of interface and uncertainty.

    Raises
    ------
    ValueError
        If nothing would be free.
    """
    if settings.free is not None:
        return Freed(settings, by_default=False, reasons={})
    relaxing = () if shot.relaxation is None else shot.relaxation.free_names
    default = (*DEFAULT, *relaxing)
    reasons = {name: ASKED for name in (*settings.held, *settings.hold) if name in default}
    for name in default:
        if shot.uncertainty.get(name) == 0.0:
            reasons.setdefault(name, EXACT)
    if rough(shot, settings.held):
        for name in default:
            if name not in ALONE:
                reasons.setdefault(name, SLIDES)
    if shot.centre_line is None:
        for name in default:
            if name not in ALONE:
                reasons.setdefault(name, BLIND)
    free = {name: None for name in default if name not in reasons}
    if not free:
        raise ValueError(f"nothing is free: {', '.join(f'{name} is {why}' for name, why in reasons.items())}")
    return Freed(replace(settings, free=free), by_default=True, reasons=reasons)


def rough(shot: Shot, named: Iterable[str]) -> bool:
    """True if a surface slides or lets go: as declared, or because a named parameter makes it so."""
    from explicit.contact import contact_law

    laws = [contact_law(shot.interface.faces), contact_law(shot.interface.side)]
    return any_slides(named) or any(law.needs_friction or law.needs_release_stress for law in laws)
