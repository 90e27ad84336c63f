"""Write the validation page on real bar signals: `python tests/validation/bars_page.py`.

Page, figures and `test_real_bars.py` call the same functions of `real_bars`. The data are from other
laboratories, in a folder `shared` next to the repository.
"""

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

from kolsky.bars.reduction.stress_strain import (  # noqa: E402
    cauchy_stress,
    hencky_strain,
    stiffness,
)
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


def page() -> str:
    """The page, with every number from the runs that draw the figures."""
    return "\n".join((HEAD, epoxy_text(), copper_text(), made_text(), HOPPYBAR))


HEAD = """# Real bar signals

This page compares the reduction of bar signals with the published results of two laboratories. Their files
are read without changes. No window, delay or shift of theirs is used.
`python tests/validation/bars_page.py` writes this page. `pytest tests/validation/test_real_bars.py` tests
its numbers. The records are not part of the project.
"""

HOPPYBAR = """## HopPyBar's method

HopPyBar also solves the first Pochhammer–Chree mode (after Bragov and others). It has the same analyses by
one, two and three waves and the same true quantities, after Gray (2000). In HopPyBar the user marks the
beginning of the pulses and shifts the reflected and the transmitted wave until they appear aligned. Here the
shifts follow from distances and wave speeds, and are compared with the observed arrivals. HopPyBar
integrates by rectangular sums. It has no R(t), no span of equilibrium, no sigmas, no punching correction and
no energy balance.

## Sources

- G. T. Gray III, "Classic split-Hopkinson pressure bar testing", ASM Handbook 8, 2000.
- D. L. Preston, D. L. Tonks and D. C. Wallace, "Model of plastic deformation for extreme loading conditions",
  J. Appl. Phys. 93, 2003.
- G. R. Johnson and W. H. Cook, "A constitutive model and data for metals subjected to large strains, high
  strain rates and high temperatures", 7th International Symposium on Ballistics, 1983.
"""


def span_of(test: Reduced) -> str:
    """The span of equilibrium, in words."""
    first, last = (1e6 * t for t in test.reduction.balanced)
    return f"{first:.0f} µs to {last:.0f} µs"


def epoxy_text() -> str:
    """The section on epoxy."""
    one, two = (epoxy(sample, dispersion=False) for sample in (1, 2))
    counts = [1e6 * quantisation_step(s.strain.value) for test in (one, two) for s in test.signals]
    zero = float(one.signals[0].strain.value[:500].mean())
    shift = 1e-6 * stiffness(one.signals[0].bar) * zero / one.specimen.area
    late = [1e6 * test.seen[0].delay for test in (one, two)]
    share = 100 * max(late) / (2e6 * travel_time(one.signals[0]))
    gap = 1e6 * one.seen[1].delay
    return f"""## Epoxy, compared with the authors' hand processing

Yao's data (github.com/arialolita000111/shpb-shtb-data-processor, MIT licence) have two epoxy cylinders of
10 mm by 4 mm between steel bars of 20 mm. The gauges are 1018 mm and 741 mm from the specimen. The interval
between samples is 80 ns, and one count is {min(counts):.1f} to {max(counts):.1f} µε. The authors' sheet has
their aligned waves, and strain and stress by two analyses, "3w" and "2w". "3w" is the analysis by three
waves of [the theory page](#theory-reduction). "2w" takes the rate from the reflected and the stress from
the transmitted wave, which is called one wave here. Their strain is the rectangular sum of the rate. They
subtract the mean of the first 500 samples from the raw waves. Their waves are 328 µs long and aligned only
by 2 x/c0 and (x + x)/c0.

The sheet gives no mean stress. The means of this table are means over time. For sheet and program they
begin at the same time after the arrival of the incident wave. In the sheet this is the arrival in its first
column. One mean is over the whole test, from the arrival to the end of the shorter record. The other is
over the plateau, in which the forces are in equilibrium. Their true stress has a wrong sign and is not
compared.

| sample | analysis (theirs) | quantity | by hand | automatic | off | off, dispersed |
| --- | --- | --- | --- | --- | --- | --- |
{table_of_epoxy()}

```{{figure}} images/bars-epoxy.png
:width: 100%
:alt: Forces and stress over strain of two epoxy specimens

Left: forces at both faces; the longest span with |R| within {100 * ALLOWANCE:.0f} % is grey. Right: stress
over strain and the authors' columns ("2w"). The transmitted pulse of sample 1 arrives {gap:.0f} µs late,
because of a gap or an uneven face. Data: Yao.
```

The remaining difference comes from the baseline. The incident gauge of sample 1 drifts. The authors' zero
is the mean of its first 500 samples. The zero here is the mean up to 25 µs before the pulse. They differ by
{zero * 1e6:.1f} µε. At the front face this error is in both the incident and the reflected wave. It changes
the stress of three waves by {shift:.1f} MPa. The reflected pulses arrive {late[0]:.1f} and {late[1]:.1f} µs
later than predicted, {share:.1f} % of their travel time.

Equilibrium holds from {span_of(one)} (sample 1) and from {span_of(two)} (sample 2). It begins at a high
stress, so no loading modulus is given: "{two.summary.modulus_reason}". The indentation of the bars' faces
is up to {100 * two.punching.size:.2f} % of strain (sample 2). The authors do not correct it, and neither
does the table.
"""


