"""Page of an error budget."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from kolsky.report.figures import BUDGETS
from kolsky.report.pages.rendering import draw_figures, page_writer, render_page
from kolsky.results import numbers
from kolsky.results.nomenclature import name_of
from kolsky.studies.budget.records import Budget, Campaign


def render(results: Sequence[Budget], campaign: Campaign | None) -> str:
    """Return the page as HTML text; see `write_page`."""
    first = results[0]
    figures: list[dict[str, Any]] = []
    for result in results:
        figures += draw_figures(BUDGETS.values(), result, first=len(figures) + 1, mark=result.parameter)
    return render_page(
        "budget.html",
        kind="Error budget of one impact test",
        heading=first.name,
        subject="error budget",
        warnings=_warnings(first),
        figures=figures,
        budgets=[_table(result) for result in results],
        campaign=[] if campaign is None else _campaign(campaign),
    )


write_page = page_writer(render)


def _table(result: Budget) -> dict[str, Any]:
    known = name_of(result.parameter)
    total = result.u_together if np.isfinite(result.u_together) else result.u_sum
    scale = known.factor
    rows = [
        {
            "source": source.factor.words,
            "key": source.factor.key,
            "sigma": numbers.plain(source.factor.sigma) if source.factor.key != "noise" else numbers.NOTHING,
            "u": _part(scale * source.u, scale * total),
            "bias": _part(scale * source.bias, scale * total),
            "share": _share(result.share(source) if np.isfinite(source.u) else np.nan, source.share_interval),
            "joint": _share(source.joint_share, source.joint_interval),
            "common": "yes" if source.factor.shared else "no",
            "refused": "; ".join(source.refused),
        }
        for source in sorted(result.sources, key=lambda source: -np.nan_to_num(source.u))
    ]
    low, high = result.u_together_interval
    facts = [
        ("true value", numbers.plain(scale * result.truth)),
        ("estimate without errors", numbers.plain(scale * result.reference)),
        ("U (k = 2), sources added in quadrature", numbers.plain(2.0 * scale * result.u_sum, 3)),
        (
            f"U (k = 2), all at once, {len(result.together)} draws",
            f"{numbers.plain(2.0 * scale * result.u_together, 3)} "
            f"({numbers.plain(2.0 * scale * low, 3)} to {numbers.plain(2.0 * scale * high, 3)})",
        ),
    ]
    facts.append(("re-fit less whole search, without errors", _part(scale * result.closure, scale * total)))
    facts.append(("realisations", ", ".join(f"{n} {how}" for how, n in result.counts.items())))
    if result.searched:
        facts.append(
            ("ended in another valley", f"{len(result.elsewhere)} of {result.searched} whole searches")
        )
    if result.joint is not None:
        share = _share(result.joint.unexplained, result.joint.unexplained_interval)
        facts.append(("of all at once, no straight line explains", share))
    unit = "" if known.unit == "1" else f" ({known.unit})"
    return {"symbol": f"{known.symbol}{unit}", "facts": facts, "rows": rows}


def _share(value: float, interval: tuple[float, float]) -> str:
    """Return a share with its 95 % interval, where they are known."""
    if not np.isfinite(value):
        return numbers.NOTHING
    known = np.isfinite(interval).all()
    ends = f" ({numbers.percent(interval[0])} to {numbers.percent(interval[1])})" if known else ""
    return f"{numbers.percent(value)}{ends}"


def _part(value: float, u: float) -> str:
    """Return a contribution, rounded as the expanded uncertainty asks; a dash where it is not known."""
    return numbers.part(value, 2.0 * u) if np.isfinite(value) else numbers.NOTHING


def _warnings(result: Budget) -> list[str]:
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
