"""Figures of slow tests of the material: fitted laws, stability, reference curve, relaxation."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes

from kolsky.base.arrays import FloatArray
from kolsky.material.fits.compare import Comparison, PathStability, Row, Stability
from kolsky.material.fits.homogeneous import Mode
from kolsky.material.reference_curve import ReferenceCurve
from kolsky.material.relaxation.rate_fit import DynamicTest, HistoryTest
from kolsky.material.relaxation.temperature import wlf
from kolsky.material.uniaxial import gaussian_strain
from kolsky.report.figures.base import (
    BAND,
    COLUMN,
    GREY,
    KPA,
    MARKERS,
    MEASURED,
    MODEL,
    PAGE,
    SERIES,
    Panels,
    figure,
    label_text,
)
from kolsky.report.figures.waves import stress_scale
from kolsky.studies.rate_dependence import SlowDynamics

MOST_LAWS = 5
"""Largest number of laws in one panel. More laws cannot be distinguished."""
RINGS: dict[str, Any] = {"ms": 2.5, "mfc": "none", "mew": 0.5}
"""Style of the markers of tests."""
LAW_DASHES = ("-", "--", "-.", ":", (0, (5, 1, 1, 1)))


def _shown_laws(comparison: Comparison) -> list[Row]:
    """Return the laws to draw, least AIC first. Of several laws with the same curve, one is drawn."""
    chosen: list[Row] = []
    for row in comparison.rows:
        # Laws with the same error to six digits have the same curve.
        if row.fit is not None and all(
            other.fit is None or abs(row.fit.rmse - other.fit.rmse) > 1e-6 * row.fit.rmse for other in chosen
        ):
            chosen.append(row)
    return chosen[:MOST_LAWS]


def modes(comparison: Comparison) -> list[Mode]:
    """Return the modes that were tested."""
    return [mode for mode in Mode if any(test.mode is mode for test in comparison.tests)]


@figure(
    PAGE,
    lambda comparison: 65.0 if len(modes(comparison)) < 4 else 120.0,
    lambda comparison: _mosaic_fits([mode.value for mode in modes(comparison)]),
    letters=True,
)
def material_fits(comparison: Comparison, panels: Panels) -> str:
    for number, (mode, ax) in enumerate(zip(modes(comparison), panels.values(), strict=True)):
        tests = [k for k, test in enumerate(comparison.tests) if test.mode is mode]
        factor, unit = stress_scale(
            max((comparison.tests[k].stress for k in tests), key=lambda s: abs(s).max())
        )
        ax.axhline(0.0, color=GREY, lw=0.4)
        for place, k in enumerate(tests):
            test = comparison.tests[k]
            style = RINGS | {"color": MEASURED, "markevery": max(1, len(test.stress) // 40), "ls": "none"}
            label = "measured" if place == 0 else ""
            marker = MARKERS[place % len(MARKERS)]
            ax.plot(test.deformation, factor * test.stress, marker=marker, label=label, **style)
        for row, colour, dashes in zip(_shown_laws(comparison), SERIES, LAW_DASHES, strict=False):
            assert row.fit is not None
            for place, k in enumerate(tests):
                part = row.fit.parts[k]
                order = part.test.deformation.argsort()
                x, y = part.test.deformation[order], factor * part.predicted[order]
                label = row.candidate.name.replace("_", " ") if place == 0 else ""
                ax.plot(x, y, linestyle=dashes, color=colour, lw=0.9, label=label)
        ax.set_xlabel("Amount of shear (–)" if mode is Mode.SIMPLE_SHEAR else "Stretch (–)")
        ax.set_ylabel(f"Nominal stress ({unit})")
        ax.set_title(mode.value)
        if number == 0:
            ax.legend(loc="best")
    count = sum(row.fit is not None for row in comparison.rows)
    return (
        f"Nominal stress of {len(comparison.tests)} tests (black) and of the {len(_shown_laws(comparison))} "
        f"laws of least AIC among {count}, fitted to all tests at once."
    )


def _mosaic_fits(names: list[str]) -> list[list[str]]:
    return [names] if len(names) < 4 else [names[:2], names[2:]]


RESIDUAL_HEIGHT = 42.0
"""Height of a row of panels [mm]."""
RESIDUAL_COLUMNS = 3


def _mosaic_residuals(comparison: Comparison) -> list[list[str]]:
    names = [row.candidate.name for row in _shown_laws(comparison)]
    columns = min(RESIDUAL_COLUMNS, len(names))
    names += ["."] * (-len(names) % columns)
    return [names[k : k + columns] for k in range(0, len(names), columns)]


@figure(
    PAGE,
    lambda comparison: 10.0 + RESIDUAL_HEIGHT * len(_mosaic_residuals(comparison)),
    _mosaic_residuals,
    sharey=True,
)
def material_residuals(comparison: Comparison, panels: Panels) -> str:
    rows = _shown_laws(comparison)
    largest = max((p.residual for r in rows if r.fit for p in r.fit.parts), key=lambda x: abs(x).max())
    factor, unit = stress_scale(largest)
    several = len(comparison.tests) > 1
    for number, row in enumerate(rows):
        ax = panels[row.candidate.name]
        assert row.fit is not None
        ax.axhline(0.0, color=GREY, lw=0.5)
        for place, part in enumerate(row.fit.parts):
            order = part.test.strain.argsort()
            x, y = part.test.strain[order], factor * part.residual[order]
            style = RINGS | {"color": SERIES[place % len(SERIES)], "markevery": max(1, len(order) // 25)}
            label = part.test.name if len(comparison.tests) <= len(SERIES) else ""
            ax.plot(x, y, marker=MARKERS[place % len(MARKERS)], lw=0.6, label=label, **style)
        ax.set_title(f"{row.candidate.name.replace('_', ' ')}: rmse {factor * row.fit.rmse:.3g} {unit}")
        if number % RESIDUAL_COLUMNS == 0:
            ax.set_ylabel(f"Law less measured ({unit})")
        shear = any(part.test.mode is Mode.SIMPLE_SHEAR for part in row.fit.parts)
        ax.set_xlabel("Nominal strain or shear (–)" if shear else "Nominal strain (–)")
    if several and len(comparison.tests) <= len(SERIES):
        panels[rows[0].candidate.name].legend(loc="best")
    return (
        "Law minus measurement for the laws of the figure before, on one scale. Residuals are smooth, not "
        "scattered, where a law misses the shape of a curve."
    )


STABILITY_PATHS = (
    (Mode.UNIAXIAL, "tension", "Uniaxial tension"),
    (Mode.UNIAXIAL, "compression", "Uniaxial compression"),
    (Mode.EQUIBIAXIAL, "tension", "Equibiaxial tension"),
    (Mode.PLANAR, "tension", "Planar, simple shear"),
)
"""Equibiaxial tension is uniaxial compression with another stretch. Both are drawn over their stretch."""


@figure(
    PAGE,
    lambda comparison: 18.0 + 4.5 * sum(row.fit is not None for row in comparison.rows),
    [[title for _, _, title in STABILITY_PATHS]],
)
def material_stability(comparison: Comparison, panels: Panels) -> str:
    rows = [row for row in comparison.rows if row.fit is not None]
    places = np.arange(len(rows), 0, -1)
    for number, ((mode, direction, title), ax) in enumerate(
        zip(STABILITY_PATHS, panels.values(), strict=True)
    ):
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
    return (
        "Stretch to which each law meets Drucker's criterion. A bar that ends in a cross: unstable from "
        "there; in a vertical stroke: the law locks; with no mark: stable over the whole range evaluated. "
        "Blue: the stretches of the tests in this mode."
    )


def _path(row: Row, mode: Mode, direction: str) -> PathStability:
    return next(path for path in row.stability if path.mode is mode and path.direction == direction)


@figure(PAGE, 70.0, [["curve", "modulus"]], letters=True)
def baseline(result: ReferenceCurve, panels: Panels) -> str:
    left, right = panels["curve"], panels["modulus"]
    for number, one in enumerate(result.tests):
        test = one.test
        left.plot(test.strain, KPA * test.stress, color=GREY, lw=0.5, label="" if number else "tests")
    band, modulus = result.band, result.modulus
    if result.friction is not None:
        gaussian = gaussian_strain(band.strain, compression=result.compression)
        as_measured = 3.0 * result.apparent.stress / gaussian
        for ax, value in ((left, result.apparent.stress), (right, as_measured)):
            ax.plot(band.strain, KPA * value, "--", color=MODEL, lw=1.0, label="as if frictionless")
    for ax, (low, high), value in (
        (left, band.interval(), band.stress),
        (right, modulus.interval(), modulus.modulus),
    ):
        ax.fill_between(band.strain, KPA * low, KPA * high, color=BAND, alpha=0.4, lw=0.0, label="k = 2")
        ax.plot(band.strain, KPA * value, color=MEASURED, lw=1.0, label="material")
    side = "compressive" if result.compression else "tensile"
    left.set(xlabel=f"Nominal {side} strain (–)", ylabel="Nominal stress (kPa)")
    right.set(xlabel=f"Nominal {side} strain (–)", ylabel="$E_a$ (kPa)")
    left.set(
        xlim=(0.0, 1.02 * float(band.strain[-1])), ylim=(0.0, 1.1 * KPA * float(result.apparent.stress[-1]))
    )
    right.set(xlim=left.get_xlim(), ylim=(0.0, 1.05 * right.dataLim.y1))
    left.legend(loc="upper left")
    corrected = "" if result.friction is None else ", their mean (dashed) and the curve without end friction"
    return (
        f"(a) Nominal stress against nominal strain of {len(result.tests)} tests (grey){corrected}, with its"
        " k = 2 band. (b) Apparent modulus of Gaussian rubber elasticity, Eq. (M.9), likewise."
    )


KELVIN = 273.15


TEST_COLOURS = tuple(colour for colour in SERIES if colour != MODEL)
"""Colours of tests, used in this order. The model has another colour."""


def draw_test(
    ax: Axes, k: int, label: str, x: FloatArray, y: FloatArray, u: FloatArray, *, size: float = 2.4
) -> str:
    """Draw the values of test number `k` with ±2u, and return its colour."""
    colour, marker = TEST_COLOURS[k % len(TEST_COLOURS)], MARKERS[k % len(MARKERS)]
    ax.errorbar(x, y, yerr=2.0 * u, fmt=marker, ms=size, lw=0.6, color=colour, label=label)
    return colour


@figure(COLUMN, 66.0, [["moduli"]], applies=lambda result: len(result.moduli) > 0)
def relaxation_moduli(result: SlowDynamics, panels: Panels) -> str:
    ax = panels["moduli"]
    age, modulus, sigma = result.fitted.age, KPA * result.fitted.modulus, KPA * result.fitted.sigma
    ax.fill_between(age, modulus - 2.0 * sigma, modulus + 2.0 * sigma, color=BAND, alpha=0.4, lw=0.0)
    ax.plot(age, modulus, color=MODEL, label=result.fitted.label)
    for k, test in enumerate(result.moduli):
        draw_test(ax, k, test.label, test.age, KPA * test.modulus, KPA * test.sigma, size=2.6)
    ax.set_xscale("log")
    ax.set(xlabel="Mean age of the strain (s)", ylabel="Modulus $E_a$ (kPa)")
    ax.legend(loc="best")
    ax.margins(x=0.05, y=0.15)
    return (
        "Modulus of rubber elasticity, Eq. (M.9), of each test, against the mean age of the strain: the "
        "time of holding after a step, half the duration of a steady ramp, 1/ω of an oscillation. Bars: "
        "±2u. Line and band: the fitted model with ±2u."
    )


def holds(result: SlowDynamics) -> list[HistoryTest]:
    """Return the histories of strain."""
    return [test for test in result.tests if isinstance(test, HistoryTest)]


def oscillations(result: SlowDynamics) -> list[DynamicTest]:
    """Return the oscillations, sweeps at their reference temperature."""
    return [test for test in result.tests if isinstance(test, DynamicTest)]


@figure(COLUMN, 60.0, [["stress"]], applies=lambda result: len(holds(result)) > 0)
def relaxation_holds(result: SlowDynamics, panels: Panels) -> str:
    ax = panels["stress"]
    for k, test in enumerate(holds(result)):
        finite = np.isfinite(test.sigma) & (test.time > 0.0)
        stress, u = KPA * test.stress[finite], KPA * test.sigma[finite]
        colour = draw_test(ax, k, label_text(test.label, 24), test.time[finite], stress, u)
        predicted = test.predict(result.law, [result.fit.model])[0]
        ax.plot(test.time[finite], KPA * predicted[finite], color=colour, lw=0.9)
    ax.set_xscale("log")
    ax.set(xlabel="Time (s)", ylabel="Nominal stress (kPa)")
    ax.legend(loc="best")
    return "Nominal stress of the histories of strain (points, bars ±2u) and of the Prony series (lines)."


@figure(PAGE, 60.0, [["storage", "loss"]], applies=lambda result: len(oscillations(result)) > 0, letters=True)
def relaxation_oscillation(result: SlowDynamics, panels: Panels) -> str:
    tests = oscillations(result)
    all_omega = np.concatenate([test.angular_frequency for test in tests])
    omega = np.geomspace(all_omega.min(), all_omega.max(), 200)
    young = result.young
    series = result.fit.model.series
    for name, model in (("storage", series.storage(omega)), ("loss", series.loss(omega))):
        ax = panels[name]
        ax.plot(omega, KPA * young * model, color=MODEL, lw=0.9, label="Prony series")
        for k, test in enumerate(tests):
            value = test.storage if name == "storage" else test.loss
            sigma = test.sigma_storage if name == "storage" else test.sigma_loss
            draw_test(ax, k, label_text(test.label, 24), test.angular_frequency, KPA * value, KPA * sigma)
        ax.set_xscale("log")
        ax.set(xlabel="Angular frequency $a_T\\omega$ (rad/s)", ylabel=f"{name.capitalize()} modulus (kPa)")
    panels["storage"].legend(loc="best")
    reduced = " Sweeps are brought to their reference temperature." if result.sweeps else ""
    return f"Storage (a) and loss modulus (b) in tension, bars ±2u, and those of the series (lines).{reduced}"


@figure(
    COLUMN, 56.0, [["shifts"]], applies=lambda result: any(one.determined for one in result.sweeps.values())
)
def relaxation_shifts(result: SlowDynamics, panels: Panels) -> str:
    ax = panels["shifts"]
    for k, (name, one) in enumerate(result.sweeps.items()):
        if not one.determined:
            continue
        levels = one.sweep.levels
        colour = draw_test(ax, k, label_text(name, 24), levels - KELVIN, one.shifts, one.sigma, size=3.0)
        if one.law_holds and one.C1 is not None and one.C2 is not None:
            T = np.linspace(levels[0], levels[-1], 100)
            reference = levels[int(np.abs(levels - one.sweep.reference).argmin())]
            ax.plot(T - KELVIN, wlf(T - reference, one.C1, one.C2), color=colour, lw=0.9)
    ax.axhline(0.0, color=GREY, lw=0.4)
    ax.set(xlabel="Temperature (°C)", ylabel="$\\lg\\, a_T$ (–)")
    ax.legend(loc="best")
    return (
        "Shift factors, free at each temperature (points, bars ±2u) and by Eq. (V.5) where it holds (lines)."
    )
