"""The F-bar element beside the one-point one: by itself, in slow and fast compression, and its price."""

import dynamic_bonded as dynamic
import fbar_runs as runs
import numpy as np
import static_bonded as static
from fbar_checks import AGREEMENT, LIMIT_TOLERANCE, STATIC_TOLERANCE, Result, case
from fbar_element import DIFFERENCES
from fbar_runs import ELEMENTS, MESHES
from fbar_text import page
from matplotlib.figure import Figure

TITLE = "F-bar element"
FIGURE_SIZE = (6.7, 5.4)

__all__ = ["TITLE", "case", "draw", "page", "row"]


def row(result: Result) -> tuple[str, str, str]:
    """Line of the index: what is compared, what was measured, what is allowed."""
    wanted = static.reference().force
    forces = 100 * np.abs(runs.static_forces("fbar")[-1] / wanted - 1.0).max()
    common = 100 * max(abs(one.value / f - 1.0) for one, f in zip(runs.common_forces(), wanted, strict=True))
    apart = 100 * runs.limit_differences(5e3, dynamic.END)[2]
    return (
        "F-bar: corner force against the energy's slope; static force, 48 × 66, and both elements' common "
        "limit, FElupe, DOLFINx; 5 kHz force, the elements' limits against each other",
        f"{result.single['fbar'].gradient.min():.0e}; {forces:.1f} %, {common:.2f} %; {apart:.2f} %",
        f"1e-8; {100 * STATIC_TOLERANCE['fine']:g} %, {100 * LIMIT_TOLERANCE:g} %; {100 * AGREEMENT:g} %",
    )


def draw(result: Result, figure: Figure) -> None:
    """Top left: force against the central difference of the energy. Top right: static force error at 10 and
    30 % against the mesh; dashed: order of a bonded edge in linear theory. Bottom left: 5 kHz force of the
    impact, difference from the reference. Bottom right: flat disc, 16 × 4, force at 40 % against hourglass
    stiffness."""
    (slope, still), (fast, flat) = figure.subplots(2, 2)
    known = static.reference().force
    colors = dict(zip(ELEMENTS, ("C0", "C1"), strict=True))
    for element, color in colors.items():
        slope.loglog(DIFFERENCES, result.single[element].gradient, "o-", color=color, label=element)
        forces = runs.static_forces(element)
        for k, mark in ((0, "o"), (2, "s")):
            label = f"{element}, {10 * (k + 1)} %"
            error = 100 * np.abs(forces[:, k] / known[k] - 1.0)
            still.loglog([n for n, _ in MESHES], error, mark + "-", color=color, label=label)
        errors = 100 * runs.impact_errors(element, 5e3)
        fast.loglog([n for n, _ in MESHES], errors, "o-", color=color, label=element)
    guide = np.array([16.0, 48.0])
    still.loglog(guide, 2.6 * (guide / 16.0) ** -runs.STATIC_ORDER, "--", color="0.5")
    slope.set(xlabel="difference / element size [-]", ylabel="force error [-]")
    still.set(xlabel="elements across the radius [-]", ylabel="static force error [%]", ylim=(0.08, 8.0))
    fast.set(xlabel="elements across the radius [-]", ylabel="rms difference / peak [%]")
    for axes in (still, fast):
        axes.set_xticks([n for n, _ in MESHES], [f"{n}" for n, _ in MESHES])
        axes.set_xticks([], minor=True)
    coarse = runs.DISC_MESHES[0]
    forces = [runs.disc(coarse, "one_point", chi).force[-1] for chi in runs.CHI]
    flat.semilogx(runs.CHI, forces, "o-", color="C0", label="one_point")
    flat.axhline(runs.disc(coarse, "fbar").force[-1], color="C1", label="fbar")
    finest = runs.disc(runs.DISC_MESHES[-1], "fbar").force[-1]
    flat.axhline(finest, color="0.5", linestyle="--", label="fbar, 48 × 12")
    flat.set(xlabel="hourglass stiffness χ [-]", ylabel="force [N]")
    still.legend(ncols=2)
    for axes in (slope, fast, flat):
        axes.legend()
