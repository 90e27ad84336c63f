"""Means and slopes over shots: common errors, random effects, published numbers."""

from dataclasses import replace

import numpy as np
import pytest
from ratedshots import rated
from scipy.stats import binom, linregress, norm
from scipy.stats import t as student

from kolsky.studies.rates.comparison import compare, slope_parts
from kolsky.studies.rates.records import MESH_PART, RatedShot
from kolsky.studies.rates.scatter import MixedFit, SlopeVerdict, mixed_fit, pool, slope
from populations.coverage_problem import drawn
from populations.rate_sets import Answers, counts, read_answers, set_of, slope_of

# Common errors of shots do not average out of their mean; independent errors do.

M = "stiffness_factor"


def shot(number: int, *, shift: float, roughness: float = 0.0) -> RatedShot:
    """A shot whose mesh was corrected, with 0.003 of its own and 0.002 of mesh and element left."""
    one = rated(f"shot-{number}", 1.12, 100.0 * (1 + number), own=0.003)
    estimate = replace(
        one.found.estimates[M],
        noise_parts={"force and shape": 0.003},
        numerical_parts={"mesh": 0.002, "roughness": roughness},
        sigma_numerical=float(np.hypot(0.002, roughness)),
        mesh_shift=shift,
    )
    return replace(one, found=replace(one.found, estimates={M: estimate}))


def test_the_mesh_does_not_average_whichever_way_each_was_corrected() -> None:
    shots = [shot(i, shift=0.005 * (-1.0) ** i) for i in range(4)]
    pooled = compare(shots).groups[0].pooled
    assert pooled.sigma_common == pytest.approx(0.002, rel=1e-12)
    # Four alike, of 0.003 each: their scatter is zero, and the mean has half of it beside the mesh.
    assert pooled.sigma == pytest.approx(np.hypot(0.003 / 2.0, 0.002), rel=1e-9)


def test_roughness_is_each_shots_own() -> None:
    assert shot(0, shift=-0.005, roughness=0.004).sigma_own == pytest.approx(0.005)  # 3, 4, 5
    pooled = compare([shot(i, shift=-0.005, roughness=0.004) for i in range(4)]).groups[0].pooled
    assert pooled.sigma == pytest.approx(np.hypot(0.005 / 2.0, 0.002), rel=1e-9)


RATES = np.array([107.0, 123.0, 215.0, 400.0, 690.0])
"""Flyers of 0.7 to 4.5 m/s."""
X = np.log10(RATES) - np.log10(RATES).mean()
SIZE = float(np.sqrt(np.mean(X**2)))
ALIKE = np.ones(5)


def line(m: np.ndarray, own: float, parts: dict[tuple[str, str], np.ndarray]) -> MixedFit:
    columns = np.column_stack([np.ones(5), X])
    return mixed_fit(m, own * ALIKE, columns, common=slope_parts(parts, RATES))


def test_what_all_have_cancels_in_a_slope_and_half_of_the_mesh_does_not() -> None:
    curve = line(1.12 * ALIKE, 0.003, {("material curve", "a"): 0.05 * ALIKE})
    # Standard uncertainty of a slope: own over root n times the rms of the abscissas.
    own = 0.003 / (np.sqrt(5.0) * SIZE)
    assert curve.sigma(1) == pytest.approx(own, rel=1e-9)
    mesh = line(1.12 * ALIKE, 0.003, {(MESH_PART, "a"): 0.004 * ALIKE})
    # The trend of the mesh's error has the rms sqrt(1/2) 0.004: more shots do not average it.
    assert mesh.sigma(1) == pytest.approx(np.hypot(own, np.sqrt(0.5) * 0.004 / SIZE), rel=1e-9)
    assert mesh.sigma(0) == pytest.approx(np.hypot(0.003 / np.sqrt(5.0), np.sqrt(0.5) * 0.004), rel=1e-9)


