"""Figures of quasi-static tests: fitted laws, their residuals and stability, the reference curve."""

import numpy as np

from kolsky.material.curves.uniaxial import gaussian_strain
from kolsky.material.fits.compare import Comparison, Row
from kolsky.material.fits.modes import Mode
from kolsky.material.fits.stability import PathStability, Stability
from kolsky.material.reference_curve import ReferenceCurve
from kolsky.report.figures.base import BAND, GREY, MEASURED, MODEL, PAGE, FigureKind, Panels, label_panel
from kolsky.report.figures.waves import stress_scale

MOST_LAWS = 5
"""Largest number of laws in one panel; more cannot be distinguished."""
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00")
DASHES = ("-", "--", "-.", ":", (0, (5, 1, 1, 1)))
MARKERS = ("o", "s", "^", "D", "v")


def shown(comparison: Comparison) -> list[Row]:
    """Return the laws to draw: least AIC first, only one of those with the same curve."""
    chosen: list[Row] = []
    for row in comparison.rows:
        # The same error to six digits is the same curve under another name.
        if row.fit is not None and all(
            other.fit is None or abs(row.fit.rmse - other.fit.rmse) > 1e-6 * row.fit.rmse for other in chosen
        ):
            chosen.append(row)
    return chosen[:MOST_LAWS]


def modes(comparison: Comparison) -> list[Mode]:
    """Return the modes that were tested."""
    return [mode for mode in Mode if any(test.mode is mode for test in comparison.tests)]


def caption_fits(comparison: Comparison) -> str:
    """Return the caption."""
    count = sum(row.fit is not None for row in comparison.rows)
    return (
        f"Nominal stress of {len(comparison.tests)} tests (black) and of the {len(shown(comparison))} laws "
        f"of least AIC among {count}, fitted to all tests at once."
    )


