"""Contact laws at their limits, penetration, and the ledgers of momentum and energy."""

from dataclasses import dataclass
from functools import cache

import numpy as np
from contact_limits_runs import (
    AREA,
    FRICTION,
    LAWS,
    PULLED,
    RELEASE,
    STIFFNESS,
    TIMES,
    Distance,
    Ledger,
    depth,
    distance,
    impact,
    ledger,
    press,
    pull,
    same_bits,
)
from matplotlib.figure import Figure
from numpy.typing import NDArray
from order import FittedOrder, fitted_order

from explicit import Response

FloatArray = NDArray[np.float64]

TITLE = "Limits and ledgers of contact"
FIGURE_SIZE = (6.7, 4.8)
GAP_TOLERANCE = 1e-15
"""Allowed penetration of the kinematic laws [m]: round-off of a height of 6.5 mm."""
PENALTY_GAP_TOLERANCE = 1e-6
"""Allowed penetration of the penalty law with its default stiffness [m]."""
MOMENTUM_TOLERANCE = 1e-11
"""Round-off [-]: places of 6.5 mm, known to 1e-18 m, differ by 0.6 um within half a step."""
ENERGY_TOLERANCE = 1e-3
"""As in `energy.py` [-]."""
FITTED = STIFFNESS >= 1e12
"""Stiffnesses of the fitted order: the softer ones add a mode of their own to the impact."""
ORDER_TOLERANCE = 0.05
"""Allowed distance of the penalty's order from 1."""
SLIPPING = FRICTION <= 64.0
"""Coefficients of the fitted order in 1/f: beyond, single landings decide."""
FRICTION_ORDER = 0.7
"""Smallest order in 1/f, less its scatter: theory gives 1, sticking and slipping of single nodes scatter."""
PULL_TOLERANCE = 0.03
"""Allowed shortfall of the force at release [-]: half of the largest strain, 5 %, within which the stress is
uniform."""
PRESS_TOLERANCE = 5e-4
"""Allowed difference of penetration and pressure over stiffness [-]: what still moves after 20 ms."""

STATIC_TOLERANCE = 1e-4
"""Allowed difference of the force of a slow loading between penalty and kinematic law [-]: a penetration of
0.05 um on each side shortens 2.6 mm by 4e-5."""


@dataclass(frozen=True)
class Result:
    """Everything the page shows."""

    ledgers: dict[str, Ledger]
    """Every step of an impact, by law."""
    penalty: Distance
    """From the kinematic Coulomb law with the same coefficient, by `STIFFNESS`."""
    depth: FloatArray
    """Penetration [m], by `STIFFNESS`."""
    friction: Distance
    """From the rough law, by `FRICTION`."""
    release: Response
    """Impacts, by `RELEASE`."""
    rough: Response
    """The law that release stress 0 must be."""
    bonded: Response
    """The law that an infinite release stress must be."""
    pull: FloatArray
    """Force at release over its closed form [-], rows `PULLED`."""
    press: FloatArray
    """Penetration over its closed form [-], rows `STIFFNESS`."""


@cache
def case() -> Result:
    """All impacts, the pull and the static compression (some seconds)."""
    rough = impact("rough")
    penalty = impact("penalty", friction=(0.3,), contact_stiffness=tuple(STIFFNESS))
    return Result(
        ledgers={law: ledger(law) for law in LAWS},
        penalty=distance(penalty, impact("coulomb", friction=(0.3,))),
        depth=depth(penalty),
        friction=distance(impact("coulomb", friction=tuple(FRICTION)), rough),
        release=impact("bonded_release", release_stress=tuple(RELEASE)),
        rough=rough,
        bonded=impact("bonded"),
        pull=pull(),
        press=press(),
    )


def orders(result: Result) -> dict[str, FittedOrder]:
    """Orders of the penalty in 1/k, by what is measured."""
    soft = 1.0 / STIFFNESS[FITTED]
    errors = {**vars(result.penalty), "penetration": result.depth}
    return {name: fitted_order(soft, error[FITTED]) for name, error in errors.items()}