def test_the_comparison_gives_the_mesh_to_the_slope_as_a_trend() -> None:
    shots = [shot(i, shift=0.005) for i in range(4)]
    fitted = compare(shots).groups[0].slope
    assert fitted is not None
    assert fitted.fit is not None
    x = np.log10([one.history.nominal_rate for one in shots])
    assert fitted.fit.common[1, 1] == pytest.approx(0.5 * 0.002**2 / x.var(), rel=1e-9)


def test_a_group_names_what_its_shots_have_in_common() -> None:
    shots = [shot(i, shift=0.005) for i in range(4)]
    group = compare(shots, shared=0.01).groups[0]
    # 0.002 of 1.12 by the mesh; the declared share itself.
    assert group.in_common == ("mesh and step 0.18 % (all shots)", "declared 1 % (all shots)")
    assert group.own_range == pytest.approx((0.003 / 1.12, 0.003 / 1.12))
    other = replace(shots[0], conditions={**shots[0].conditions, "mesh": "64 x 86"})
    two = compare([other, *shots[1:]]).groups[0]
    assert two.in_common == ("mesh and step 0.18 % (3 shots)",)


def test_the_power_is_that_of_noncentral_t() -> None:
    # Nearly all of the variance is known: u (z_0.975 + z_0.9), two quantiles of the normal distribution.
    many = line(1.12 * ALIKE, 1e-5, {(MESH_PART, "a"): 0.004 * ALIKE})
    assert many.noticeable(1) == pytest.approx((norm.ppf(0.975) + norm.ppf(0.9)) * many.sigma(1), rel=1e-3)
    # Three degrees of freedom: drawn t = (z + delta) / sqrt(chi2 / 3) leaves the limit in 90 % of 40 000.
    few = line(1.12 * ALIKE, 0.003, {})
    assert few.effective_freedom(1) == 3.0
    rng = np.random.default_rng(7)
    drawn = rng.standard_normal(40000) + few.noticeable(1) / few.sigma(1)
    ratio = drawn / np.sqrt(rng.chisquare(3.0, 40000) / 3.0)
    # 3.182 is Student's t at 0.975; five standard deviations of a share of 0.9 in 40 000 draws.
    assert np.mean(np.abs(ratio) > 3.182) == pytest.approx(0.9, abs=5.0 * np.sqrt(0.09 / 40000))


SETS = 200
ALLOWED = int(binom.ppf(0.975, SETS, 0.05))
"""16: more false alarms of 200 come with a probability of 2.5 % where each has 5 %."""


@pytest.mark.parametrize(
    ("own", "between", "mesh"),
    [(0.003, 0.0, 0.0), (0.001, 0.01, 0.0), (0.003, 0.003, 0.003), (0.001, 0.001, 0.008)],
    ids=["agree", "scatter", "default mesh", "coarse mesh"],
)
def test_elastic_sets_are_seldom_called_rate_sensitive(own: float, between: float, mesh: float) -> None:
    rng = np.random.default_rng([11, int(1e4 * own), int(1e4 * between), int(1e4 * mesh)])
    alarms, sizes = 0, []
    for _ in range(SETS):
        common, trend = np.sqrt(0.5) * mesh * rng.standard_normal(2)
        m = 1.12 + common + trend * X / SIZE + np.hypot(own, between) * rng.standard_normal(5)
        fit = line(m, own, {(MESH_PART, "a"): mesh * ALIKE, ("force scale", "rig"): 0.02 * ALIKE})
        low, high = fit.interval(1)
        alarms += not low <= 0.0 <= high
        sizes.append(fit.noticeable(1))
    print(f"{alarms} of {SETS} false alarms; would notice {np.median(sizes):.3g} per decade")
    assert alarms <= ALLOWED
    # A bound that grew to a tenth of the stiffness per decade would raise no alarm and tell nothing.
    assert np.median(sizes) < 0.14


