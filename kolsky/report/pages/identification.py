"""Pages of an identification of one shot or several: answers, their uncertainty, search, causes.

The tables of uncertainty are in `kolsky.report.pages.uncertainty`.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup

from dic.files import replacing
from explicit import Ending
from kolsky.base.apparatus import SLIDING_LAW
from kolsky.diagnosis.cause_inputs import WITHOUT_TRACE
from kolsky.diagnosis.joint_fit import cause_sentence
from kolsky.inverse.joint_result import JointResult, interval
from kolsky.inverse.parameters import PARAMETERS, has_effect, reference_words
from kolsky.inverse.result import CauseFinding, Estimate, Identification, Verdict, worst_imbalance
from kolsky.report.figures import RECORDINGS, REGISTRY
from kolsky.report.pages.rendering import (
    FigureGroup,
    draw_figures,
    draw_groups,
    render_page,
    script,
    sentences,
    shown_unit,
)
from kolsky.report.pages.uncertainty import (
    SOURCES,
    changes,
    choices,
    dominant,
    likelihood_tables,
    milliseconds,
)
from kolsky.results import display, nomenclature, numbers
from kolsky.results.display import in_display_units
from kolsky.results.joint import fits_of
from kolsky.results.nomenclature import heading, name_of, upper_first
from kolsky.results.printed import fit_tables, summary
from kolsky.shot.input_records import SHOWN
from kolsky.shot.inputs import causes
from kolsky.shot.recordings import ShotRecordings

_VERDICTS = {
    Verdict.IDENTIFIED: "The optimum lies inside the search range, and a simulation there confirms it.",
    Verdict.FORCE_ALONE: "The optimum lies inside the search range, and a simulation there confirms it. "
    "The outline was not measured, or it alone determines the value too poorly to check the force.",
    Verdict.OUTLINE_ALONE: "The optimum lies inside the search range, and a simulation there confirms it. "
    "The force alone determines the value too poorly to check the outline.",
    Verdict.UNEXPLAINED: "The residual is larger than noise, inputs and mesh explain: do not use the value "
    "before the cause is found. The warnings name the channel.",
    Verdict.CONTRADICTED: "Force and outline give values that differ by more than their uncertainties "
    "allow: do not use the value before the cause is found.",
    Verdict.SHOTS_CONTRADICT: "The shots give stiffnesses that differ by more than their uncertainties "
    "allow: do not use the value before the cause is found. The warnings name the shots.",
    Verdict.AT_BOUND: "The optimum lies on a bound of the design: the value is a limit, not an "
    "estimate. Widen the design and run again.",
    Verdict.BOUND_REACHED: "The interval reaches past a bound of the design: the data do not exclude that "
    "bound, and only the other end of the interval is a result. Where a value beyond is possible, "
    "widen the design and run again; where none is (no friction is the least), hold the parameter there.",
    Verdict.OTHER_VALLEY: "At another value the force's ringing fits the measured one nearly as well: the "
    "value may be wrong by whole oscillations. Hold the parameter at an independent value, or declare its "
    "uncertainty.",
    Verdict.CONDITIONAL: "Another parameter lies on a bound of the design and this one compensates for it: "
    "the value and its interval hold only if that bound is right. Widen that bound, or hold that "
    "parameter at an independent value.",
    Verdict.NOT_SEEN: "The data hardly depend on this parameter: the interval excludes the values outside "
    "it, the value itself is not determined. Hold it fixed at an independent value.",
    Verdict.PLATEAU: "The simulated response jumps by so much that the misfit is flat, to within its jumps, "
    "over the width that the warnings name: the data do not distinguish these values. Refine both meshes, "
    "or hold "
    "another parameter.",
    Verdict.DISAGREEING: "The simulation at the optimum does not confirm the surrogate: do not use the "
    "value. Add runs near the optimum and search again.",
    Verdict.FAILED: "No simulation of the design completed, so there is no estimate. The design table "
    "names the cause of each run.",
}


def _flattened(value: Any, prefix: str = "") -> list[tuple[str, str]]:
    """Return all entries of a nested provenance as rows (words, text), see `kolsky.results.display`."""
    if isinstance(value, Mapping):
        return [row for k, v in value.items() for row in _flattened(v, f"{prefix}.{k}" if prefix else str(k))]
    if isinstance(value, list | tuple) and any(isinstance(item, Mapping | list | tuple) for item in value):
        return [row for i, item in enumerate(value) for row in _flattened(item, f"{prefix}[{i}]")]
    factor, unit, between, nothing, digits = display.recorded_value(prefix)
    items = value if isinstance(value, list | tuple) else [value]
    text = between.join(nothing if item is None else _value_text(item, factor, digits) for item in items)
    text = text if len(items) else "none"
    return [(display.recorded_label(prefix), f"{text} {unit}" if unit and value is not None else text)]


def _value_text(value: Any, factor: float, digits: int) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return numbers.plain(factor * value, digits) if isinstance(value, float) else str(value)


def answer_row(estimate: Estimate) -> dict[str, Any]:
    """Return one estimate in words and rounded numbers, with its uncertainty budget."""
    U = 2.0 * estimate.sigma
    value, uncertainty = numbers.measured(estimate.value, U)
    # A share of a zero or infinite variance is undefined.
    variance = estimate.sigma**2 if 0.0 < estimate.sigma < np.inf else np.nan
    budget = [(SOURCES.get(name, name), part, "part") for name, part in estimate.noise_parts.items()]
    budget.append(("noise, all sources", estimate.sigma_noise, "sum"))
    computed = estimate.numerical_parts if len(estimate.numerical_parts) > 1 else {}
    budget += [(SOURCES.get(name, name), part, "part") for name, part in computed.items()]
    budget.append(("numerics, all sources" if computed else "mesh and step", estimate.sigma_numerical, "sum"))
    if estimate.sigma_systematic > 0.0:
        budget.append(("declared uncertainties of the inputs", estimate.sigma_systematic, "sum"))
    parts = np.array(list(estimate.noise_parts.values()))
    whole = estimate.sigma_noise
    sums_up = not (parts.size and np.isfinite(whole)) or bool(
        np.isclose(np.hypot.reduce(parts), whole, rtol=0.02)  # as much as rounding of the printed parts shows
    )
    return {
        "name": name_of(estimate.name, estimate.unit),
        "unit": shown_unit(estimate.unit),
        "known": bool(np.isfinite(estimate.value)),
        "bounded": bool(np.isfinite(U)),
        "value": value,
        "uncertainty": uncertainty,
        "interval": [numbers.like(end, U) for end in estimate.interval],
        "on_mesh": numbers.like(estimate.on_mesh, U),
        "mesh_correction": numbers.part(estimate.mesh_correction, U) if estimate.mesh_correction else "",
        "verdict": estimate.outcome.value,
        "good": estimate.outcome is Verdict.IDENTIFIED,
        "meaning": _VERDICTS[estimate.outcome],
        "relative": numbers.percent(U / abs(estimate.value)) if estimate.value else numbers.NOTHING,
        "budget": [
            (name, numbers.part(u, U), numbers.percent(np.divide(u**2, variance)), kind)
            for name, u, kind in budget
        ],
        "combined": numbers.part(estimate.sigma, U),
        "sums_up": sums_up,
    }


def _fixed_rows(result: Identification) -> list[tuple[str, str]]:
    """Return words with the symbol, and value of every fixed parameter."""
    interface = result.provenance.get("interface")
    laws = set(interface.values()) if isinstance(interface, Mapping) else {SLIDING_LAW}
    rows: list[tuple[str, str]] = []
    for parameter, value in result.fixed.items():
        name = name_of(parameter)
        text = f"{numbers.plain(value)} {shown_unit(name.unit)}".rstrip()
        record = PARAMETERS.get(parameter)
        if record is not None and not has_effect(record, laws):
            text = f"not used: {record.without}"
        words = upper_first(name.words)
        rows.append(
            (words if name.symbol == name.words else heading(parameter, words=f"{words}, {{}}"), text)
        )
    reference = reference_words((*result.estimates, *result.fixed))
    if reference:
        rows.append(("What m refers to", reference))
    return rows


def _data_facts(result: Identification) -> list[tuple[str, str]]:
    """Return window, size and noise of the data that were compared."""
    c, plain = result.comparison, numbers.plain
    line, rows = c.centre_line, []
    if c.force_time.size:
        window = f"{milliseconds(c.force_time[0])} to {milliseconds(c.force_time[-1])}"
        rows.append(("window of the force", f"{window}, {c.force_time.size} bins"))
        rows.append(("largest measured force", f"{plain(float(c.force_measured.max()), 3)} N"))
        rows.append(("noise of a bin, median", f"{plain(float(np.median(c.force_sigma)), 2)} N"))
    if line.time.size:
        frames = np.unique(line.frame).size
        window = f"{milliseconds(line.time.min())} to {milliseconds(line.time.max())}"
        rows.append(("window of the outline", f"{window}, {frames} frames, {line.time.size} points"))
        rows.append(("noise of a point, median", f"{plain(1e6 * float(np.median(line.sigma)), 2)} µm"))
        rows.append(("points outside the model’s range", f"{int((~c.inside).sum())}, not counted"))
    return rows


def check_run_rows(result: Identification) -> list[tuple[str, str]]:
    """Return outcome, steps and energy imbalance of the simulation at the optimum."""
    r, plain = result.response, numbers.plain
    outcome = r.outcomes[0]
    where = _ending_words(r.ending(0))
    share, strain = float(r.extrapolated_share[0]), float(r.largest_strain_measure[0])
    ended = "completed" if outcome.ok else f"{where}: {outcome.cause}. Cure: {outcome.cure}"
    return [
        ("outcome", ended),
        ("time reached", f"{plain(1e3 * float(r.end_times[0]))} ms in {int(r.steps[0])} steps"),
        ("smallest step", f"{plain(1e6 * float(r.smallest_step[0]), 3)} µs"),
        ("worst energy imbalance", f"{numbers.percent(worst_imbalance(r))} of the largest external work"),
        ("largest strain measure √(Ī₁ − 3)", plain(strain, 3)),
        ("largest share of the volume past the material curve", numbers.percent(share)),
    ]


def _quality_rows(result: Identification) -> list[tuple[str, str]]:
    """Return errors of the surrogate and the model discrepancies used as weights, in N and µm."""
    rows = []
    for key, value in result.surrogate.items():
        words, factor, unit = display.QUALITY.get(key, (key, 1.0, ""))
        rows.append((words, f"{numbers.plain(factor * value, 2 if unit else 6)}{unit}"))
    return rows


def _ending_words(ending: Ending) -> str:
    """Return outcome, time and place of a run's end, short enough for a cell of a table."""
    name = ending.outcome.name.lower().replace("_", " ")
    if ending.outcome.ok:
        return name
    r, y = (numbers.rounded(1e3 * x, -2) for x in ending.place)
    return f"{name} at {milliseconds(ending.time)}, element {ending.element} at ({r}, {y}) mm"


