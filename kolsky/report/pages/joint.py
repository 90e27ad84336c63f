"""Page of several shots identified together."""

from typing import Any

from kolsky.diagnosis.joint_fit import cause_sentence
from kolsky.inverse.joint_result import JointResult, interval
from kolsky.inverse.parameters import reference_words
from kolsky.inverse.result import Verdict
from kolsky.report.figures import JOINT
from kolsky.report.pages.rendering import draw_figures, page_writer, render_page, sentences
from kolsky.results import numbers
from kolsky.results.nomenclature import name_of


def render(result: JointResult) -> str:
    """Return the page as HTML text; see `write_page`."""
    return render_page(
        "joint.html",
        kind="Several impact tests of one material, identified together",
        heading=f"{len(result.shots)} shots",
        subject="joint identification",
        warnings=sentences(result.warnings),
        figures=draw_figures(JOINT.values(), result),
        facts=_facts(result),
        parameters=[_parameter(result, name) for name in result.estimates],
        fits=_fits(result),
        shots=[_shot(result, k) for k in range(len(result.shots))],
    )


write_page = page_writer(render)


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
        low, high = result.scatter.interval
        rows.append(
            (
                "scatter of the stiffness between shots",
                f"{numbers.percent(result.scatter.value)}, 95 % interval {numbers.percent(low)} to "
                f"{numbers.percent(high)}",
            )
        )
    if result.choice is not None:
        rows.append(("with what relaxes, and without", result.choice.sentence))
    rows += [
        (f"slow test {name}: mean squared residual over noise", numbers.plain(value, 3))
        for name, value in result.slow.items()
    ]
    across, along = result.refined_mesh
    rows.append(("mesh of the answer", f"{across} × {along}"))
    rows.append(("simulations", str(result.runs)))
    return rows


def _parameter(result: JointResult, name: str) -> dict[str, Any]:
    e, entry = result.estimates[name], name_of(name)
    factor = entry.factor
    value, half = numbers.measured(factor * e.value, factor * result.expanded[name])
    if e.outcome is Verdict.NOT_SEEN:
        low, high = (factor * end for end in interval(e, result.expanded[name]))
        value, half = f"{numbers.plain(low, 2)} to {numbers.plain(high, 2)}", numbers.NOTHING
    return {
        "words": entry.words,
        "symbol": entry.symbol,
        "unit": "" if entry.unit == "1" else entry.unit,
        "value": value,
        "half": half,
        "sigma": numbers.plain(factor * e.sigma, 2),
        "numerical": numbers.plain(factor * e.sigma_numerical, 2),
        "verdict": e.outcome.value,
    }


def _shot(result: JointResult, k: int) -> dict[str, str]:
    part = result.shots[k]
    return {
        "name": part.name,
        "factor": numbers.plain(part.factor, 4),
        "own": numbers.plain(part.sigma_factor, 2),
        "gain": f"{numbers.percent(part.gain)}",
        "clock": f"{numbers.plain(1e6 * part.clock, 2)}",
        "force": numbers.plain(part.chi2_force, 3),
        "outline": numbers.plain(part.chi2_outline, 3),
        "itself": "" if part.own is None else numbers.percent(part.own.value),
    }


def _fits(result: JointResult) -> list[dict[str, str]]:
    """A row a channel of a shot, and a slow test."""
    rows = [(shot.name, fit) for shot in result.shots for fit in shot.fit]
    rows += [("slow test", fit) for fit in result.slow_fit]
    return [
        {
            "name": name,
            "channel": fit.channel,
            "excess": numbers.plain(fit.excess, 2),
            "slow": numbers.plain(fit.slow_excess, 2),
            "limit": f"{numbers.plain(fit.limit, 2)}, {numbers.plain(fit.slow_limit, 2)}",
            "verdict": "explained" if fit.explained else "not explained",
        }
        for name, fit in rows
    ]
