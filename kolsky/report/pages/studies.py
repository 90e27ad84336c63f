"""Pages of studies: a planned measurement, a planned test, a sweep over parameters, an error budget."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from kolsky.prediction.design import Aim, Scan, events_table
from kolsky.prediction.predict import RATE_TO, Numbers, Prediction, doubts
from kolsky.report.pages.rendering import draw_figures, render_page, sentences
from kolsky.results import numbers
from kolsky.results.nomenclature import name_of, with_subscripts
from kolsky.studies.budget.records import FEWEST, Budget, Campaign
from kolsky.studies.planning.plan import Plan
from kolsky.studies.planning.plan import rows as plan_rows
from kolsky.studies.sweep import costs, misfit_sum
from kolsky.studies.sweep_analysis import OUTPUTS, SweepAnalysis


def render_plan(plan: Plan) -> str:
    """Return the page as HTML text."""
    unseen = [f"{part}: {found.unseen}" for part, found in plan.expected.items() if found.unseen]
    return render_page(
        "plan.html",
        kind="Planned measurement: what to expect",
        heading=plan.shot,
        subject="plan",
        warnings=sentences(unseen),
        expected=[_expected_row(plan, j) for j in range(len(plan.names))],
        figures=draw_figures(plan),
        choices=[(key, value) for key, value in plan_rows(plan).items() if key != "shot"],
    )


def _expected_row(plan: Plan, j: int) -> dict[str, Any]:
    """Expected value with its k = 2 interval, and the half widths in other cases."""
    name, whole = name_of(plan.names[j]), plan.expected["all"]
    double = 2.0 * name.factor
    value = name.factor * float(plan.information.sensitivity.point[j])
    parts = {"force": "force alone", "outline": "outline alone"}
    others = {parts[part]: found.deviations[j] for part, found in plan.expected.items() if part != "all"}
    shown, U = numbers.measured(value, double * float(whole.deviations[j]))
    widths = {"others known": whole.alone[j], **others}
    return {
        "Parameter": with_subscripts(_named(plan.names[j])),
        "All estimated together": f"{shown} ± {U}",
        **{f"U, {part}": numbers.plain(double * float(sigma), 2) for part, sigma in widths.items()},
    }


WORDS = {
    "flyer_speed": ("flyer after the separation (m/s)", 1.0),
    "start_rate": ("that over the specimen's length (1/s)", 1.0),
    "mean_rate": (f"mean strain rate to {100 * RATE_TO:.0f} % of the largest compression (1/s)", 1.0),
    "largest_strain": ("largest compression (%)", 100.0),
    "peak_force": ("largest transmitted force (N)", 1.0),
    "flight": ("separation to arrest (ms)", 1e3),
    "shaper_strain": ("compression of the shaper (mm)", 1e3),
    "pulse_force": ("largest force on the shaper (kN)", 1e-3),
}
"""The numbers of a test in words, and the factor from SI to the displayed number."""


def render_prediction(result: Prediction, scan: Scan | None = None, aim: Aim | None = None) -> str:
    """Return the page as HTML text."""
    figures = draw_figures(result)
    if scan is not None:
        from kolsky.report.figures import SCANS

        figures += draw_figures((scan, aim), SCANS.values(), first=len(figures) + 1)
    table = events_table(result)
    return render_page(
        "prediction.html",
        kind="Planned impact test, predicted",
        heading=result.test.declared.name,
        subject="prediction",
        warnings=sentences(doubts(result)),
        facts=rows(result.numbers),
        aim=[] if aim is None else _aimed(aim),
        events=[
            {
                "Event": name,
                "Time (µs)": f"{1e6 * t:.0f}",
                "Flyer (m/s)": f"{v:.2f}",
                "Compression (%)": f"{100 * e:.1f}",
                "Transmitted (N)": f"{f:.1f}",
            }
            for name, t, v, e, f in zip(*table.values(), strict=True)
        ],
        figures=figures,
    )


def rows(result: Numbers) -> list[tuple[str, str]]:
    """The numbers of a test in words."""
    return [
        (words, numbers.plain(factor * getattr(result, name), 4)) for name, (words, factor) in WORDS.items()
    ]


def _aimed(aim: Aim) -> list[tuple[str, str]]:
    lines = [(key, numbers.plain(value, 4)) for key, value in aim.at.items()]
    for name, value in aim.wanted.items():
        words, factor = WORDS[name]
        given = numbers.plain(factor * getattr(aim.numbers, name), 4)
        lines.append((words, f"{given}, wanted {numbers.plain(factor * value, 4)}"))
    return [*lines, ("reached", "yes" if aim.reached else "no, this is the nearest point within the ranges")]


MOST_LISTED = 200
"""Largest number of runs in the page's table. The CSV file has all runs."""
CHOSEN = "those that failed, then those with the smallest misfit"
SWEEP_WORDS = {"Phi_F": "Φ_F", "Phi_S": "Φ_S", "Phi": "Φ"}