def order_of_friction(result: Result) -> FittedOrder:
    """Order of the outline's distance from rough in 1/f."""
    return fitted_order(1.0 / FRICTION[SLIPPING], result.friction.outline[SLIPPING])


def row(result: Result) -> tuple[str, str, str]:
    """Line of the index: what is compared, what was measured, what is allowed."""
    kinematic = max(entry.penetration for law, entry in result.ledgers.items() if law != "penalty")
    momentum = max(entry.momentum for entry in result.ledgers.values())
    fits = [fit.order for fit in orders(result).values()]
    ends = same_bits(result.release, 0, result.rough) and same_bits(result.release, -1, result.bonded)
    return (
        "penetration of all nodes at all steps to 60 %; impulses against momentum through stick and slip; "
        "order of the penalty towards the kinematic law; release stress 0 and ∞ against rough and bonded",
        f"{1e6 * kinematic:.0e} µm (penalty {1e6 * result.ledgers['penalty'].penetration:.2f} µm); "
        f"{momentum:.0e}; {min(fits):.2f} to {max(fits):.2f}; {'same bits' if ends else 'DIFFERENT'}",
        f"{1e6 * GAP_TOLERANCE:.0e} µm (1 µm); {MOMENTUM_TOLERANCE:.0e}; 1 within {ORDER_TOLERANCE}; "
        "same bits",
    )


def draw(result: Result, figure: Figure) -> None:
    """Top left: distance of the penalty law from the kinematic one, f = 0.3 (grey: 1 µm). Top
    right: distance of Coulomb's law from the rough one. Bottom left: first waves with bonded faces that let
    go. Bottom right: largest force of a slow pull until the faces let go."""
    (left, right), (waves, pulled) = figure.subplots(2, 2)
    left.loglog(STIFFNESS, 1e6 * result.depth, "o-", label="penetration, largest")
    left.loglog(STIFFNESS, 1e6 * result.penalty.outline, "s-", label="outline, rms")
    left.loglog(
        STIFFNESS, 1e6 * result.depth[-1] * STIFFNESS[-1] / STIFFNESS, ":", color="0.4", label="order 1"
    )
    left.axhline(1.0, color="0.7", linewidth=0.7)
    left.set(xlabel="penalty stiffness [Pa/m]", ylabel="distance [µm]")
    left.legend()
    slips = result.friction.outline > 0.0
    right.loglog(FRICTION[slips], 1e6 * result.friction.outline[slips], "s-", label="outline, rms")
    guide = result.friction.outline[SLIPPING][2] * FRICTION[2] / FRICTION[slips]
    right.loglog(FRICTION[slips], 1e6 * guide, ":", color="0.4", label="order 1")
    right.set(xlabel="friction coefficient f [–]", ylabel="distance from rough [µm]")
    right.legend()
    first = TIMES <= 0.5e-3
    chosen = {len(RELEASE) - 1: "bonded", 7: "100 kPa", 6: "50 kPa", 4: "10 kPa", 0: "rough"}
    for style, (i, label) in zip(("-", "--", "-.", ":", "-"), chosen.items(), strict=True):
        waves.plot(1e3 * TIMES[first], result.release.force_transmission[i, first], style, label=label)
    waves.set(xlabel="time [ms]", ylabel="force on the transmission platen [N]")
    waves.legend()
    closed = PULLED * AREA
    pulled.plot(1e-3 * PULLED, closed, "-", color="0.4", label="stress × area")
    pulled.plot(1e-3 * PULLED, result.pull[:, 0] * closed, "o", label="flyer")
    pulled.plot(1e-3 * PULLED, result.pull[:, 1] * closed, "x", label="transmission platen")
    pulled.set(
        xlabel="release stress [kPa]", ylabel="largest tensile force [N]", xlim=(0, None), ylim=(0, None)
    )
    pulled.legend()


def page(result: Result) -> str:
    """The page's text: `contact_limits_page.py`."""
    from contact_limits_page import text  # it asks this module for numbers

    return text(result)
