"""Page of a planned measurement."""

from typing import Any

from kolsky.report.figures import PLANS
from kolsky.report.pages.rendering import draw_figures, page_writer, render_page, sentences
from kolsky.results import numbers
from kolsky.results.nomenclature import name_of
from kolsky.studies.planning.output import rows
from kolsky.studies.planning.plan import Plan


def render(plan: Plan) -> str:
    """Return the page as HTML text; see `write_page`."""
    unseen = [f"{part}: {found.unseen}" for part, found in plan.expected.items() if found.unseen]
    parts = {"all": "all data", "force": "force alone", "outline": "outline alone"}
    return render_page(
        "plan.html",
        kind="Planned measurement: what to expect",
        heading=plan.shot,
        subject="plan",
        warnings=sentences(unseen),
        parts=["others known", *(parts[part] for part in plan.expected if part != "all")],
        expected=[_row(plan, j) for j in range(len(plan.names))],
        figures=draw_figures(PLANS.values(), plan),
        choices=[(key, value) for key, value in rows(plan).items() if key != "shot"],
    )


write_page = page_writer(render)


def _row(plan: Plan, j: int) -> dict[str, Any]:
    """Expected value with its k = 2 interval, and half the widths in other cases."""
    name, whole = name_of(plan.names[j]), plan.expected["all"]
    double = 2.0 * name.factor
    value = name.factor * float(plan.information.sensitivity.point[j])
    others = [found.deviations[j] for part, found in plan.expected.items() if part != "all"]
    shown, U = numbers.measured(value, double * float(whole.deviations[j]))
    return {
        "name": name.symbol if name.unit == "1" else f"{name.symbol} ({name.unit})",
        "value": f"{shown} ± {U}",
        "widths": [numbers.plain(double * float(sigma), 2) for sigma in (whole.alone[j], *others)],
    }
