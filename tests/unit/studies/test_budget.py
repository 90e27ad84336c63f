"""The error budget: its rule, its design, its shares, and the plan of a campaign."""

from pathlib import Path

import numpy as np
import pytest
from kolsky_command import json_of
from scipy.stats import t as student

from doe.ledger import Run
from kolsky.inverse.settings import Settings
from kolsky.report.pages.studies import budget_rows, render_budget
from kolsky.studies.budget.budget import analysed
from kolsky.studies.budget.realisation import (
    NODES,
    NOISE,
    WEIGHTS,
    Estimate,
    Realisations,
    design,
    factors_of,
    phase,
    same_valley,
    shifted,
    slopes_of,
)
from kolsky.studies.budget.realisation import RealisationOutcome as Outcome
from kolsky.studies.budget.records import plan_campaign, shares_of_squares, shot_sigma, slope_half_width
from kolsky.virtual.schema import Specification

FACTORS = factors_of(
    {"imperfections.length": "0.5 %", "imperfections.sensitivity": "2 %", "material.damping": "4 us"}
)
LINEAR, CURVED = np.array([0.0, 3.0, -0.5, 0.0]), np.array([0.0, 0.0, 0.2, 0.0])
"""A made-up answer: 1 + sum_i (a_i z_i + b_i z_i^2) + noise of 0.1; the noise is factor 0, z in sigmas."""


def made_up(points: np.ndarray, *, lost: int | None = None, jumps: tuple[int, ...] = ()) -> list[Run]:
    """Runs of a made-up answer; `lost` is refused, the whole searches of `jumps` end 0.5 away."""
    rng = np.random.default_rng(4)
    noises = {number: 0.1 * rng.standard_normal() for number in range(1, 2000)} | {0: 0.0}
    runs = []
    for number, (*sizes, whole) in enumerate(points):
        z = np.array(sizes)
        draw, z[0] = int(z[0]), 0.0
        value = 1.0 + LINEAR @ z + CURVED @ z**2 + noises[draw]
        searched = value + 0.5 * (number in jumps) if whole else np.nan
        outcome = Outcome.OTHER_VALLEY if number in jumps else Outcome.SAME_VALLEY
        if number == 0:
            value, outcome = np.nan, Outcome.SEARCHED
        if number == lost:
            value, outcome = 99.0, Outcome.NOT_AT_REST
        why = "" if outcome.counted else "why"
        runs.append(Run(outcome.counted, outcome.value, np.array([value, searched]), why))
    return runs


def test_sizes_are_read_with_their_units() -> None:
    assert [(factor.key, factor.sigma) for factor in FACTORS] == [
        (NOISE, 1.0),
        ("imperfections.length", 0.005),
        ("imperfections.sensitivity", 0.02),
        ("material.damping", pytest.approx(4e-6)),
    ]
    assert [factor.shared for factor in FACTORS] == [False, False, True, False]
    for key, size in {
        "imperfections.length": "5 mm",
        "imperfections.tall": 1.0,
        "scope.format": "csv",
    }.items():
        with pytest.raises(ValueError, match=key):
            factors_of({key: size})


def test_errors_are_added_to_the_specification() -> None:
    q = shifted(Specification(), {"material.damping": -5e-6, "imperfections.length": 0.01})
    assert q.material.damping == pytest.approx(20e-6)
    assert q.imperfections.length == 0.01
    assert q.material.poisson == Specification().material.poisson


def test_rule_has_the_moments_of_a_normal_variable() -> None:
    """E 1, z, z^2, z^3, z^4 = 1, 0, 1, 0, 3."""
    assert [float(WEIGHTS @ NODES**k) for k in range(5)] == pytest.approx([1, 0, 1, 0, 3], abs=1e-14)


def test_each_source_alone() -> None:
    """Of a z + b z^2 the mean is b, the variance a^2 + 2 b^2, the slope a / sigma; noise is its scatter."""
    points = design(FACTORS, draws=400, together=2000 - 401, seed=1)
    found = analysed("made up", "m", 1.0, FACTORS, made_up(points), 0, 400)
    noise, length, sensitivity, damping = found.sources
    assert length.u == pytest.approx(3.0, rel=1e-12)
    assert length.slope == pytest.approx(3.0 / 0.005, rel=1e-12)
    assert sensitivity.bias == pytest.approx(0.2, rel=1e-12)
    assert sensitivity.u == pytest.approx(np.sqrt(0.5**2 + 2 * 0.2**2), rel=1e-12)
    assert damping.u == pytest.approx(0.0, abs=1e-12)
    assert noise.u == pytest.approx(0.1, rel=0.15)  # of 400 draws: 3.5 %, four of these
    total = np.sqrt(3.0**2 + 0.5**2 + 2 * 0.2**2 + 0.1**2)
    assert found.u_sum == pytest.approx(total, rel=1e-3)
    assert found.u_together == pytest.approx(total, rel=0.07)  # of 1599 draws: 1.8 %
    assert found.share(length) == pytest.approx(9.0 / total**2, rel=1e-3)
    low, high = found.u_together_interval
    assert high / low == pytest.approx(1.0 + 2 * 1.96 / np.sqrt(2 * 1598), rel=0.01)
    assert found.adds_up