def answers_of(values: np.ndarray, *, own: float, mesh: float) -> Answers:
    rates = np.geomspace(100.0, 1000.0, values.size)
    return Answers(rates, values, *(np.full(values.size, u) for u in (own, 0.0, mesh)))


def test_sets_of_answers_count_alarms_and_planted_slopes() -> None:
    rng = np.random.default_rng(5)
    right = answers_of(1.12 + 0.003 * rng.standard_normal(60), own=0.003, mesh=0.003)
    said = counts(right, sets=100, seed=2)
    assert said["false alarms"] <= binom.ppf(0.999, 100, 0.05)
    assert said["planted slopes found"] > 0.85
    # Uncertainties of a tenth of what the shots scatter by with the rate: nearly every set is an alarm.
    steep = answers_of(1.12 + 0.2 * np.linspace(-0.5, 0.5, 60), own=0.003, mesh=0.0)
    assert counts(steep, sets=20, seed=2)["share"] > 0.9
    narrow = replace(right, rates=np.full(60, 300.0))
    with pytest.raises(ValueError, match=r"no 5 of 60 shots span 0\.5 decade"):
        set_of(narrow, rng)


def test_answers_are_divided_by_their_truth() -> None:
    one = {
        "number": 3,
        "outcome": "identified",
        "value": {M: 1.01},
        "truth": {M: 1.0},
        "parts": {M: {"force and shape": 0.003, "roughness": 0.004, "material curve": 0.02, "mesh": 0.01}},
    }
    lost = {**one, "outcome": "not explained by the model"}
    found = read_answers({"study": {"seed": 7}, "each": [one, lost]})
    assert found.values == pytest.approx([1.12 * 1.01])
    assert (found.own[0], found.curve[0], found.mesh[0]) == pytest.approx((1.12 * 5e-3, 0.0224, 0.0112))
    setup, truth = drawn(3, 7)
    # The flyer loses at most its drag's share on the way and is slower while it rises.
    assert 0.6 < found.rates[0] * setup.length / truth.speed < 1.0
    # One shot's own noise of its curve is in the slope's variance, and does not cancel.
    values = answers_of(1.12 * np.ones(5), own=0.003, mesh=0.0)
    flat, noisy = (
        slope_of(replace(values, curve=u * np.ones(5)), range(5)).fit.sigma(1)  # type: ignore[union-attr]
        for u in (0.0, 0.004)
    )
    assert noisy / flat == pytest.approx(5.0 / 3.0)  # 3, 4, 5


def test_the_verdict_in_words() -> None:
    spread, own = np.full(5, 0.05), np.full(5, 0.003)
    none = slope(RATES, spread, 1.12 + 0.003 * np.array([1.0, -1.0, 0.0, -1.0, 1.0]), own)
    assert none.verdict is SlopeVerdict.NONE_SEEN
    bound = max(abs(end) for end in none.fit.interval(1))
    assert none.sentence == (
        f"no rate sensitivity beyond ± {bound:.2g} per decade; a slope above "
        f"{none.fit.noticeable(1):.2g} per decade would be detected"
    )
    steep = slope(RATES, spread, 1.12 + 0.2 * X, own)
    assert steep.sentence.startswith("rate sensitive: +0.2 per decade, 95 % ")
    few = slope(RATES[:3], spread[:3], 1.12 * np.ones(3), own[:3])
    assert few.sentence.startswith("not testable: there are 3 shots, 4 needed")


# Random-effects means and meta-regression against published numbers, another program and closed forms.

# R. N. Kacker, "Combining information from interlaboratory evaluations using a random effects model",
# Metrologia 41 (2004) 132, Table 1: nine laboratories' means and variances.
KACKER = np.array([61.00, 61.40, 62.21, 62.30, 62.34, 62.60, 62.70, 62.84, 65.90])
VARIANCE = np.array([0.2025, 1.2100, 0.0900, 0.2025, 0.3844, 0.5625, 0.0676, 0.0225, 1.8225])


