"""Figures of slow tests' rate dependence: moduli over time, holds, storage and loss, shift factors."""

import numpy as np

from kolsky.joint.slow_dynamics import SlowDynamics
from kolsky.material.relaxation.evidence import DynamicTest, HistoryTest
from kolsky.material.relaxation.temperature import wlf
from kolsky.report.figures.base import COLUMN, GREY, MODEL, PAGE, FigureKind, Panels, label_panel, label_text
from kolsky.report.figures.rate_curves import MARKERS, MODULI, TEST_COLOURS, TimeScales

KPA = 1e-3
KELVIN = 273.15


def shown_moduli(found: SlowDynamics) -> TimeScales:
    """Return the moduli as their figure takes them."""
    return TimeScales(found.moduli, found.fitted)


def holds(found: SlowDynamics) -> list[HistoryTest]:
    """Return the histories of strain."""
    return [test for test in found.tests if isinstance(test, HistoryTest)]


def oscillations(found: SlowDynamics) -> list[DynamicTest]:
    """Return the oscillations, sweeps at their reference temperature."""
    return [test for test in found.tests if isinstance(test, DynamicTest)]


def caption_holds(found: SlowDynamics) -> str:
    """Return the caption."""
    return "Nominal stress of the histories of strain (points, bars ±2u) and of the Prony series (lines)."


def draw_holds(found: SlowDynamics, panels: Panels) -> None:
    """Draw stress over time, measured and by the series."""
    ax = panels["stress"]
    for k, test in enumerate(holds(found)):
        known = np.isfinite(test.sigma) & (test.time > 0.0)
        colour = TEST_COLOURS[k % len(TEST_COLOURS)]
        ax.errorbar(
            test.time[known], KPA * test.stress[known], yerr=2.0 * KPA * test.sigma[known],
            fmt=MARKERS[k % len(MARKERS)], ms=2.4, lw=0.6, color=colour, label=label_text(test.label, 24),
        )  # fmt: skip
        predicted = test.predict(found.law, [found.fit.model])[0]
        ax.plot(test.time[known], KPA * predicted[known], color=colour, lw=0.9)
    ax.set_xscale("log")
    ax.set(xlabel="Time (s)", ylabel="Nominal stress (kPa)")
    ax.legend(loc="best")


def caption_oscillation(found: SlowDynamics) -> str:
    """Return the caption."""
    reduced = " Sweeps are brought to their reference temperature." if found.sweeps else ""
    return f"Storage (a) and loss modulus (b) in tension, bars ±2u, and those of the series (lines).{reduced}"


def draw_oscillation(found: SlowDynamics, panels: Panels) -> None:
    """Draw storage and loss over the reduced frequency."""
    tests = oscillations(found)
    all_omega = np.concatenate([test.angular_frequency for test in tests])
    omega = np.geomspace(all_omega.min(), all_omega.max(), 200)
    young = found.young
    series = found.fit.model.series
    for letter, (name, model) in zip(
        "ab", (("storage", series.storage(omega)), ("loss", series.loss(omega))), strict=True
    ):
        ax = panels[name]
        label_panel(ax, letter)
        ax.plot(omega, KPA * young * model, color=MODEL, lw=0.9, label="Prony series")
        for k, test in enumerate(tests):
            value = test.storage if name == "storage" else test.loss
            sigma = test.sigma_storage if name == "storage" else test.sigma_loss
            ax.errorbar(
                test.angular_frequency, KPA * value, yerr=2.0 * KPA * sigma, fmt=MARKERS[k % len(MARKERS)],
                ms=2.4, lw=0.6, color=TEST_COLOURS[k % len(TEST_COLOURS)], label=label_text(test.label, 24),
            )  # fmt: skip
        ax.set_xscale("log")
        ax.set(xlabel="Angular frequency $a_T\\omega$ (rad/s)", ylabel=f"{name.capitalize()} modulus (kPa)")
    panels["storage"].legend(loc="best")


def caption_shifts(found: SlowDynamics) -> str:
    """Return the caption."""
    return (
        "Shift factors, free at each temperature (points, bars ±2u) and by Eq. (V.5) where it holds (lines)."
    )


def draw_shifts(found: SlowDynamics, panels: Panels) -> None:
    """Draw the shift factors over temperature."""
    ax = panels["shifts"]
    for k, (name, one) in enumerate(found.sweeps.items()):
        if not one.determined:
            continue
        levels, colour = one.sweep.levels, TEST_COLOURS[k % len(TEST_COLOURS)]
        ax.errorbar(
            levels - KELVIN, one.shifts, yerr=2.0 * one.sigma, fmt=MARKERS[k % len(MARKERS)], ms=3.0, lw=0.6,
            color=colour, label=label_text(name, 24),
        )  # fmt: skip
        if one.law_holds and one.C1 is not None and one.C2 is not None:
            T = np.linspace(levels[0], levels[-1], 100)
            reference = levels[int(np.abs(levels - one.sweep.reference).argmin())]
            ax.plot(T - KELVIN, wlf(T - reference, one.C1, one.C2), color=colour, lw=0.9)
    ax.axhline(0.0, color=GREY, lw=0.4)
    ax.set(xlabel="Temperature (°C)", ylabel="$\\lg\\, a_T$ (–)")
    ax.legend(loc="best")


FIGURES: tuple[FigureKind[SlowDynamics], ...] = (
    FigureKind(
        name="relaxation-moduli",
        width=COLUMN,
        height=lambda found: 66.0,
        caption=lambda found: MODULI.caption(shown_moduli(found)),
        panels=lambda found: [["moduli"]],
        draw=lambda found, panels: MODULI.draw(shown_moduli(found), panels),
        applies=lambda found: len(found.moduli) > 0,
    ),
    FigureKind(
        name="relaxation-holds",
        width=COLUMN,
        height=lambda found: 60.0,
        caption=caption_holds,
        panels=lambda found: [["stress"]],
        draw=draw_holds,
        applies=lambda found: len(holds(found)) > 0,
    ),
    FigureKind(
        name="relaxation-oscillation",
        width=PAGE,
        height=lambda found: 60.0,
        caption=caption_oscillation,
        panels=lambda found: [["storage", "loss"]],
        draw=draw_oscillation,
        applies=lambda found: len(oscillations(found)) > 0,
    ),
    FigureKind(
        name="relaxation-shifts",
        width=COLUMN,
        height=lambda found: 56.0,
        caption=caption_shifts,
        panels=lambda found: [["shifts"]],
        draw=draw_shifts,
        applies=lambda found: any(one.determined for one in found.sweeps.values()),
    ),
)