def _failure_rows(result: Identification) -> list[tuple[str, str]]:
    """Return the kinds of failure among the runs, with cause and remedy."""
    kinds = {result.design.ending(run).outcome for run in result.design.lost}
    return [
        (kind.name.lower().replace("_", " "), f"{kind.cause}; the element has {kind.role}. Cure: {kind.cure}")
        for kind in sorted(kinds)
    ]


_MOST_CAUSES = 5
"""Number of listed inputs that are not likely causes."""


def cause_table(result: Identification) -> dict[str, Any]:
    """Rows of the likely causes and of the next ones, and further notes."""
    named = [c for c in result.causes if c.named]
    others = [c for c in result.causes if not c.named and c.value == c.value]
    return {
        "tried": len(result.causes),
        "named": [_cause_row(result, c) for c in named],
        "others": [_cause_row(result, c) for c in others[:_MOST_CAUSES]],
        "solved": any(c.solved for c in named),
        "invisible": WITHOUT_TRACE,
    }


def _cause_row(result: Identification, cause: CauseFinding) -> dict[str, Any]:
    factor, unit = SHOWN.get(cause.unit, (1.0, "" if cause.unit == "1" else cause.unit))
    unit = unit.replace("u", "µ", 1) if unit in ("us", "um") else unit
    value, half = numbers.measured(factor * cause.value, 2.0 * factor * cause.sigma)
    declared = numbers.plain(factor * cause.exact, 6)
    check = next((c.check for c in causes() if c.key == cause.key), cause.key)
    words = cause.words + (f", beside {cause.beside}" if cause.beside else "")
    return {
        "words": words,
        "value": f"{value} ± {half} {unit}".rstrip(),
        "declared": f"{declared} {unit}".rstrip(),
        "explained": numbers.percent(cause.explained),
        "probability": "< 0.0001" if cause.probability < 1e-4 else numbers.plain(cause.probability, 2),
        "answers": [_cause_answer(name, cause.parameters.get(name)) for name in result.estimates],
        "solved": [
            _cause_answer(name, cause.solved.get(name), cause.solved_sigmas.get(name))
            for name in result.estimates
        ],
        "check": check,
        "within": cause.within,
        "alike": ", ".join(cause.alike),
    }