def test_the_published_scatter_of_nine_laboratories():
    found = pool(KACKER, np.sqrt(VARIANCE))
    # The table prints four digits.
    assert found.fit.between == pytest.approx(0.8399, abs=6e-5)


def test_another_program_gives_the_same_digits():
    # R, metafor::rma on the same data: method "PM" (tolerance 1e-9) and "FE".
    found = pool(KACKER, np.sqrt(VARIANCE))
    assert found.mean == pytest.approx(62.4076199113286, abs=1e-9)
    assert found.fit.between**2 == pytest.approx(0.705395309224248, abs=1e-9)
    assert np.sqrt(found.fit.covariance[0, 0]) == pytest.approx(0.338030602684471, abs=1e-9)
    assert found.fit.q == pytest.approx(24.801897741835, abs=1e-9)
    assert found.probability == pytest.approx(0.00167935146372742, abs=1e-9)
    assert found.fit.i_squared == pytest.approx(0.67744403741711, abs=1e-9)


def test_alike_uncertainties_give_the_arithmetic_mean():
    y, s = np.array([1.18, 1.04, 1.09, 0.94, 1.02]), np.full(5, 0.02)
    fit = mixed_fit(y, s, np.ones((5, 1)))
    # Closed form, exact up to round-off and the root's tolerance: s^2 of the values is sigma^2 + tau^2.
    assert fit.coefficients[0] == pytest.approx(y.mean(), rel=1e-12)
    assert fit.between**2 == pytest.approx(y.var(ddof=1) - 0.02**2, rel=1e-9)
    assert fit.scale == pytest.approx(1.0, rel=1e-9)
    half = student.ppf(0.975, 4) * y.std(ddof=1) / np.sqrt(5.0)
    assert fit.interval(0) == pytest.approx((y.mean() - half, y.mean() + half), rel=1e-9)
    assert fit.leverage == pytest.approx(np.full(5, 0.2), rel=1e-12)


def test_alike_uncertainties_give_the_line_of_least_squares():
    rng = np.random.default_rng(3)
    x = np.linspace(-1.0, 1.0, 7)
    y = 1.1 + 0.3 * x + 0.05 * rng.standard_normal(7)
    fit = mixed_fit(y, np.full(7, 1e-4), np.column_stack([np.ones(7), x]))
    least = linregress(x, y)
    assert fit.coefficients == pytest.approx([least.intercept, least.slope], rel=1e-9)
    assert fit.sigma(1) == pytest.approx(least.stderr, rel=1e-7)  # the root's tolerance
    assert fit.leverage.sum() == pytest.approx(2.0, rel=1e-12)  # the trace of a hat matrix


def test_shots_that_agree_are_not_made_more_certain_by_it():
    y, s = np.array([1.0, 1.001, 0.999, 1.0]), np.full(4, 0.05)
    fit = mixed_fit(y, s, np.ones((4, 1)))
    assert fit.between == 0.0
    assert fit.scale < 0.01
    assert fit.sigma(0) == pytest.approx(0.05 / 2.0, rel=1e-12)


def test_what_is_shared_does_not_average_out():
    y, s = np.array([1.0, 1.2, 1.1, 0.9]), np.full(4, 0.01)
    alone = mixed_fit(y, s, np.ones((4, 1)))
    fit = mixed_fit(y, s, np.ones((4, 1)), common=np.full((1, 4), 0.05))
    # Equal weights: u^2 = s^2 / n + c^2, and Welch and Satterthwaite with infinite freedom for c.
    own = y.var(ddof=1) / 4.0
    assert fit.coefficients == pytest.approx(alone.coefficients)
    assert fit.sigma(0) ** 2 == pytest.approx(own + 0.05**2, rel=1e-9)
    assert fit.effective_freedom(0) == pytest.approx(3.0 * ((own + 0.05**2) / own) ** 2, rel=1e-9)
    line = np.column_stack([np.ones(4), np.arange(4.0)])
    moved = mixed_fit(y, s, line, common=np.full((1, 4), 0.05))
    assert moved.common[1, 1] < 1e-20  # what moves all alike moves no slope
    tilted = mixed_fit(y, s, line, common=0.05 * np.arange(4.0)[None])
    assert np.sqrt(tilted.common[1, 1]) == pytest.approx(0.05, rel=1e-9)