def render_sweep(result: SweepAnalysis, warnings: Sequence[str] = ()) -> str:
    """Return the page as HTML text."""
    table = result.table
    n = len(table.outcomes)
    completed = n - len(table.lost)
    listed = _listed(result)
    return render_page(
        "sweep.html",
        kind="Design of experiments over one impact test",
        heading=result.shot,
        subject="sweep",
        warnings=sentences(warnings),
        figures=draw_figures(result),
        facts=[
            ("runs", f"{n}, {completed} completed"),
            *((_named(name), _range(result, name)) for name in result.box.names),
            *_least(result),
        ],
        outputs=[
            {
                "Misfit": with_subscripts(
                    SWEEP_WORDS[name] + (f" ({unit})" if (unit := OUTPUTS[name]) != "1" else "")
                ),
                "Runs": int(np.isfinite(output.values).sum()),
                "Smallest": numbers.plain(float(np.nanmin(output.values))),
                "Largest": numbers.plain(float(np.nanmax(output.values))),
                "Error / standard deviation": numbers.percent(output.error),
                "Verdict": output.refused or "good enough",
                "lost": bool(output.refused),
            }
            for name, output in result.outputs.items()
        ],
        outcomes=[(name.lower().replace("_", " "), n) for name, n in Counter(table.outcomes).most_common()],
        listed=f"All {len(listed)} runs" if len(listed) == n else f"{len(listed)} of {n} runs: {CHOSEN}",
        runs=[_run_row(result, i) for i in listed],
    )


def _named(name: str) -> str:
    known = name_of(name)
    return known.symbol if known.unit == "1" else f"{known.symbol} ({known.unit})"


def _range(result: SweepAnalysis, name: str) -> str:
    i, factor = result.box.names.index(name), name_of(name).factor
    text = f"{numbers.plain(factor * result.box.lower[i])} to {numbers.plain(factor * result.box.upper[i])}"
    return f"{text}, evenly in the logarithm" if result.box.logarithmic[i] else text


def _least(result: SweepAnalysis) -> Iterator[tuple[str, str]]:
    """The run with the smallest misfit and the minimum of the interpolant, if available."""
    if (best := result.best) is not None:
        yield "smallest misfit", f"run {best}: {_place(result.box.as_dict(result.table.points[best]), {})}"
    if (least := result.optimum) is not None:
        at = _place(result.box.as_dict(least.x), least.at_bound)
        yield (
            "least of the interpolant",
            f"{SWEEP_WORDS[result.judged]} = {numbers.plain(least.value)} at {at}",
        )


def _place(point: Mapping[str, float], at_bound: Mapping[str, str]) -> str:
    """A point in words, with the names of bounds on which it lies."""
    return ", ".join(
        f"{_named(name)} = {numbers.plain(name_of(name).factor * value)}"
        + (f" (at the {at_bound[name]} bound)" if name in at_bound else "")
        for name, value in point.items()
    )