def _cause_answer(name: str, value: float | None, sigma: float | None = None) -> str:
    if value is None:
        return numbers.NOTHING
    factor = name_of(name).factor
    if sigma is None:
        return numbers.plain(factor * value, 5)
    best, half = numbers.measured(factor * value, 2.0 * factor * sigma)
    return f"{best} ± {half}"


_TEMPLATE = "identification.html"
_TESTED = ("specimen", "specimen_length", "interface", "declared_interface", "support", "window_s")
_TABLES = ("checks", "inputs", "settings", "versions")
_SHOWN = (*_TESTED, *_TABLES, "recordings")
"""Entries of provenance with a separate table. All others are listed under "Further"."""


def render(
    identification: Identification, recordings: ShotRecordings | None = None, *, processes: int = 1
) -> str:
    """Return the report as HTML text; see `write_report`."""
    result = in_display_units(identification)
    provenance = result.provenance
    figures = _figures(identification, recordings, processes)
    return render_page(
        _TEMPLATE,
        kind="Identification from one impact test",
        heading=result.shot,
        subject="identification",
        result=result,
        figures=figures,
        script=script("folds.js"),
        answers=[answer_row(e) | {"dominant": dominant(result, e)} for e in result.estimates.values()],
        next=summary(identification)["next"],
        facts=_data_facts(result),
        fit=fit_tables(result),
        fixed=_fixed_rows(result),
        check=check_run_rows(result),
        U={name: 2.0 * estimate.sigma for name, estimate in result.estimates.items()},
        quality=_quality_rows(result),
        tables=likelihood_tables(result),
        changes=changes(result),
        causes=cause_table(identification),
        choices=choices(result),
        recordings=_flattened({"recordings": provenance.get("recordings", {})}),
        recorded=recordings,
        tested=_flattened({key: provenance[key] for key in _TESTED if key in provenance}),
        **{name: _flattened(provenance.get(name, {})) for name in _TABLES},
        further=_flattened({k: v for k, v in provenance.items() if k not in _SHOWN}),
        lost=len(result.design.lost),
        failures=_failure_rows(result),
        seconds=[
            (nomenclature.STAGES.get(stage, stage), f"{numbers.plain(value, 3)} s")
            for stage, value in (*result.seconds.items(), ("all stages", sum(result.seconds.values())))
        ],
    )