def copper_text() -> str:
    """The section on copper."""
    said, test = copper_facts(), copper(dispersion=True)
    as_said = copper(dispersion=False, calibrated=False)
    way, listed = 2e6 * said["gauge"] / said["speed"], 1e6 * said["reflected time"]
    late, rest = 1e6 * as_said.seen[0].delay, 1e6 * abs(test.seen[0].delay)
    unrest = {
        (dispersion, calibrated): imbalance_left(copper(dispersion=dispersion, calibrated=calibrated))
        for dispersion in (False, True)
        for calibrated in (False, True)
    }
    return f"""## OFE copper, without a published result

Los Alamos's example of HopPyBar (github.com/lanl/HopPyBar, BSD-3 licence) is annealed copper of 6.34 mm by
3.204 mm between Ti-6Al-4V bars of 9.47 mm. All inputs except the bars' length come from the metadata of the
file. Two of them contradict each other. With gauges {1e3 * said["gauge"]:.0f} mm from the specimen and a
rod speed of {said["speed"]:.0f} m/s the reflected pulse needs {way:.1f} µs. The laboratory's calibration
lists {listed:.1f} µs. The record supports the calibration: the reflected pulse arrives {late:.2f} µs later
than predicted, at {way + late:.1f} µs. If the distance of the incident gauge follows from the calibrated
time, the pulse arrives within {rest:.2f} µs of the prediction. The root mean square of R from 10 µs to 50
µs is {unrest[False, False]:.3f} with the distance of the file and waves that are only shifted. It is
{unrest[False, True]:.3f} with the calibrated distance, {unrest[True, False]:.3f} with dispersion only, and
{unrest[True, True]:.3f} with both. The two errors partly cancel each other.

```{{figure}} images/bars-copper.png
:width: 100%
:alt: Forces, equilibrium and true stress over true strain of a copper specimen

Left: forces at both faces, with dispersion corrected. Middle: R(t) with and without the calibrated distance
and dispersion, the allowance (dotted) and the span of equilibrium (grey). Right: true stress over true
strain. Data: Los Alamos National Laboratory.
```

Equilibrium holds from {span_of(test)}. The table compares two models of copper, Preston, Tonks and Wallace
(2003) and Johnson and Cook (1983). Both are isothermal at 300 K. The value in brackets is one wave relative
to the model:

| true strain | true rate, 1/s | one wave, MPa | three waves, MPa | PTW, MPa | Johnson–Cook, MPa |
| --- | --- | --- | --- | --- | --- |
{table_of_copper()}

The second model was fitted to copper in another state. The two models differ more from each other than the
test differs from the first. This is a check of the level, not a validation.
"""


def made_text() -> str:
    """The section on made signals, from the counts of `populations/bar_signals.py`."""
    counts = json.loads(MADE.read_text(encoding="utf-8"))
    first, second = counts["chosen on"], counts["judged on"]
    rows = [
        f"| {name} | {first[name]:.3g} | {second[name]:.3g} |" if "rise" in name or name == "tests"
        else f"| {name} | {100 * first[name]:.0f} % | {100 * second[name]:.0f} % |"
        for name in first
    ]  # fmt: skip
    return f"""## Limits of the remarks, tested on synthetic signals

`python -m populations.bar_signals` makes two populations of {first["tests"]:.0f} random tests each. The
bars are of steel, aluminium or titanium. Incident pulses have straight or rounded flanks of 8 to 40 µs and
disperse. Specimens are elastic and then flow or harden. The noise is 0.2 % to 2 % of the pulse. The limits
(scatter of a first rise, change along a plateau, strength of a drift) were chosen on the first population.
The second was used for the test only. A distance "far" or "near" is declared 60 mm too far or too near.

| | first population | second population |
| --- | --- | --- |
{chr(10).join(rows)}

A transmitted pulse is late by the time that the specimen needs to carry force. Its arrival therefore cannot
show that a transmission gauge is declared too near. `kolsky waves` then checks the strain of the specimen
before its stress rises. A steady drift is within its sigma up to two baselines after the baseline. A longer
record needs a longer baseline.
"""


def main() -> None:
    """Draw both figures and write the page."""
    (DOCS / "images").mkdir(parents=True, exist_ok=True)
    with matplotlib.rc_context(fname=STYLE):
        matplotlib.rcParams.update(ON_SCREEN)
        for name, draw, height in (("epoxy", draw_epoxy, 4.6), ("copper", draw_copper, 2.5)):
            figure = Figure(figsize=(PAGE_WIDTH, height), layout="constrained")
            draw(figure)
            figure.savefig(DOCS / "images" / f"bars-{name}.png", dpi=150, metadata={"Date": None})
    (DOCS / "bars.md").write_text(page(), encoding="utf-8")


if __name__ == "__main__":
    main()
