"""Compression with Coulomb friction, slowly loaded, against static solutions of GetFEM."""

from dataclasses import dataclass
from functools import cache

import numpy as np
from friction_runs import (
    COARSE,
    DAMPING,
    EVEN,
    FINE,
    FRICTION,
    REFERENCE,
    Found,
    Impact,
    compress,
    force_difference,
    impact,
    known,
    outline_difference,
)
from matplotlib.figure import Figure
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

TITLE = "Coulomb friction"
FIGURE_SIZE = (6.7, 3.1)
Case = tuple[tuple[int, int, float], str]
"""A mesh and an element."""
CASES: dict[str, Case] = {
    "16 × 22": (COARSE, "one_point"),
    "32 × 44": (FINE, "one_point"),
    "32 × 44, F-bar": (FINE, "fbar"),
}
FORCE_TOLERANCE = {"16 × 22": 0.02, "32 × 44": 0.01, "32 × 44, F-bar": 0.01}
"""Allowed relative difference of the force [-] beyond the reference's own uncertainty: the side rolls onto a
platen node by node, 2 % on 16 x 22 as in the bonded case, half of it on half the element; the loading's drag
and damping are 0.3 % of it at 10 %."""
RADIUS_TOLERANCE, OUTLINE_TOLERANCE = 20e-6, 40e-6
"""Allowed difference of the radius at mid-height and, rms, of the outline [m] on the fine mesh, beyond the
reference's uncertainty: twice what a camera resolves, and half an element at the edge, which folds sharply
with f = 0.1."""
MOMENTUM_TOLERANCE, ENERGY_TOLERANCE, GAP_TOLERANCE = 1e-5, 1e-3, 1e-15
"""Path of the centre of mass from 3000 recorded impulses [-]; energy as in `energy.py` [-]; round-off of a
height [m]."""
TANGLED = {0.1: 0.55}
"""Compression [-] from which one-point elements of the fine mesh tangle at the folded edge, by coefficient;
not compared, and said on the page."""
STUDY = (0.0, 2.5e-6, DAMPING)
"""Damping beta of the study of flutter [s]."""


@dataclass(frozen=True)
class Result:
    """Slow loadings with every coefficient, by mesh and by damping, and the impacts."""

    cases: dict[str, tuple[Found, ...]]
    """The comparison, by `CASES`."""
    study: dict[float, tuple[Found, ...]]
    """Even mesh, by damping."""
    coarse: tuple[Found, ...]
    """Coarse mesh without damping."""
    impact: Impact
    """Ledgers of energy and momentum."""


@cache
def case() -> Result:
    """Everything the page shows (some minutes)."""
    cases = {name: compress(mesh, element=element) for name, (mesh, element) in CASES.items()}
    study = {beta: compress(EVEN, beta) for beta in STUDY}
    return Result(cases, study, compress(COARSE, 0.0), impact())


def compared(friction: float, case_name: str) -> NDArray[np.bool_]:
    """Which compressions of the reference are held against a case."""
    compression = known(friction).compression
    if case_name != "32 × 44":
        return np.ones(len(compression), dtype=bool)
    return compression < TANGLED.get(friction, 1.0)


def force_excess(
    found: tuple[Found, ...], case_name: str, coefficients: tuple[float, ...] = FRICTION
) -> float:
    """Largest |force difference| beyond the reference's uncertainty, over the force [-]."""
    worst = 0.0
    for friction, one in zip(coefficients, found, strict=True):
        reference = known(friction)
        beyond = np.abs(force_difference(one, reference)) - reference.force_error / reference.force
        worst = max(worst, float(beyond[compared(friction, case_name)].max()))
    return worst


def radius_excess(
    found: tuple[Found, ...], case_name: str, coefficients: tuple[float, ...] = FRICTION
) -> tuple[float, float]:
    """Largest difference of the radius at mid-height, and of the outline (rms), beyond the uncertainty of the
    reference's radii of middle and edge [m]."""
    middle, outline = 0.0, 0.0
    for friction, one in zip(coefficients, found, strict=True):
        reference = known(friction)
        held = compared(friction, case_name)
        radius = np.abs(one.middle[: len(held)] - reference.middle) - reference.middle_error
        either = np.maximum(reference.middle_error, reference.corner_error)
        middle = max(middle, float(radius[held].max()))
        outline = max(outline, float((outline_difference(one, reference) - either)[held].max()))
    return middle, outline


def name(friction: float) -> str:
    """How a coefficient is written."""
    return "no slip" if friction >= 1000.0 else f"{friction:g}"


def flutter() -> FloatArray:
    """Fastest growth [1/s] at 5 and 10 % compression by coefficient on the coarsest and finest mesh of the
    linearised reference, rows (friction, coarsest, finest)."""
    rows = np.loadtxt(REFERENCE / "G_friction_flutter.csv", delimiter=",")
    sizes = rows[:, 1]
    worst = [
        [f, *(rows[(rows[:, 0] == f) & (sizes == n), 3].max() for n in (sizes.min(), sizes.max()))]
        for f in np.unique(rows[:, 0])
    ]
    return np.array(worst)


def row(result: Result) -> tuple[str, str, str]:
    """Line of the index: what is compared, what was measured, what is allowed."""
    forces = [f"{100 * force_excess(found, name):.1f} %" for name, found in result.cases.items()]
    radii = [radius_excess(result.cases[name], name) for name in list(CASES)[1:]]
    middle, outline = 1e3 * np.max(radii, axis=0)
    return (
        "force with f = 0.05 to 0.5 and without slip beyond the reference's uncertainty, 16 × 22, 32 × 44, "
        "F-bar; radius, outline (rms), 32 × 44; GetFEM",
        f"{', '.join(forces)}; {middle:.3f}, {outline:.3f} mm",
        f"{', '.join(f'{100 * t:g} %' for t in FORCE_TOLERANCE.values())}; {1e3 * RADIUS_TOLERANCE:g}, "
        f"{1e3 * OUTLINE_TOLERANCE:g} mm",
    )


def draw(result: Result, figure: Figure) -> None:
    """Left: force over the force without slip (colours as on the right); lines are 32 × 44 (F-bar), bars the
    reference with its uncertainty. Right: slip of the face at 30 % compression; lines are the reference,
    points every second node."""
    left, right = figure.subplots(1, 2)
    found = result.cases["32 × 44, F-bar"]
    whole = known(FRICTION[-1]).force
    percent = 100 * np.array([0.1, 0.2, 0.3, 0.4, 0.5, 0.6])
    for i, (friction, one) in enumerate(zip(FRICTION[:-1], found[:-1], strict=True)):
        reference = known(friction)
        n = len(reference.compression)
        left.plot(percent[:n], (one.force / whole)[:n], color=f"C{i}")
        left.errorbar(
            percent[:n],
            reference.force / whole[:n],
            reference.force_error / whole[:n],
            color=f"C{i}",
            fmt="o",
            markersize=2.5,
            capsize=2.0,
        )
        start = 1e3 * reference.face_start
        right.plot(start, 1e3 * reference.face[2] - start, color=f"C{i}", label=f"f = {friction:g}")
        start = 1e3 * one.face_start
        right.plot(start[::2], (1e3 * one.face[2] - start)[::2], "o", color=f"C{i}", markersize=2.5)
    left.set(xlabel="compression [%]", ylabel="force over that without slip [-]")
    right.set(xlabel="radius before loading [mm]", ylabel="slip at 30 % [mm]")
    right.legend(loc="upper left")


def page(result: Result) -> str:
    """The page's text: `friction_page.py`."""
    from friction_page import text  # it asks this module for numbers

    return text(result)