def write_report(
    path: Path,
    identification: Identification,
    recordings: ShotRecordings | None = None,
    *,
    processes: int = 1,
) -> None:
    """Write the report of one shot as a single HTML file that needs no network.

    Parameters
    ----------
    path, identification
        The file, replaced atomically (OSError if it cannot be written); its folder must exist. The result.
    recordings
        Those of the shot's files; without them, their sections are left out.
    processes
        Number of processes that draw the figures.
    """
    text = render(identification, recordings, processes=processes)
    with replacing(path) as partial:
        partial.write_text(text, encoding="utf-8")


def _figures(
    identification: Identification, recordings: ShotRecordings | None, processes: int
) -> dict[str, dict[str, Any]]:
    """Draw all figures, those of the recordings last, and return them by name for the template."""
    groups: list[FigureGroup] = [(REGISTRY.values(), identification)]
    if recordings is not None:
        groups.append((RECORDINGS.values(), recordings))
    drawn = draw_groups(groups, processes=processes)
    return {figure["id"].replace("-", "_"): figure for figure in drawn}


def render_joint(result: JointResult) -> str:
    """Return the page as HTML text."""
    return render_page(
        "joint.html",
        kind="Several impact tests of one material, identified together",
        heading=f"{len(result.shots)} shots",
        subject="joint identification",
        warnings=sentences(result.warnings),
        figures=draw_figures(result),
        facts=_facts(result),
        parameters=[parameter_row(result, name) for name in result.estimates],
        fits=_fits(result),
        shots=[_shot(result, k) for k in range(len(result.shots))],
    )


