"""Goodness of fit and clocks in a terminal, on a page and in JSON."""

from dataclasses import asdict, replace
from math import nan
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from synthetic import synthetic

from kolsky.inverse.result import Declaration
from kolsky.pictures.specimen_length import RimAtRest, conditioned_length
from kolsky.report.canvas import build
from kolsky.report.figures import REGISTRY
from kolsky.report.pages.identification import render
from kolsky.results import printed
from kolsky.results.hdf5 import read_identification, write_identification
from kolsky.results.printed import (
    _NOT_RECORDED,
    NOT_TESTABLE,
    fit_line,
    fit_state,
    fit_tables,
    lag_state,
    printed_fit,
    why_beyond_noise,
)
from kolsky.results.tables import to_json

RESULT = synthetic(nodes=False)
FORCE, OUTLINE = RESULT.fit


def test_the_line_shows_what_is_nearer_its_limit() -> None:
    # The force: 1 of 2 and 0.75 of 2.5. The outline: 4.1 over the root of 17, and 1 over 1.1 of 2.5.
    assert fit_line(RESULT) == "fit: force explained (1 of at most 2), outline explained (0.99 of at most 2)"
    bad = replace(RESULT, fit=(replace(FORCE, slow_residual=0.4), OUTLINE))
    assert fit_line(bad).startswith("fit: force NOT EXPLAINED (10 of at most 2.5), ")
    open_ = replace(RESULT, fit=(replace(FORCE, limit=float("inf"), slow_limit=float("inf")),))
    assert fit_line(open_) == "fit: force explained (1, no limit)"


def test_the_band_of_a_figure_is_that_of_the_verdict() -> None:
    # Noise of 3 and 5 units with 5 and 12 of the rest: 13 in quadrature with 3 is root 178, with 5 root 194.
    fit = replace(FORCE, predicted={"noise": np.sqrt(17.0), "mesh": 5.0, "declared inputs": 12.0})
    noise = np.array([3.0, 5.0])  # its root mean square is that of `predicted`
    np.testing.assert_allclose(fit.spread(noise) ** 2, [178.0, 194.0])
    assert np.sqrt(np.mean(fit.spread(noise) ** 2)) == pytest.approx(fit.expected)
    c = replace(RESULT.comparison, force_sigma=noise)
    found = replace(RESULT, fit=(OUTLINE, fit), comparison=c)
    np.testing.assert_allclose(found.spread("force"), fit.spread(noise))
    others = np.sqrt(OUTLINE.expected**2 - OUTLINE.predicted["noise"] ** 2)
    np.testing.assert_allclose(found.spread("outline"), np.hypot(c.centre_line.sigma, others))
    np.testing.assert_array_equal(replace(found, fit=()).spread("force"), noise)
    for name in ("force", "outline"):
        caption = REGISTRY[name].caption(RESULT)
        assert (
            "The band is the residual expected of a correct model, k = 2: the noise of each value with"
            in caption
        )
        assert "noise alone" in REGISTRY[name].caption(replace(RESULT, fit=()))
    band = build(REGISTRY["force"], RESULT).axes[1].collections[0].get_paths()[0].vertices
    assert band[:, 1].max() == pytest.approx(2.0 * RESULT.spread("force").max())


def test_rows_of_a_terminal() -> None:
    rows = printed_fit(RESULT, {"stiffness_factor": "m"})
    assert rows["force, residual"] == "0.2 N rms, 1.7 x noise, 0.29 % of peak"
    assert rows["force, chi2/n"] == "2.78, tau 64 % of the variance"
    assert rows["force, over expected"] == "1, at most 2"
    assert rows["outline, residual"].startswith("4.1 um rms")
    assert rows["outline, information"] == "30 % of m"
    assert rows["force, detectable"] == "a residual above 0.4 N rms"
    late = rows["force, late by"]
    assert late == "-0.20 ± 1.00 us: on time, detects 1.5 us"


def test_tables_of_a_page() -> None:
    shown = fit_tables(RESULT)
    assert [c["explained"] for c in shown["channels"]] == [True, True]
    assert shown["channels"][0]["predicted"] == "noise 0.12 N, flyer motion 0.16 N"
    assert shown["channels"][0]["weight"] == ["70 %"]
    assert all(state.startswith("on time; a lag above ") for _, _, state in shown["clocks"])
    assert shown["clocks"][0][2].endswith(" 1.5 µs would be detected")  # three times 0.5 us
    late = replace(RESULT.clocks[0], lag=1.51e-6)  # sigma is 0.5 us
    assert fit_tables(replace(RESULT, clocks=(late,)))["clocks"][0][2].startswith("late; ")
    lost = replace(late, sigma=float("nan"))
    assert fit_tables(replace(RESULT, clocks=(lost,)))["clocks"][0][2] == "not found"


