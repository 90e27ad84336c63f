"""Figures of whole specimens: forces with bands, correlations, strains, the deformed mesh."""

import numpy as np
from matplotlib.collections import PolyCollection

from kolsky.report.figures.base import (
    BAND,
    FORCE,
    GREY,
    MEASURED,
    MM,
    MODEL,
    PAGE,
    SHAPE,
    FigureKind,
    Panels,
    label_panel,
    label_text,
    smooth_bar,
)
from kolsky.report.nomenclature import constant_symbol
from kolsky.report.specimen_view import BINS, SpecimenView

COLOURS = (MODEL, SHAPE, FORCE, BAND, GREY)
"""Colours of the fits, in turn."""
MOST_TESTS = 6
"""Tests that have a panel of their own; the CSV file has all."""
LEAST_SHARE = 1e-4
"""Smallest share of the volume on the axis."""


def _panels(view: SpecimenView) -> list[list[str]]:
    names = list(view.tests)[:MOST_TESTS]
    return [names, [f"{name} residual" for name in names]]


def draw_forces(view: SpecimenView, panels: Panels) -> None:
    """Draw measured and simulated forces of each test, and what is left."""
    for number, name in enumerate(list(view.tests)[:MOST_TESTS]):
        above, below = panels[name], panels[f"{name} residual"]
        label_panel(above, "abcdef"[number])
        drawn = False
        for colour, found in zip(COLOURS, view.fits, strict=False):
            for one in found.tests:
                if one.test.name != name:
                    continue
                samples = one.test.samples
                for end in range(samples.force.shape[1]):
                    x, f = MM * samples.displacement[:, end], one.force[:, end]
                    marker = "o" if end == 0 else "s"
                    if not drawn:
                        above.plot(
                            x, samples.force[:, end], marker, color=MEASURED, ms=3, mfc="none",
                            label="measured" if end == 0 else "measured, y",
                        )  # fmt: skip
                    role = "" if one.fitted else ", predicted"
                    above.plot(
                        x, f, "-" if end == 0 else "--", color=colour, lw=1.0,
                        label=label_text(f"{found.name}{role}", 28) if end == 0 else None,
                    )  # fmt: skip
                    above.fill_between(
                        x, f - one.band[:, end], f + one.band[:, end], color=colour, alpha=0.25, lw=0
                    )
                    below.plot(x, f - samples.force[:, end], marker + "-", color=colour, ms=2, lw=0.7)
                drawn = True
        above.set_title(label_text(name, 24), fontsize="medium")
        above.set_ylabel("force (N)")
        above.legend(frameon=False, fontsize="small")
        sigma = next(
            one.test.samples.sigma_force for f in view.fits for one in f.tests if one.test.name == name
        )
        below.axhspan(-2.0 * sigma, 2.0 * sigma, color=GREY, alpha=0.2, lw=0)
        below.set_xlabel("displacement (mm)")
        below.set_ylabel("fit less data (N)")


def caption_forces(view: SpecimenView) -> str:
    """Return the caption."""
    return (
        "Force over displacement, measured and simulated with the constants of each fit (bands: 95 % "
        "from the "
        "constants alone), and what is left of it over ± 2 standard deviations of the declared noise (grey)."
    )


def draw_correlations(view: SpecimenView, panels: Panels) -> None:
    """Draw the correlations of the constants of each fit."""
    for number, found in enumerate(view.fits[:3]):
        ax = panels[found.name]
        label_panel(ax, "abc"[number])
        values = np.nan_to_num(found.intervals.correlation)
        image = ax.pcolormesh(values, vmin=-1.0, vmax=1.0, cmap="RdBu_r")
        names = [constant_symbol(name) for name in found.constants.free]
        ticks = np.arange(len(names)) + 0.5
        ax.set_xticks(ticks, names)
        ax.set_yticks(ticks, names)
        ax.invert_yaxis()
        ax.set_title(label_text(found.name, 24), fontsize="medium")
        for (i, j), value in np.ndenumerate(values):
            dark = abs(value) > 0.6
            ax.text(
                j + 0.5, i + 0.5, f"{value:.3f}", ha="center", va="center", fontsize="small",
                color="white" if dark else "black",
            )  # fmt: skip
        if number == min(len(view.fits), 3) - 1:
            smooth_bar(ax.figure.colorbar(image, ax=ax, label="correlation"))


def caption_correlations(view: SpecimenView) -> str:
    """Return the caption."""
    return (
        "Correlations of the fitted constants. Near ± 1 a test knows a combination of two constants and "
        "not each: "
        "another kind of test tells them apart."
    )


