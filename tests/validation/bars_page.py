"""Numbers and figures of the page on real bar signals: `python tests/validation/bars_page.py`."""

import json
import sys
from pathlib import Path

TESTS = Path(__file__).resolve().parent.parent
for folder in (TESTS.parent, TESTS / "helpers", TESTS / "verification", TESTS / "validation"):
    if str(folder) not in sys.path:
        sys.path.insert(0, str(folder))

import matplotlib  # noqa: E402
import numpy as np  # noqa: E402
from matplotlib.figure import Figure  # noqa: E402
from page_values import store  # noqa: E402
from pages import ON_SCREEN, PAGE_WIDTH, STYLE  # noqa: E402
from test_real_bars import (  # noqa: E402
    SHEET,
    Reduced,
    by_hand,
    compared,
    copper,
    copper_facts,
    epoxy,
    flow_stress,
    imbalance_left,
    johnson_cook,
    preston_tonks_wallace,
)

from kolsky.bars.reduction.stress_strain import cauchy_stress, hencky_strain, stiffness  # noqa: E402
from kolsky.bars.reduction.validity import ALLOWANCE  # noqa: E402
from kolsky.bars.reduction.windows import travel_time  # noqa: E402
from kolsky.bars.signals.baseline import quantisation_step  # noqa: E402

MADE = TESTS.parent / "populations" / "results" / "bar_signals.json"
"""Counts that `python -m populations.bar_signals` writes."""
DOCS = TESTS.parent / "docs" / "validation"
BLUE, RED, GREEN, BLACK = "#0072B2", "#D55E00", "#009E73", "black"
STRAINS = (0.05, 0.10, 0.15)  # true strains at which the copper is compared


def draw_epoxy(figure: Figure) -> None:
    """Forces at both faces and stress over strain, with the authors' columns behind."""
    axes = figure.subplots(2, 2)
    for row, sample in zip(axes, (1, 2), strict=True):
        test, sheet = epoxy(sample, dispersion=False), by_hand(sample)
        r, left, right = test.reduction, row[0], row[1]
        time = 1e6 * r.time
        left.axvspan(*(1e6 * t for t in r.balanced), color="0.9", lw=0)
        left.plot(time, 1e-3 * r.front_force.value, color=RED, lw=0.6, label="front, $F_1$")
        left.plot(time, 1e-3 * r.back_force.value, color=BLUE, lw=0.6, label="back, $F_2$")
        left.set(ylabel="force [kN]", xlim=(time[0], time[-1]))
        theirs = [sheet[f"{kind}_2w{unit}"] for kind, unit in (("strain", ""), ("stress", "_MPa"))]
        right.plot(*theirs, color="0.65", lw=2.2, label="by hand")
        for way, color in (("one wave", BLUE), ("three waves", RED)):
            e, s = r.strain[way].value, 1e-6 * r.stress[way].value
            right.plot(e, s, color=color, lw=0.5, label=way)
        right.set(ylabel="nominal stress [MPa]", xlim=(0, None), ylim=(-40, 330))
        left.text(0.5, 0.05, f"sample {sample}", transform=left.transAxes, ha="center")
    for ax in axes[1]:
        ax.set_xlabel("time at the specimen [µs]" if ax is axes[1, 0] else "nominal strain [-]")
    axes[0, 0].legend(loc="upper right")
    axes[0, 1].legend(loc="upper right")


def draw_copper(figure: Figure) -> None:
    """Forces, R(t) and true stress over true strain, the gauge's place as said and as calibrated."""
    left, middle, right = figure.subplots(1, 3)
    test = copper(dispersion=True)
    r, time = test.reduction, 1e6 * test.reduction.time
    left.plot(time, 1e-3 * r.front_force.value, color=RED, label="front, $F_1$")
    left.plot(time, 1e-3 * r.back_force.value, color=BLUE, label="back, $F_2$")
    left.set(xlabel="time at the specimen [µs]", ylabel="force [kN]", xlim=(time[0], time[-1]))
    for ax in (left, middle):
        ax.axvspan(*(1e6 * t for t in r.balanced), color="0.9", lw=0)
    for shot, color, label in (
        (copper(dispersion=False, calibrated=False), "0.6", "as said, shifted"),
        (test, BLACK, "calibrated, dispersed"),
    ):
        ratio = np.where(np.isfinite(shot.reduction.imbalance), shot.reduction.imbalance, np.nan)
        middle.plot(1e6 * shot.reduction.time, ratio, color=color, label=label)
    for level in (-ALLOWANCE, ALLOWANCE):
        middle.axhline(level, color=BLACK, lw=0.5, ls=":")
    middle.set(xlabel="time at the specimen [µs]", ylabel="$R$ [-]", xlim=(0, 60), ylim=(-0.6, 0.6))
    for way, color in (("two waves", GREEN), ("three waves", RED), ("one wave", BLUE)):
        e, s = hencky_strain(r.strain[way]), cauchy_stress(r.stress[way], r.strain[way])
        last = int(e.value.argmax())
        right.plot(e.value[:last], 1e-6 * s.value[:last], color=color, label=way, lw=0.9)
    strain = np.linspace(0.01, 0.17, 33)
    model = [1e-6 * preston_tonks_wallace(e, 3000.0) for e in strain]
    right.plot(strain, model, color=BLACK, ls="--", label="PTW, 3000 s$^{-1}$")
    right.set(xlabel="true strain [-]", ylabel="true stress [MPa]", xlim=(0, 0.19), ylim=(0, 330))
    left.legend(loc="upper left")
    middle.legend(loc="upper right")
    right.legend(loc="lower right")