def _facts(result: JointResult) -> list[tuple[str, str]]:
    rows = [("verdict", result.verdict)]
    if result.agreement is not None:
        rows.append(("agreement of the shots", result.agreement.sentence))
    if result.causes:
        rows.append(("cause of the misfit", cause_sentence(result.causes)))
    reference = reference_words((*result.estimates, *result.fixed))
    if reference:
        rows.append(("what m refers to", reference))
    if result.scatter is not None:
        low, high = map(numbers.percent, result.scatter.interval)
        scatter = f"{numbers.percent(result.scatter.value)}, 95 % interval {low} to {high}"
        rows.append(("scatter of the stiffness between shots", scatter))
    if result.choice is not None:
        rows.append(("with and without relaxation", result.choice.sentence))
    rows += [
        (f"slow test {name}: mean squared residual over noise", numbers.plain(value, 3))
        for name, value in result.slow.items()
    ]
    rows.append(("mesh of the answer", "{} × {}".format(*result.refined_mesh)))
    return [*rows, ("simulations", str(result.runs))]


def joint_rows(result: JointResult) -> dict[str, str]:
    """Names and values of a joint answer for a terminal: the facts, and a line for each shot and channel."""
    facts = {name: numbers.plain_sentence(text) for name, text in _facts(result)}
    shots = numbers.row_lines(_shot(result, k) for k in range(len(result.shots)))
    return facts | shots | numbers.row_lines(_fits(result), 2)


def parameter_row(result: JointResult, name: str) -> dict[str, Any]:
    """A row of the table of shared parameters."""
    e, entry = result.estimates[name], name_of(name)
    factor = entry.factor
    value, half = numbers.measured(factor * e.value, factor * result.expanded[name])
    if e.outcome is Verdict.NOT_SEEN:
        low, high = (factor * end for end in interval(e, result.expanded[name]))
        value, half = f"{numbers.plain(low, 2)} to {numbers.plain(high, 2)}", numbers.NOTHING
    return {
        "Parameter": upper_first(entry.words),
        "Symbol": Markup("<i>{}</i>").format(entry.symbol),
        "Value": value,
        "U": half,
        "Unit": shown_unit(entry.unit),
        "u": numbers.plain(factor * e.sigma, 2),
        "u of the mesh": numbers.plain(factor * e.sigma_numerical, 2),
        "Verdict": e.outcome.value,
    }


def _shot(result: JointResult, k: int) -> dict[str, str]:
    part = result.shots[k]
    return {
        "Shot": part.name,
        Markup("<i>m</i>"): numbers.plain(part.factor, 4),
        "u without shared errors": numbers.plain(part.sigma_factor, 2),
        "Gain": numbers.percent(part.gain),
        "Force late by (µs)": numbers.plain(1e6 * part.clock, 2),
        "χ² per force bin": numbers.plain(part.chi2_force, 3),
        "χ² per outline point": numbers.plain(part.chi2_outline, 3),
        "Stiffness of this shot alone, from the shared": ""
        if part.own is None
        else numbers.percent(part.own.value),
    }


def _fits(result: JointResult) -> list[dict[str, str]]:
    """One row per channel of a shot and per slow test."""
    return [
        {
            "Of": name,
            "Channel": fit.channel,
            "Whole": numbers.plain(fit.excess, 2),
            "Slow": numbers.plain(fit.slow_excess, 2),
            "At most": f"{numbers.plain(fit.limit, 2)}, {numbers.plain(fit.slow_limit, 2)}",
            "Verdict": "explained" if fit.explained else "not explained",
        }
        for name, fit in fits_of(result)
    ]
