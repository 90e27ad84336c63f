"""Tables of the identification page: answers with their budgets, data, runs, simulation at the optimum."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from explicit import Ending
from kolsky.base.apparatus import SLIDING_LAW
from kolsky.inverse.parameters import PARAMETERS, has_effect
from kolsky.inverse.relaxing import reference_words
from kolsky.inverse.result import Estimate, Identification, Verdict, worst_imbalance
from kolsky.report import nomenclature, numbers, recorded_words
from kolsky.report.nomenclature import name_of

_NUMERICS = {"mesh": "mesh and step", "roughness": "roughness of the response"}
"""Words for the keys of `Estimate.numerical_parts`."""

_VERDICTS = {
    Verdict.IDENTIFIED: "The optimum lies inside the design, and a simulation at it confirms the surrogate.",
    Verdict.FORCE_ALONE: "The optimum lies inside the design, and a simulation at it confirms the surrogate. "
    "No outline was measured, or by itself it tells the value too poorly to check the force.",
    Verdict.OUTLINE_ALONE: "The optimum lies inside the design, and a simulation at it confirms the "
    "surrogate. By itself the force tells the value too poorly to check the outline.",
    Verdict.UNEXPLAINED: "The residual is larger than noise, inputs and mesh leave where the model is right: "
    "do not use the value before the cause is found. The warnings name the channel.",
    Verdict.CONTRADICTED: "Force and outline ask for values that are further apart than their uncertainties "
    "allow: do not use the value before the cause is found.",
    Verdict.AT_BOUND: "The optimum lies on a bound of the design: the value is a limit, not an "
    "estimate. Widen the design and run again.",
    Verdict.BOUND_REACHED: "The interval reaches past a bound of the design: the data do not tell the value "
    "from that bound, and the interval's other end alone is a finding. Where a value beyond is possible, "
    "widen the design and run again; where none is (no friction is the least), hold the parameter there.",
    Verdict.OTHER_VALLEY: "At another value the force's ringing falls in step with the measured one nearly "
    "as well: the value may be whole oscillations off. Hold the parameter at an independent value, or "
    "declare its uncertainty.",
    Verdict.CONDITIONAL: "Another parameter lies on a bound of the design and this one compensates for it: "
    "the value and its interval hold only if that bound is right. Widen that bound, or hold that "
    "parameter at an independent value.",
    Verdict.NOT_SEEN: "The data hardly depend on this parameter: the interval tells which values are "
    "excluded, the value itself is not determined. Hold it fixed at an independent value.",
    Verdict.PLATEAU: "The simulated response jumps by so much that the misfit is flat, to within its jumps, "
    "over the width that the warnings name: values on it are not told apart. Refine both meshes, or hold "
    "another parameter.",
    Verdict.DISAGREEING: "The simulation at the optimum does not confirm the surrogate: do not use the "
    "value. Add runs near the optimum and search again.",
    Verdict.FAILED: "No simulation of the design completed, so there is no estimate. The design table "
    "names the cause of each run.",
}


def flattened(value: Any, prefix: str = "") -> list[tuple[str, str]]:
    """Return all of a nested provenance as rows (words, text), see `kolsky.report.recorded_words`."""
    if isinstance(value, Mapping):
        return [row for k, v in value.items() for row in flattened(v, f"{prefix}.{k}" if prefix else str(k))]
    if isinstance(value, list | tuple) and any(isinstance(item, Mapping | list | tuple) for item in value):
        return [row for i, item in enumerate(value) for row in flattened(item, f"{prefix}[{i}]")]
    factor, unit, between, nothing, digits = recorded_words.written(prefix)
    items = value if isinstance(value, list | tuple) else [value]
    text = between.join(nothing if item is None else _text(item, factor, digits) for item in items)
    text = text if len(items) else "none"
    return [(recorded_words.label(prefix), f"{text} {unit}" if unit and value is not None else text)]


def _text(value: Any, factor: float, digits: int) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return numbers.plain(factor * value, digits) if isinstance(value, float) else str(value)


def _ms(time: float) -> str:
    return f"{numbers.rounded(1e3 * float(time), -3)} ms"


def shown_unit(unit: str) -> str:
    """Return the unit as shown: nothing for "1"."""
    return "" if unit == "1" else unit


def answer(estimate: Estimate) -> dict[str, Any]:
    """Return one estimate in words and rounded numbers, with its uncertainty budget."""
    U = 2.0 * estimate.sigma
    value, uncertainty = numbers.measured(estimate.value, U)
    # A share of a zero or infinite variance is undefined.
    variance = estimate.sigma**2 if 0.0 < estimate.sigma < np.inf else np.nan
    budget = [
        (f"noise: {nomenclature.NOISE.get(name, name)}", part, "part")
        for name, part in estimate.noise_parts.items()
    ]
    budget.append(("noise, all sources", estimate.sigma_noise, "sum"))
    computed = estimate.numerical_parts if len(estimate.numerical_parts) > 1 else {}
    budget += [(f"numerics: {_NUMERICS.get(name, name)}", part, "part") for name, part in computed.items()]
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


def fixed(result: Identification) -> list[tuple[str, str, str]]:
    """Return words, symbol and value of every fixed parameter."""
    interface = result.provenance.get("interface")
    laws = set(interface.values()) if isinstance(interface, Mapping) else {SLIDING_LAW}
    rows = []
    for parameter, value in result.fixed.items():
        name = name_of(parameter)
        text = f"{numbers.plain(value)} {shown_unit(name.unit)}".rstrip()
        record = PARAMETERS.get(parameter)
        if record is not None and not has_effect(record, laws):
            text = f"not used: {record.without}"
        rows.append((name.words, name.symbol if name.symbol != name.words else "", text))
    reference = reference_words((*result.estimates, *result.fixed))
    if reference:
        rows.append(("what m refers to", "", reference))
    return rows


def facts(result: Identification) -> list[tuple[str, str]]:
    """Return window, size and noise of the data that were compared."""
    c, plain = result.comparison, numbers.plain
    line, rows = c.centre_line, []
    if c.force_time.size:
        window = f"{_ms(c.force_time[0])} to {_ms(c.force_time[-1])}"
        rows.append(("window of the force", f"{window}, {c.force_time.size} bins"))
        rows.append(("largest measured force", f"{plain(float(c.force_measured.max()), 3)} N"))
        rows.append(("noise of a bin, median", f"{plain(float(np.median(c.force_sigma)), 2)} N"))
    if line.time.size:
        frames = np.unique(line.frame).size
        window = f"{_ms(line.time.min())} to {_ms(line.time.max())}"
        rows.append(("window of the outline", f"{window}, {frames} frames, {line.time.size} points"))
        rows.append(("noise of a point, median", f"{plain(1e6 * float(np.median(line.sigma)), 2)} µm"))
        rows.append(("points outside the model’s range", f"{int((~c.inside).sum())}, not counted"))
    return rows


def check_run(result: Identification) -> list[tuple[str, str]]:
    """Return outcome, steps and energy imbalance of the simulation at the optimum."""
    r, plain = result.response, numbers.plain
    outcome = r.outcomes[0]
    where = _ended(r.ending(0))
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


def quality(result: Identification) -> list[tuple[str, str]]:
    """Return errors of the surrogate and the model discrepancies used as weights, in N and µm."""
    rows = []
    for key, value in result.surrogate.items():
        words, factor, unit = recorded_words.QUALITY.get(key, (key, 1.0, ""))
        rows.append((words, f"{numbers.plain(factor * value, 2 if unit else 6)}{unit}"))
    return rows


def _ended(ending: Ending) -> str:
    """Return outcome, time and place of a run's end, short enough for a cell of a table."""
    name = ending.outcome.name.lower().replace("_", " ")
    if ending.outcome.ok:
        return name
    r, y = (numbers.rounded(1e3 * x, -2) for x in ending.place)
    return f"{name} at {_ms(ending.time)}, element {ending.element} at ({r}, {y}) mm"


def failures(result: Identification) -> list[tuple[str, str]]:
    """Return the kinds of failure among the runs, with cause and cure."""
    kinds = {result.design.ending(run).outcome for run in result.design.lost}
    return [
        (kind.name.lower().replace("_", " "), f"{kind.cause}; the element has {kind.role}. Cure: {kind.cure}")
        for kind in sorted(kinds)
    ]


def runs(result: Identification) -> list[dict[str, Any]]:
    """Return the rows of the table of runs."""
    design = result.design
    U = {name: 2.0 * estimate.sigma for name, estimate in result.estimates.items()}
    return [
        {
            "number": number,
            "stage": design.stage[number],
            "point": [
                numbers.like(value, U.get(name, np.nan))
                for name, value in zip(design.names, design.points[number], strict=True)
            ],
            "outcome": _ended(design.ending(number)),
            "completed": design.outcomes[number] == "COMPLETED",
            "terms": [
                numbers.rounded(design.phi_force[number], -1),
                numbers.rounded(1e3 * design.phi_shape[number], -3),
                numbers.rounded(design.chi2_force[number], 0),
                numbers.rounded(design.chi2_shape[number], 0),
            ],
        }
        for number in range(len(design.outcomes))
    ]
