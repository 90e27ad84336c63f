"""Page and figure of an error budget."""

import re
from pathlib import Path

import numpy as np

from kolsky.report.pages.studies import render_budget
from kolsky.report.result_folder import write_budget_results
from kolsky.studies.budget.realisation import Factor
from kolsky.studies.budget.records import Budget, Source, plan_campaign


def planned_page() -> str:
    """Text of the page of a budget and a campaign."""
    sources = (
        Source(Factor("noise", 1.0), np.nan, 0.002, np.nan, ()),
        Source(Factor("imperfections.length", 0.005), 0.001, 0.01, 2.0, ()),
        Source(Factor("imperfections.curve", 0.01), np.nan, np.nan, np.nan, ("it was refused",)),
    )
    spread = 1.0 + 0.1 * np.array([-1.0, 1.0, -2.0, 2.0, 0.5, -0.5])
    made = Budget("a test", "stiffness_factor", 1.0, 1.01, sources, spread, ("no answer",))
    return render_budget([made], plan_campaign(100.0, 1000.0, 0.05, 0.04))


def test_page_says_what_does_not_add_up_and_what_is_not_known() -> None:
    text = planned_page()
    assert "do not give the uncertainty with all sources at once" in text
    assert "No uncertainty is known of scale of the quasi-static curve" in text
    assert "1 of 7 tests with all errors at once gave no answer" in text
    assert "it was refused" in text
    assert "Planned campaign" in text
    assert text.count("<svg") == 1


def test_every_parameter_has_its_own_table_and_figure(tmp_path: Path) -> None:
    sources = (Source(Factor("imperfections.length", 0.005), 0.001, 0.01, 2.0, ()),)
    made = [
        Budget("a test", name, 1.0, 1.01, sources, np.array([0.9, 1.0, 1.1]), ())
        for name in ("stiffness_factor", "damping")
    ]
    write_budget_results(tmp_path, made, None, formats=("csv",))
    for place in (tmp_path, tmp_path / "figures"):
        found = sorted(path.name for path in place.glob("*.csv"))
        assert found == ["budget-damping.csv", "budget.csv"]
    page = (tmp_path / "budget.html").read_text("utf-8")
    assert page.count("<svg") == 2
    ids = re.findall(r'\bid="([^"]+)"', page)
    assert len(set(ids)) == len(ids)
    assert set(re.findall(r'aria-labelledby="([^"]+)"', page)) < set(ids)