def with_moves(move: float) -> Any:
    """A lag of 1 us of the force moves the answer by so many of its standard uncertainties."""
    moved = {"stiffness_factor": move * RESULT.estimates["stiffness_factor"].sigma}
    part = Declaration("clock_offset", nan, "s", {}, "not declared", amount=1e-6, moves=moved)
    return replace(RESULT, systematic=(part,))


def test_a_clock_is_on_time_only_if_a_lag_that_matters_would_be_noticed() -> None:
    """k = 2 over 4 sigma a us is 0.5 us; the check notices 3 x 0.5 us, and in the other case 2 us matter."""
    force = RESULT.clocks[0]
    assert with_moves(4.0).lag_that_matters("force") == pytest.approx(0.5e-6, rel=1e-12)
    assert lag_state(with_moves(-4.0), force) == "not testable"
    assert lag_state(with_moves(1.0), force) == "on time"
    frame = np.median(np.diff(np.unique(RESULT.comparison.centre_line.time)))
    assert RESULT.lag_that_matters("outline") == pytest.approx(frame, rel=1e-12)
    vague = replace(RESULT.clocks[1], sigma=18e-6)  # 0 ± 36 us
    assert vague.noticed == pytest.approx(54e-6, rel=1e-12)
    assert lag_state(RESULT, vague) == "not testable"


def test_a_channel_is_explained_only_if_the_check_could_fail() -> None:
    """28 um of declared inputs beside 2 um: without them the check fails beyond 2 x 2 um."""
    vague = replace(OUTLINE, residual=4.4e-6, predicted={"noise": 2e-6, "declared inputs": 28e-6})
    assert vague.explained
    assert vague.noticed == pytest.approx(2.0 * np.hypot(2e-6, 28e-6), rel=1e-12)
    assert vague.noticed_without_declared == pytest.approx(4e-6, rel=1e-12)
    assert fit_state(vague) == NOT_TESTABLE
    # A residual that passes without what is declared is explained, and so is one where that is little.
    assert fit_state(replace(vague, residual=3.9e-6)) == "explained"
    assert fit_state(replace(vague, predicted={"noise": 2e-6, "declared inputs": 3e-6})) == "explained"
    assert fit_state(replace(vague, residual=57e-6)) == "NOT EXPLAINED"


def test_a_residual_far_above_the_noise_is_accounted_for() -> None:
    """chi2/n = 48: the noise is 1 um, the mesh leaves 7 um."""
    parts = {"noise": 1e-6, "flyer motion": 2e-6, "mesh": 7e-6}
    meshed = replace(OUTLINE, residual=6.9e-6, predicted=parts, chi2=48.0)
    assert why_beyond_noise(meshed) == (
        "The outline's residual is 6.9 times its noise, as expected (mesh: 7 µm, noise: 1 µm). The band of "
        "the figure includes all sources."
    )
    assert why_beyond_noise(OUTLINE) == ""
    assert why_beyond_noise(replace(meshed, residual=70e-6)) == ""


def test_a_file_without_them_says_so() -> None:
    old = replace(RESULT, fit=(), clocks=())
    assert fit_line(old) == f"fit: {_NOT_RECORDED}"
    assert printed_fit(old, {}) == {"goodness of fit": _NOT_RECORDED}
    assert (to_json(old)["fit"], to_json(old)["clocks"]) == (None, None)


def test_json_has_the_ratios() -> None:
    said = to_json(RESULT)
    assert said["fit"]["force"]["excess"] == pytest.approx(1.0, rel=1e-12)
    assert said["fit"]["force"]["explained"] is True
    assert said["fit"]["outline"]["weight"] == {"stiffness_factor": 0.3}
    assert said["clocks"]["force"]["significance"] == pytest.approx(0.4, rel=1e-12)


LENGTH = conditioned_length(RimAtRest(8e-6, 6e-6), declared=6e-3, sigma=8e-6, y_sigma=0.0)


def test_it_is_said_everywhere_and_survives_the_file(tmp_path: Path) -> None:
    plain = synthetic()
    assert "specimen's length" not in printed.details(plain)
    found = replace(plain, provenance={**plain.provenance, "specimen_length": asdict(LENGTH)})
    write_identification(tmp_path / "identification.h5", found)
    again = read_identification(tmp_path / "identification.h5")
    assert printed.details(again)["specimen's length"] == (
        "declared 6.0000 mm ± 16.0 um, in the pictures 6.0080 mm ± 12.0 um, used 6.0051 mm ± 9.6 um (k = 2)"
    )
    said = to_json(again)["provenance"]["specimen_length"]
    assert (said["declared"], said["pictures"], said["used"]) == (6e-3, LENGTH.pictures, LENGTH.used)
    page = render(again)
    for words, value in (("length, declared", "6 mm"), ("length in the pictures", "6.008 mm")):
        assert words in page
        assert value in page