def test_all_at_once_that_does_not_add_up_is_said() -> None:
    points = design(FACTORS, draws=8, together=40, seed=1)
    runs = made_up(points)
    for run in runs[-40:]:
        run.results[:] *= 3.0
    assert analysed("made up", "m", 1.0, FACTORS, runs, 0, 8).adds_up is False
    none = analysed("made up", "m", 1.0, FACTORS, runs[:-40], 0, 8)
    assert none.adds_up is None


def test_a_test_that_gave_no_answer_leaves_its_source_unknown() -> None:
    points = design(FACTORS, draws=8, together=0, seed=1)
    found = analysed("made up", "m", 1.0, FACTORS, made_up(points, lost=4), 0, 8)
    assert np.isnan(found.sources[2].u)
    assert found.sources[2].refused == ("not at rest: why",)
    assert found.sources[1].u == pytest.approx(3.0)
    assert shot_sigma(found, 0.0) > 3.0  # the sensitivity is common to all shots


@pytest.mark.parametrize("truth", [1.0, float("nan")])
def test_a_number_that_is_not_known_is_never_printed_as_nan(truth: float) -> None:
    points = design(FACTORS, draws=8, together=0, seed=1)
    found = analysed("made up", "stiffness_factor", truth, FACTORS, made_up(points, lost=4), 0, 8)
    lines = budget_rows(found)
    assert "nan" not in " ".join(f"{key} {value}" for key, value in lines.items()).lower()
    assert lines["U (k = 2), all at once, 0 draws"].startswith("not known: 0 answers")
    page = render_budget([found], None)
    assert ">nan<" not in page


def test_jumps_are_counted_and_in_no_spread() -> None:
    """Two draws whose whole search ends 0.5 away: named, and the spread is that of the re-fits."""
    points = design(FACTORS, draws=8, together=40, seed=1)
    still = analysed("made up", "m", 1.0, FACTORS, made_up(points), 0, 8)
    jumped = analysed("made up", "m", 1.0, FACTORS, made_up(points, jumps=(20, 31)), 0, 8)
    assert jumped.u_together == still.u_together
    assert (len(jumped.elsewhere), jumped.searched) == (2, 40)
    assert jumped.elsewhere == pytest.approx(jumped.together[[4, 15]] + 0.5)
    assert jumped.counts["another valley"] == 2
    assert len(still.elsewhere) == 0
    assert still.closure == pytest.approx(0.0)
    lost = analysed("made up", "m", 1.0, FACTORS, made_up(points, lost=30), 0, 8)
    assert len(lost.together) == 39
    assert lost.refused == ("not at rest: why",)


def test_a_whole_search_is_in_the_valley_within_three_of_its_standard_deviations() -> None:
    near = Estimate({"m": 1.0, "nu": 0.499}, {"m": 9.0, "nu": 9.0}, Outcome.REFITTED)

    def whole(m: float, nu: float) -> Estimate:
        return Estimate(
            {"m": m, "nu": nu, "beta": 1.0}, {"m": 0.01, "nu": 1e-4, "beta": 0.0}, Outcome.SEARCHED
        )

    assert same_valley(near, whole(1.029, 0.499))
    assert not same_valley(near, whole(1.031, 0.499))
    assert not same_valley(near, whole(1.0, 0.49931))


def test_the_start_of_a_draw_is_where_its_sources_alone_move_the_answer(tmp_path: Path) -> None:
    """1 + 3 z1 - 0.5 z2 + 0 z3, whatever the noise's number; a lost node moves nothing."""
    points = design(FACTORS, draws=4, together=2, seed=1)
    slopes = slopes_of(FACTORS, made_up(points)[1:], 1)
    assert slopes[:, 0] == pytest.approx([0.0, 3.0, -0.5, 0.0], abs=1e-12)
    assert slopes_of(FACTORS, made_up(points, lost=3)[1:], 1)[1, 0] == 0.0
    settings = Settings(free={"stiffness_factor": None})
    made = Realisations(Specification(), tmp_path, FACTORS, settings, {"stiffness_factor": 1.0}, slopes)
    start = made._start(np.array([7.0, 0.1, -2.0, 1.0]))
    assert start == {"stiffness_factor": pytest.approx(1.0 + 0.3 + 1.0)}