def table_of_epoxy() -> str:
    """One row a quantity: ours, theirs, and how far apart, for both samples."""
    rows = []
    for sample in (1, 2):
        shifted, carried = compared(sample), compared(sample, dispersion=True)
        for (analysis, quantity), plain in shifted.items():
            unit, scale = ("", 1.0) if "strain" in quantity else (" MPa", 1e-6)
            digits = ".4f" if unit == "" else ".2f"
            rows.append(
                f'| {sample} | {analysis} ("{SHEET[analysis]}") | {quantity} '
                f"| {scale * plain.theirs:{digits}}{unit} | {scale * plain.ours:{digits}}{unit} "
                f"| {100 * plain.off:+.2f} % | {100 * carried[analysis, quantity].off:+.2f} % |"
            )
    return "\n".join(rows)


def table_of_copper() -> str:
    """True stress by one and three waves beside the models."""
    test, rows = copper(dispersion=True), []
    for strain in STRAINS:
        one, rate = flow_stress(test, strain)
        three, _ = flow_stress(test, strain, analysis="three waves")
        models = (preston_tonks_wallace(strain, rate), johnson_cook(strain, rate))
        rows.append(
            f"| {strain:.2f} | {rate:.0f} | {1e-6 * one:.0f} | {1e-6 * three:.0f} "
            + " ".join(f"| {1e-6 * model:.0f} ({100 * (one / model - 1):+.0f} %)" for model in models)
            + " |"
        )
    return "\n".join(rows)


def span_of(test: Reduced) -> str:
    """The span of equilibrium, in words."""
    first, last = (1e6 * t for t in test.reduction.balanced)
    return f"{first:.0f} µs to {last:.0f} µs"


def shown() -> dict[str, object]:
    """Further names of the page; the limits of the remarks are from `populations/bar_signals.py`."""
    one, two = (epoxy(sample, dispersion=False) for sample in (1, 2))
    counts = [1e6 * quantisation_step(s.strain.value) for test in (one, two) for s in test.signals]
    zero = float(one.signals[0].strain.value[:500].mean())
    shift = 1e-6 * stiffness(one.signals[0].bar) * zero / one.specimen.area
    late = [1e6 * test.seen[0].delay for test in (one, two)]
    share = 100 * max(late) / (2e6 * travel_time(one.signals[0]))
    gap = 1e6 * one.seen[1].delay
    said, test = copper_facts(), copper(dispersion=True)
    as_said = copper(dispersion=False, calibrated=False)
    way, listed = 2e6 * said["gauge"] / said["speed"], 1e6 * said["reflected time"]
    lag, rest = 1e6 * as_said.seen[0].delay, 1e6 * abs(test.seen[0].delay)
    unrest = {
        (dispersion, calibrated): imbalance_left(copper(dispersion=dispersion, calibrated=calibrated))
        for dispersion in (False, True)
        for calibrated in (False, True)
    }
    recorded = json.loads(MADE.read_text(encoding="utf-8"))
    first, second = recorded["chosen on"], recorded["judged on"]
    lines = [
        f"| {name} | {first[name]:.3g} | {second[name]:.3g} |" if "rise" in name or name == "tests"
        else f"| {name} | {100 * first[name]:.0f} % | {100 * second[name]:.0f} % |"
        for name in first
    ]  # fmt: skip
    made = "\n".join(lines)
    return locals()


def main() -> None:
    """Draw both figures and write the page."""
    (DOCS / "images").mkdir(parents=True, exist_ok=True)
    with matplotlib.rc_context(fname=STYLE):
        matplotlib.rcParams.update(ON_SCREEN)
        for name, draw, height in (("epoxy", draw_epoxy, 4.6), ("copper", draw_copper, 2.5)):
            figure = Figure(figsize=(PAGE_WIDTH, height), layout="constrained")
            draw(figure)
            figure.savefig(DOCS / "images" / f"bars-{name}.png", dpi=150, metadata={"Date": None})
    store(DOCS / "bars.md", globals() | shown())


if __name__ == "__main__":
    main()
