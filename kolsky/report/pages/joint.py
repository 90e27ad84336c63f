"""Page of several shots identified together."""

from typing import Any

from kolsky.inverse.joint_result import JointResult, interval
from kolsky.inverse.parameters import reference_words
from kolsky.inverse.result import Verdict
from kolsky.report.figures import JOINT
from kolsky.report.pages.rendering import draw_figures, page_writer, render_page, sentences
from kolsky.results import numbers
from kolsky.results.nomenclature import name_of


def render(found: JointResult) -> str:
    """Return the page as HTML text; see `write_page`."""
    return render_page(
        "joint.html",
        kind="Several impact tests of one material, identified together",
        heading=f"{len(found.shots)} shots",
        subject="joint identification",
        warnings=sentences(found.warnings),
        figures=draw_figures(JOINT.values(), found),
        facts=_facts(found),
        parameters=[_parameter(found, name) for name in found.estimates],
        shots=[_shot(found, k) for k in range(len(found.shots))],
    )


write_page = page_writer(render)


def _facts(found: JointResult) -> list[tuple[str, str]]:
    rows = []
    reference = reference_words((*found.estimates, *found.fixed))
    if reference:
        rows.append(("what m refers to", reference))
    if found.scatter is not None:
        low, high = found.scatter.interval
        rows.append(
            (
                "scatter of the stiffness between shots",
                f"{numbers.percent(found.scatter.value)}, 95 % interval {numbers.percent(low)} to "
                f"{numbers.percent(high)}",
            )
        )
    if found.choice is not None:
        rows.append(("with what relaxes, and without", found.choice.sentence))
    rows += [
        (f"slow test {name}: mean squared residual over noise", numbers.plain(value, 3))
        for name, value in found.slow.items()
    ]
    across, along = found.refined_mesh
    rows.append(("mesh of the answer", f"{across} × {along}"))
    rows.append(("simulations", str(found.runs)))
    return rows


def _parameter(found: JointResult, name: str) -> dict[str, Any]:
    e, known = found.estimates[name], name_of(name)
    factor = known.factor
    value, half = numbers.measured(factor * e.value, factor * found.expanded[name])
    if e.outcome is Verdict.NOT_SEEN:
        low, high = (factor * end for end in interval(e, found.expanded[name]))
        value, half = f"{numbers.plain(low, 2)} to {numbers.plain(high, 2)}", numbers.NOTHING
    return {
        "words": known.words,
        "symbol": known.symbol,
        "unit": "" if known.unit == "1" else known.unit,
        "value": value,
        "half": half,
        "sigma": numbers.plain(factor * e.sigma, 2),
        "numerical": numbers.plain(factor * e.sigma_numerical, 2),
        "verdict": e.outcome.value,
    }


def _shot(found: JointResult, k: int) -> dict[str, str]:
    part = found.shots[k]
    return {
        "name": part.name,
        "factor": numbers.plain(part.factor, 4),
        "own": numbers.plain(part.sigma_factor, 2),
        "gain": f"{numbers.percent(part.gain)}",
        "clock": f"{numbers.plain(1e6 * part.clock, 2)}",
        "force": numbers.plain(part.chi2_force, 3),
        "outline": numbers.plain(part.chi2_outline, 3),
    }