def draw_fits(comparison: Comparison, panels: Panels) -> None:
    """Draw every test and the best laws."""
    for number, (mode, ax) in enumerate(zip(modes(comparison), panels.values(), strict=True)):
        if len(panels) > 1:
            label_panel(ax, "abcd"[number])
        tests = [k for k, test in enumerate(comparison.tests) if test.mode is mode]
        factor, unit = stress_scale(
            max((comparison.tests[k].stress for k in tests), key=lambda s: abs(s).max())
        )
        ax.axhline(0.0, color=GREY, lw=0.4)
        for place, k in enumerate(tests):
            test = comparison.tests[k]
            ax.plot(
                test.deformation,
                factor * test.stress,
                MARKERS[place % len(MARKERS)],
                ms=2.5,
                mfc="none",
                mew=0.5,
                color=MEASURED,
                markevery=max(1, len(test.stress) // 40),
                label="measured" if place == 0 else "",
            )
        for row, colour, dashes in zip(shown(comparison), COLOURS, DASHES, strict=False):
            assert row.fit is not None
            for place, k in enumerate(tests):
                part = row.fit.parts[k]
                order = part.test.deformation.argsort()
                ax.plot(
                    part.test.deformation[order],
                    factor * part.predicted[order],
                    linestyle=dashes,
                    color=colour,
                    lw=0.9,
                    label=row.candidate.name.replace("_", " ") if place == 0 else "",
                )
        ax.set_xlabel("Amount of shear (–)" if mode is Mode.SIMPLE_SHEAR else "Stretch (–)")
        ax.set_ylabel(f"Nominal stress ({unit})")
        ax.set_title(mode.value)
        if number == 0:
            ax.legend(loc="best")


def _mosaic_fits(names: list[str]) -> list[list[str]]:
    return [names] if len(names) < 4 else [names[:2], names[2:]]


ROW = 42.0
"""Height of a row of panels [mm]."""
COLUMNS = 3


def caption_residuals(comparison: Comparison) -> str:
    """Return the caption."""
    return (
        "Law minus measurement for the laws of the figure before, on one scale. Residuals are smooth, not "
        "scattered, where a law misses the shape of a curve."
    )


def draw_residuals(comparison: Comparison, panels: Panels) -> None:
    """Draw the residuals of every test over its strain."""
    rows = shown(comparison)
    largest = max((p.residual for r in rows if r.fit for p in r.fit.parts), key=lambda x: abs(x).max())
    factor, unit = stress_scale(largest)
    several = len(comparison.tests) > 1
    for number, row in enumerate(rows):
        ax = panels[row.candidate.name]
        assert row.fit is not None
        ax.axhline(0.0, color=GREY, lw=0.5)
        for place, part in enumerate(row.fit.parts):
            order = part.test.strain.argsort()
            ax.plot(
                part.test.strain[order],
                factor * part.residual[order],
                "-" + MARKERS[place % len(MARKERS)],
                ms=2.0,
                mfc="none",
                mew=0.5,
                lw=0.6,
                markevery=max(1, len(order) // 25),
                color=COLOURS[place % len(COLOURS)],
                label=part.test.name if len(comparison.tests) <= len(COLOURS) else "",
            )
        ax.set_title(f"{row.candidate.name.replace('_', ' ')}: rmse {factor * row.fit.rmse:.3g} {unit}")
        if number % COLUMNS == 0:
            ax.set_ylabel(f"Law less measured ({unit})")
        shear = any(part.test.mode is Mode.SIMPLE_SHEAR for part in row.fit.parts)
        ax.set_xlabel("Nominal strain or shear (–)" if shear else "Nominal strain (–)")
    if several and len(comparison.tests) <= len(COLOURS):
        panels[rows[0].candidate.name].legend(loc="best")


def _mosaic_residuals(comparison: Comparison) -> list[list[str]]:
    names = [row.candidate.name for row in shown(comparison)]
    columns = min(COLUMNS, len(names))
    names += ["."] * (-len(names) % columns)
    return [names[k : k + columns] for k in range(0, len(names), columns)]


PATHS = (
    (Mode.UNIAXIAL, "tension", "Uniaxial tension"),
    (Mode.UNIAXIAL, "compression", "Uniaxial compression"),
    (Mode.EQUIBIAXIAL, "tension", "Equibiaxial tension"),
    (Mode.PLANAR, "tension", "Planar, simple shear"),
)
"""Equibiaxial tension is uniaxial compression with another stretch; both are drawn, each in its own."""


def caption_stability(comparison: Comparison) -> str:
    """Return the caption."""
    return (
        "Stretch to which each law meets Drucker's criterion. A bar that ends in a cross: unstable from "
        "there; in a vertical stroke: the law locks; with no mark: stable over the whole range evaluated. "
        "Blue: the stretches of the tests in this mode."
    )


def draw_stability(comparison: Comparison, panels: Panels) -> None:
    """Draw a bar for each law and path."""
    rows = [row for row in comparison.rows if row.fit is not None]
    places = np.arange(len(rows), 0, -1)
    for number, ((mode, direction, title), ax) in enumerate(zip(PATHS, panels.values(), strict=True)):
        for place, row in zip(places, rows, strict=True):
            path = _path(row, mode, direction)
            end = 1.0 + path.strain
            ax.plot([1.0, end], [place, place], color=MEASURED, lw=1.6, solid_capstyle="butt")
            if path.outcome is not Stability.STABLE:
                ax.plot([end], [place], "x" if path.outcome is Stability.UNSTABLE else "|", ms=5, color=MODEL)
        for test in comparison.tests:
            lam = test.deformation[(test.strain > 0.0) == (direction == "tension")]
            if test.mode is mode and lam.size:
                ax.axvspan(
                    1.0, lam.max() if direction == "tension" else lam.min(), color=BAND, alpha=0.3, lw=0
                )
        ax.axvline(1.0, color=GREY, lw=0.5)
        ax.set_xscale("log")
        low, high = ax.get_xlim()
        ticks = [t for t in (0.1, 0.2, 0.5, 1.0, 2.0, 3.0, 5.0, 10.0, 20.0, 50.0) if low <= t <= high]
        ax.set_xticks(ticks, [f"{t:g}" for t in ticks])
        ax.set_xticks([], minor=True)
        ax.set(xlabel="Stretch (–)", title=title, ylim=(0.3, len(rows) + 0.7))
        ax.set_yticks(places, [row.candidate.name.replace("_", " ") for row in rows] if number == 0 else [])
        ax.tick_params(axis="y", left=False, right=False)


def _path(row: Row, mode: Mode, direction: str) -> PathStability:
    return next(path for path in row.stability if path.mode is mode and path.direction == direction)


KPA = 1e-3
"""Factor from Pa to kPa."""


def caption_reference_curve(made: ReferenceCurve) -> str:
    """Return the caption."""
    corrected = "" if made.friction is None else ", their mean (dashed) and the curve without end friction"
    return (
        f"(a) Nominal stress against nominal strain of {len(made.tests)} tests (grey){corrected}, with its"
        " k = 2 band. (b) Apparent modulus of Gaussian rubber elasticity, Eq. (M.9), likewise."
    )


def draw_reference_curve(made: ReferenceCurve, panels: Panels) -> None:
    """Draw the tests, the mean, the material's curve and its modulus."""
    left, right = panels["curve"], panels["modulus"]
    for number, one in enumerate(made.tests):
        test = one.test
        left.plot(test.strain, KPA * test.stress, color=GREY, lw=0.5, label="" if number else "tests")
    band, modulus = made.band, made.modulus
    if made.friction is not None:
        gaussian = gaussian_strain(band.strain, compression=made.compression)
        as_measured = 3.0 * made.apparent.stress / gaussian
        for ax, value in ((left, made.apparent.stress), (right, as_measured)):
            ax.plot(band.strain, KPA * value, "--", color=MODEL, lw=1.0, label="as if frictionless")
    for ax, (low, high), value in (
        (left, band.interval(), band.stress),
        (right, modulus.interval(), modulus.modulus),
    ):
        ax.fill_between(band.strain, KPA * low, KPA * high, color=BAND, alpha=0.4, lw=0.0, label="k = 2")
        ax.plot(band.strain, KPA * value, color=MEASURED, lw=1.0, label="material")
    side = "compressive" if made.compression else "tensile"
    left.set(xlabel=f"Nominal {side} strain (–)", ylabel="Nominal stress (kPa)")
    right.set(xlabel=f"Nominal {side} strain (–)", ylabel="$E_a$ (kPa)")
    left.set(
        xlim=(0.0, 1.02 * float(band.strain[-1])), ylim=(0.0, 1.1 * KPA * float(made.apparent.stress[-1]))
    )
    right.set(xlim=left.get_xlim(), ylim=(0.0, 1.05 * right.dataLim.y1))
    left.legend(loc="upper left")
    label_panel(left, "a")
    label_panel(right, "b")


FIGURES: tuple[FigureKind[Comparison], ...] = (
    FigureKind(
        name="material-fits",
        width=PAGE,
        height=lambda comparison: 65.0 if len(modes(comparison)) < 4 else 120.0,
        caption=caption_fits,
        panels=lambda comparison: _mosaic_fits([mode.value for mode in modes(comparison)]),
        draw=draw_fits,
    ),
    FigureKind(
        name="material-residuals",
        width=PAGE,
        height=lambda comparison: 10.0 + ROW * len(_mosaic_residuals(comparison)),
        caption=caption_residuals,
        panels=_mosaic_residuals,
        draw=draw_residuals,
        mosaic={"sharey": True},
    ),
    FigureKind(
        name="material-stability",
        width=PAGE,
        height=lambda comparison: 18.0 + 4.5 * sum(row.fit is not None for row in comparison.rows),
        caption=caption_stability,
        panels=lambda comparison: [[title for _, _, title in PATHS]],
        draw=draw_stability,
    ),
)
REFERENCE_CURVE = FigureKind(
    name="baseline",
    width=PAGE,
    height=lambda made: 70.0,
    caption=caption_reference_curve,
    panels=lambda made: [["curve", "modulus"]],
    draw=draw_reference_curve,
)