def test_the_mean_without_each_shot_is_that_of_the_others():
    found = pool(KACKER, np.sqrt(VARIANCE), common=0.1 * np.eye(9))
    without = found.leave_one_out[8]
    assert without is not None
    rest = pool(KACKER[:8], np.sqrt(VARIANCE[:8]), common=0.1 * np.eye(9)[:, :8])
    assert without.coefficients == pytest.approx(rest.fit.coefficients)
    assert without.sigma(0) == pytest.approx(rest.sigma)
    assert pool(KACKER[:2], np.sqrt(VARIANCE[:2])).leave_one_out == (None, None)


def test_the_interval_holds_the_mean_as_often_as_it_says():
    rng = np.random.default_rng(11)
    held, draws = 0, 500
    for _ in range(draws):
        s = rng.uniform(0.02, 0.06, 5)
        y = 1.1 + np.hypot(s, 0.05) * rng.standard_normal(5)
        low, high = mixed_fit(y, s, np.ones((5, 1))).interval(0)
        held += low <= 1.1 <= high
    # 95 % of 500 is 475 with a standard deviation of 5; the variance is not allowed below the shots' own, so
    # that it may hold more often. Normal quantiles would hold some 90 %.
    assert 460 <= held <= 500


@pytest.mark.parametrize(
    ("y", "s", "X", "message"),
    [
        ([1.0, 2.0], [0.1, 0.0], [[1.0], [1.0]], "must be > 0"),
        ([1.0, np.nan], [0.1, 0.1], [[1.0], [1.0]], "finite"),
        ([1.0], [0.1], [[1.0]], "at least 2 values"),
        ([1.0, 2.0, 3.0], [0.1, 0.1, 0.1], [[1.0, 2.0]] * 3, "go together"),
        ([1.0, 2.0], [0.1], [[1.0], [1.0]], "got"),
    ],
)
def test_what_cannot_be_fitted_is_refused(y, s, X, message):
    with pytest.raises(ValueError, match=message):
        mixed_fit(np.array(y), np.array(s), np.array(X))


def test_one_shot_has_no_scatter():
    with pytest.raises(ValueError, match="at least 2"):
        pool(np.array([1.0]), np.array([0.1]))


CASES = {
    # values and standard uncertainties of Hartung and others' kind: agreeing, scattered, uneven
    "agreeing": ([1.0, 1.1, 0.9, 1.05], [0.2, 0.3, 0.25, 0.2]),
    "scattered": ([1.12, 1.31, 0.98, 1.22, 1.4], [0.02, 0.05, 0.03, 0.02, 0.04]),
    "uneven": ([3.0, 3.4, 2.1], [0.01, 0.5, 0.2]),
}


@pytest.mark.parametrize("name", CASES)
def test_the_scatter_between_values_is_that_of_statsmodels(name: str) -> None:
    analysis = pytest.importorskip("statsmodels.stats.meta_analysis", reason="needs statsmodels")
    values, sigma = (np.array(row) for row in CASES[name])
    oracle = analysis.combine_effects(values, sigma**2, method_re="iterated", atol=1e-12)
    found = mixed_fit(values, sigma, np.ones((values.size, 1)))
    np.testing.assert_allclose(found.between**2, oracle.tau2, rtol=1e-4, atol=1e-9)  # its root's tolerance
    np.testing.assert_allclose(found.coefficients[0], oracle.mean_effect_re, rtol=1e-6)