def draw_strains(view: SpecimenView, panels: Panels) -> None:
    """Draw the distribution of strains by volume."""
    for number, share in enumerate(view.shares[:MOST_TESTS]):
        for name, values, letter in (("whole", share.whole, 0), ("middle", share.middle, 1)):
            ax = panels[f"{share.name} {name}"]
            label_panel(ax, "abcdefghijkl"[2 * number + letter])
            for axis, colour in zip(range(3), (MODEL, SHAPE, MEASURED), strict=True):
                style = "--" if axis == 1 else "-"
                ax.stairs(
                    np.maximum(values[axis], LEAST_SHARE), BINS, baseline=LEAST_SHARE, color=colour, ls=style,
                    label="xyz"[axis],
                )  # fmt: skip
            ax.set_yscale("log")
            ax.set_ylim(LEAST_SHARE, 1.5)
            seen = np.flatnonzero(share.whole.max(axis=0))
            ax.set_xlim(BINS[max(seen[0] - 1, 0)], BINS[min(seen[-1] + 2, len(BINS) - 1)])
            ax.set_xlabel("strain (–)")
            ax.set_ylabel("share of the volume")
            words = "whole specimen" if name == "whole" else "mid-region"
            ax.set_title(f"{label_text(share.name, 16)}, {words}", fontsize="medium")
            ax.legend(frameon=False, fontsize="small", title="along")


def caption_strains(view: SpecimenView) -> str:
    """Return the caption."""
    return (
        "Strains along the axes at the last sample, by volume: left the whole specimen with its ends, "
        "right the "
        "uniform middle alone, which a fit of the mid-region sees."
    )


def draw_mesh(view: SpecimenView, panels: Panels) -> None:
    """Draw the largest stretch on the upper face of the simulated part, deformed."""
    for name, solution in view.solutions.items():
        if name not in panels:
            continue
        ax, mesh = panels[name], solution.model.mesh
        u = solution.displacements[solution.reached - 1]
        top = mesh.points[:, 2].max()
        corners = mesh.cells[:, 4:8]  # VTK: the face of larger z
        upper = corners[np.abs(mesh.points[corners, 2] - top).max(axis=1) < 1e-9]
        reference, moved = mesh.points[upper][..., :2], (mesh.points + u)[upper][..., :2]
        edges = [np.stack([c[:, 1] - c[:, 0], c[:, 3] - c[:, 0]], axis=-1) for c in (reference, moved)]
        stretch = np.linalg.norm(edges[1] @ np.linalg.inv(edges[0]), ord=2, axis=(1, 2))
        faces = PolyCollection(
            list(MM * moved), array=stretch, cmap="viridis", edgecolor="white", linewidth=0.1
        )
        ax.add_collection(faces)
        ax.autoscale_view()
        ax.set_aspect("equal")
        ax.set_xlabel("$x$ (mm)")
        ax.set_ylabel("$y$ (mm)")
        ax.set_title(label_text(name, 24), fontsize="medium")
        smooth_bar(ax.figure.colorbar(faces, ax=ax, label="largest stretch in the face", fraction=0.04))


def caption_mesh(view: SpecimenView) -> str:
    """Return the caption."""
    return (
        "Largest stretch of the element faces on the bonded surface at the last sample, in the deformed "
        "state; "
        "where symmetry allows an eighth of the specimen is simulated."
    )


FIGURES = (
    FigureKind(
        name="forces",
        width=PAGE,
        height=lambda view: 105.0,
        caption=caption_forces,
        panels=_panels,
        draw=draw_forces,
        mosaic={"height_ratios": [2.0, 1.0]},
    ),
    FigureKind(
        name="correlations",
        width=PAGE,
        height=lambda view: 55.0,
        caption=caption_correlations,
        panels=lambda view: [[found.name for found in view.fits[:3]]],
        draw=draw_correlations,
        applies=lambda view: len(view.fits[0].constants.free) > 1,
    ),
    FigureKind(
        name="strains",
        width=PAGE,
        height=lambda view: 55.0 * len(view.shares[:MOST_TESTS]),
        caption=caption_strains,
        panels=lambda view: [[f"{s.name} whole", f"{s.name} middle"] for s in view.shares[:MOST_TESTS]],
        draw=draw_strains,
        applies=lambda view: bool(view.shares),
    ),
    FigureKind(
        name="mesh",
        width=PAGE,
        height=lambda view: 70.0,
        caption=caption_mesh,
        panels=lambda view: [list(view.solutions)[:3]],
        draw=draw_mesh,
        applies=lambda view: bool(view.solutions),
    ),
)