def test_the_phase_of_the_ringing_is_that_of_the_bulk_modulus() -> None:
    """K of nearly incompressible rubber is proportional to m / (1 - 2 nu)."""
    one, other = {"stiffness_factor": 1.1, "poisson": 0.49}, {"stiffness_factor": 1.0, "poisson": 0.48}
    assert phase(one) - phase(other) == pytest.approx(np.log(2.2))
    assert phase({"stiffness_factor": 2.0, "damping": 1e-5}) == pytest.approx(np.log(2.0))


def test_interval_of_a_share_from_the_draws_of_the_noise() -> None:
    """One other source of the noise's size: share = 1 / (1 + s^2), to first order sigma(s^2) / 4."""
    values = np.random.default_rng(6).standard_normal(500)
    values *= 1.0 / values.std(ddof=1)
    found = shares_of_squares(np.array([1.0, 1.0, np.nan]), 0, values)
    kurtosis = float(((values - values.mean()) ** 4).mean())
    sigma = np.sqrt((kurtosis - 1.0) / 500) / 4
    assert found[0, 1] - found[0, 0] == pytest.approx(2 * 1.96 * sigma, rel=0.1)
    assert found[1] == pytest.approx(1.0 - found[0, ::-1])
    assert np.isnan(found[2]).all()


def test_design_keeps_sources_apart() -> None:
    points = design(FACTORS, draws=5, together=6, seed=1)
    assert points.shape == (2 + 2 * 3 + 5 + 6, 5)
    assert points[0].tolist() == [0, 0, 0, 0, 1]
    assert not points[1].any()
    alone = points[2:8]
    assert (np.count_nonzero(alone, axis=1) == 1).all()
    assert points[8:13, 0].tolist() == [1, 2, 3, 4, 5]
    assert not points[8:13, 1:].any()
    assert points[13:, 0].tolist() == [6, 7, 8, 9, 10, 11]
    assert points[13:, 4].tolist() == [1] * 6  # and these are searched whole
    # A Latin hypercube has one value in each sixth of the probability.
    from scipy.stats import norm

    sixths = np.sort(np.floor(6 * norm.cdf(points[13:, 1:4])), axis=0)
    assert (sixths == np.arange(6)[:, None]).all()


def test_slope_of_a_campaign_by_the_covariance_of_least_squares() -> None:
    """The variance of a fitted slope is the corner of s^2 (A^T A)^-1."""
    rates = np.array([100.0, 150.0, 400.0, 900.0, 1000.0])
    A = np.column_stack([np.ones(5), np.log10(rates)])
    covariance = 0.03**2 * np.linalg.inv(A.T @ A)
    expected = student.ppf(0.975, 3) * np.sqrt(covariance[1, 1])
    assert slope_half_width(rates, 0.03) == pytest.approx(expected, rel=1e-12)
    assert slope_half_width(rates[:2], 0.03) == np.inf
    assert slope_half_width(np.full(5, 100.0), 0.03) == np.inf


def test_campaign_is_the_smallest_that_serves() -> None:
    """n shots at two ends D decades apart: u = 2 s / (D sqrt n) for even n."""
    found = plan_campaign(100.0, 1000.0, 0.05, 0.04)
    n = found.shots
    assert found.half_width <= 0.05
    fewer = np.concatenate([np.full((n - 1) // 2, 100.0), np.full(n - 1 - (n - 1) // 2, 1000.0)])
    assert slope_half_width(fewer, 0.04) > 0.05
    if n % 2 == 0:
        assert found.half_width == pytest.approx(student.ppf(0.975, n - 2) * 2 * 0.04 / np.sqrt(n), rel=1e-12)
    with pytest.raises(ValueError, match="do not reach"):
        plan_campaign(100.0, 110.0, 1e-4, 0.04)


@pytest.mark.slow
def test_the_command_says_sources_and_shares_as_one_object(tmp_path: Path) -> None:
    path = tmp_path / "SPEC.toml"
    path.write_text('format = 1\n[motion]\ncompression = "12 %"\n[truth]\nmesh = [8, 11]\n')
    words = [
        "budget", str(path), "--mesh", "6x8", "--refined-mesh", "8x11", "--draws", "4", "--together", "4",
    ]  # fmt: skip
    words += ["--size", "imperfections.length=0.5 %", "--free", "stiffness_factor", "--out", tmp_path / "out"]
    (answer,) = json_of(*words)["budgets"]
    sources = answer["sources"]
    assert {key: source["sigma"] for key, source in sources.items()} == {
        "noise": 1.0,
        "imperfections.length": 0.005,
    }
    assert sum(source["share"] for source in sources.values()) == pytest.approx(1.0, rel=1e-9)