def _listed(result: SweepAnalysis) -> list[int]:
    """Return the runs in the table: all, or the failed ones and those with the smallest misfit."""
    n = len(result.table.outcomes)
    if n <= MOST_LISTED:
        return list(range(n))
    lost = list(result.table.lost)[: MOST_LISTED // 2]
    ranked = [int(i) for i in np.argsort(costs(result.table)) if int(i) not in set(result.table.lost)]
    return [*lost, *ranked[: MOST_LISTED - len(lost)]]


def _run_row(result: SweepAnalysis, i: int) -> dict[str, Any]:
    table = result.table
    lost = i in table.lost
    phi = (table.phi_force[i], table.phi_shape[i], misfit_sum(table)[i])
    headings = map(with_subscripts, ("Φ_F (N)", "Φ_S (–)", "Φ (–)"))
    return {
        "Run": i,
        **{
            with_subscripts(_named(name)): numbers.plain(name_of(name).factor * value)
            for name, value in zip(result.box.names, table.points[i], strict=True)
        },
        **{heading: numbers.plain(float(value)) for heading, value in zip(headings, phi, strict=True)},
        "Outcome": table.ending(i).sentence if lost else "completed",
        "lost": lost,
    }


def render_budget(results: Sequence[Budget], campaign: Campaign | None) -> str:
    """Return the page as HTML text."""
    first = results[0]
    figures: list[dict[str, Any]] = []
    for result in results:
        figures += draw_figures(result, first=len(figures) + 1, mark=result.parameter)
    return render_page(
        "budget.html",
        kind="Error budget of one impact test",
        heading=first.name,
        subject="error budget",
        warnings=budget_warnings(first),
        figures=figures,
        budgets=[_table(result) for result in results],
        campaign=[] if campaign is None else _campaign(campaign),
    )


def _table(result: Budget) -> dict[str, Any]:
    known = name_of(result.parameter)
    total = result.u_together if np.isfinite(result.u_together) else result.u_sum
    scale = known.factor
    U = 2.0 * (scale * total)
    rows = [
        {
            "Source": source.factor.words,
            "Key": source.factor.key,
            "Its u (SI)": numbers.plain(source.factor.sigma)
            if source.factor.key != "noise"
            else numbers.NOTHING,
            "u of the answer": numbers.part(scale * source.u, U),
            "Bias": numbers.part(scale * source.bias, U),
            "Share (95 %)": _share(
                result.share(source) if np.isfinite(source.u) else np.nan, source.share_interval
            ),
            "Common to all shots": "yes" if source.factor.shared else "no",
            "Refused": "; ".join(source.refused),
            "lost": bool(source.refused),
        }
        for source in sorted(result.sources, key=lambda source: -np.nan_to_num(source.u))
    ]
    low, high = result.u_together_interval
    together = f"not known: {len(result.together)} answers, {FEWEST} are needed"
    if len(result.together) >= FEWEST:
        ends = (numbers.plain(2.0 * scale * end, 3) for end in (result.u_together, low, high))
        together = "{} ({} to {})".format(*ends)
    facts = [
        ("true value", numbers.plain(scale * result.truth)),
        ("estimate without errors", numbers.plain(scale * result.reference)),
        ("U (k = 2), sources added in quadrature", numbers.plain(2.0 * scale * result.u_sum, 3)),
        (f"U (k = 2), all at once, {len(result.together)} draws", together),
    ]
    facts.append(("re-fit minus whole search, without errors", numbers.part(scale * result.closure, U)))
    facts.append(("realisations", ", ".join(f"{n} {how}" for how, n in result.counts.items())))
    if result.searched:
        facts.append(
            ("ended in another valley", f"{len(result.elsewhere)} of {result.searched} whole searches")
        )
    return {"symbol": _named(result.parameter), "facts": facts, "rows": rows}


def budget_rows(result: Budget, campaign: Campaign | None = None) -> dict[str, str]:
    """Return the page's facts for a terminal, and each source with its expanded uncertainty and share."""
    known = name_of(result.parameter)
    rows = {"test": result.name, "parameter": result.parameter, **dict(_table(result)["facts"])}
    for source in sorted(result.sources, key=lambda source: -np.nan_to_num(source.u)):
        text = "not known: the test gave no answer"
        if np.isfinite(source.u):
            U = numbers.plain(2.0 * known.factor * source.u, 3)
            text = f"{U} ({numbers.percent(result.share(source))})"
        rows[f"U from {source.factor.words}"] = text
    rows |= {} if campaign is None else dict(_campaign(campaign))
    return {name: numbers.plain_sentence(text) for name, text in rows.items()}


def _share(value: float, interval: tuple[float, float]) -> str:
    """Return a share with its 95 % interval, if known."""
    if not np.isfinite(value):
        return numbers.NOTHING
    known = np.isfinite(interval).all()
    ends = f" ({numbers.percent(interval[0])} to {numbers.percent(interval[1])})" if known else ""
    return f"{numbers.percent(value)}{ends}"


def budget_warnings(result: Budget) -> list[str]:
    """Return the warnings of a budget, a sentence or two each."""
    texts = []
    if result.adds_up is False:
        texts.append(
            "The sources added in quadrature do not give the uncertainty with all sources at once: they "
            "interact, or the answer is not linear in them. Use the uncertainty with all sources at once."
        )
    if len(result.elsewhere):
        places = ", ".join(
            numbers.plain(value * name_of(result.parameter).factor, 4) for value in result.elsewhere
        )
        texts.append(
            f"{len(result.elsewhere)} of {result.searched} whole searches with all errors at once ended in "
            f"another valley of the misfit, at {places}. The uncertainties here are those within the valley "
            "of the test without errors; jumps are not included."
        )
    if lost := [source.factor.words for source in result.sources if source.refused]:
        texts.append(f"No uncertainty is known of {', '.join(lost)}: tests with that error gave no answer.")
    if result.refused:
        drawn = len(result.refused) + len(result.together)
        texts.append(f"{len(result.refused)} of {drawn} tests with all errors at once gave no answer.")
    return texts


def _campaign(campaign: Campaign) -> list[tuple[str, str]]:
    rates = campaign.rates
    return [
        ("shots", str(campaign.shots)),
        ("nominal strain rates", f"{rates[0]:.4g} to {rates[-1]:.4g} 1/s, half at either end"),
        ("standard deviation of one shot about the line", numbers.plain(campaign.sigma, 3)),
        ("expanded uncertainty of the slope per decade", numbers.plain(campaign.half_width, 3)),
    ]
