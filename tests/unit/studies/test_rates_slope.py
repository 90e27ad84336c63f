"""Slopes over the rate: the paper's five shots, known lines, and every reason for a rejection."""

from dataclasses import replace

import numpy as np
import pytest
from barrecord import classical_shot
from ratedshots import MATES_M, MATES_RATES, rated
from scipy.stats import linregress

from kolsky.base.records import FrontVelocity
from kolsky.inverse.result import Verdict
from kolsky.studies.rates.comparison import compare
from kolsky.studies.rates.records import strain_history, strain_history_of
from kolsky.studies.rates.scatter import SlopeVerdict, pool, slope

NOISE = np.full(5, 1e-4)


def in_test_spread(largest: float, onset: float = 0.01) -> float:
    """Standard deviation of log10 of v / (1 - e) at constant v, e uniform: that of ln(1 - e) over ln 10."""
    a, b = 1.0 - largest, 1.0 - onset
    first = (b * np.log(b) - a * np.log(a)) / (b - a) - 1.0
    second = (b * np.log(b) ** 2 - a * np.log(a) ** 2) / (b - a) - 2.0 * first
    return float(np.sqrt(second - first**2) / np.log(10.0))


def test_the_papers_five_shots_carry_no_slope():
    # Mates et al. (2012), Table 2: compressed to 60 % by a flyer that hardly slows down.
    found = slope(MATES_RATES, np.full(5, in_test_spread(0.6)), MATES_M, NOISE)
    assert found.fit is not None
    # Ordinary least squares "shows" -2.0 +- 0.5 per decade, and Student's t would call it significant:
    line = linregress(np.log10(MATES_RATES), MATES_M)
    assert (line.slope, line.stderr) == pytest.approx((-2.0, 0.5), abs=0.05)  # the digits quoted
    assert line.pvalue < 0.05
    assert found.fit.coefficients[1] == pytest.approx(line.slope, rel=1e-4)  # weights: noise of 1e-4
    assert found.fit.interval(1)[1] < 0.0
    # And yet the rates span a tenth of a decade, less than each test passes through by itself.
    assert found.span == pytest.approx(0.10, abs=0.005)
    assert found.verdict is SlopeVerdict.REFUSED
    failed = [c.name for c in found.criteria if not c.met]
    assert failed == [
        "span of the rates",
        "span over the spread of the rate inside a test",
        "largest leverage of one shot",
        "half width of the slope's interval over the mean",
    ]
    assert found.reasons[0].startswith("the shots' rates span 0.10 decade, 0.5 are needed")
    # Without the slow shot the line is another one.
    without = found.leave_one_out[0]
    low, high = without.interval(1)
    assert low < -8.0
    assert high > 2.0


def test_the_papers_mean_and_its_uncertainty():
    found = pool(MATES_M, NOISE)
    # "1.05 +- 0.18 (k = 2)": twice the standard deviation of the table, to the digits printed.
    assert round(found.mean, 2) == 1.05
    assert round(2.0 * found.scatter, 2) == 0.18
    # That is the uncertainty of one shot. The mean of five is known to t s / sqrt(5) = 2.776 / 2.236 s.
    assert found.interval[1] - found.mean == pytest.approx(2.776 / 2.236 * found.scatter, rel=1e-3)


RATES = np.geomspace(100.0, 1000.0, 6)
SPREAD = np.full(6, 0.1)
SIGMA = np.full(6, 0.005)
DEVIATIONS = np.array([0.004, -0.006, 0.003, 0.002, -0.005, 0.002])


def test_a_known_slope_is_found():
    m = 1.1 + 0.15 * np.log10(RATES / 300.0) + DEVIATIONS
    found = slope(RATES, SPREAD, m, SIGMA)
    assert found.verdict is SlopeVerdict.SENSITIVE
    low, high = found.fit.interval(1)
    assert low < 0.15 < high
    assert high - low < 0.05  # six shots of 0.5 % over a decade
    at = np.log10(np.array([found.reference, 1000.0]))
    bottom, top = found.band(at)
    # At the mean of the logarithms the band is the mean's, elsewhere wider.
    first = found.fit.interval(0)
    assert (bottom[0], top[0]) == pytest.approx(first, rel=1e-9)
    assert top[1] - bottom[1] > 1.5 * (top[0] - bottom[0])


def test_no_slope_is_bounded_not_refused():
    found = slope(RATES, SPREAD, 1.1 + DEVIATIONS, SIGMA)
    assert found.verdict is SlopeVerdict.NONE_SEEN
    assert found.reasons == ()


@pytest.mark.parametrize(
    ("rates", "spread", "m", "reason"),
    [
        (RATES[[0, 3, 5]], 0.05, 1.1 + DEVIATIONS[:3], "there are 3 shots, 4 needed"),
        (np.geomspace(100.0, 250.0, 6), 0.05, 1.1 + DEVIATIONS, "the shots' rates span 0.40 decade"),
        (RATES, 0.3, 1.1 + DEVIATIONS, "the span is 3.3 times the 0.30 decade"),
        (
            np.array([100.0, 990.0, 1000.0, 1010.0, 1005.0, 995.0]),
            0.05,
            1.1 + DEVIATIONS,
            "a leverage of 1.00",
        ),
        (RATES, 0.05, 1.1 + 200.0 * DEVIATIONS, "the scatter leaves the slope uncertain by"),
    ],
)
def test_each_condition_refuses_by_itself(rates, spread, m, reason):
    found = slope(rates, np.full(rates.size, spread), m, np.full(rates.size, 0.005))
    assert found.verdict is SlopeVerdict.REFUSED
    assert [r for r in found.reasons if reason in r], found.reasons
    assert len(found.reasons) == 1, found.reasons


def test_two_shots_or_one_rate_have_no_line():
    two = slope(RATES[:2], SPREAD[:2], np.array([1.0, 1.1]), SIGMA[:2])
    alike = slope(np.full(5, 300.0), np.full(5, 0.1), 1.1 + DEVIATIONS[:5], SIGMA[:5])
    for found in (two, alike):
        assert found.fit is None
        assert found.verdict is SlopeVerdict.REFUSED
        with pytest.raises(ValueError, match="there is no line"):
            found.band(np.zeros(1))


@pytest.mark.parametrize("rates", [[100.0, 0.0], [100.0, -5.0], [100.0, np.inf]])
def test_impossible_rates_are_refused(rates):
    with pytest.raises(ValueError, match="every strain rate"):
        slope(np.array(rates), np.zeros(2), np.ones(2), np.ones(2))


# The rate of one test


class Steady:
    """A front face at constant velocity from rest at 0 s, or one that turns back."""

    def __init__(self, speed: float, turn: float = np.inf) -> None:
        self.speed, self.turn = speed, turn

    def position(self, t):
        return self.speed * np.where(t < self.turn, t, 2.0 * self.turn - t)

    def velocity(self, t):
        return np.where(t < self.turn, self.speed, -self.speed)

    def sigma_change(self, first, last):
        return 1e-6


def test_the_rate_of_a_steady_front():
    length, speed, end = 6.5e-3, 2.6, 1.5e-3
    found = strain_history_of(Steady(speed), np.linspace(0.0, end, 2001), length)
    largest = speed * end / length
    assert found.nominal_rate == pytest.approx(speed / length, rel=1e-9)
    assert found.largest == pytest.approx(largest, rel=1e-12)
    assert found.sigma_rate == pytest.approx(1e-6 / length / (found.span[1] - found.span[0]), rel=1e-9)
    # Velocity over current length where 5 and 95 % of the strain have passed; steps of 3e-4 in strain.
    for share, rate in zip((0.05, 0.95), found.true_rate, strict=True):
        strain = 0.01 + share * (largest - 0.01)
        assert rate == pytest.approx(speed / length / (1.0 - strain), rel=1e-3)
    assert found.spread == pytest.approx(in_test_spread(largest), rel=2e-3)  # likewise
    assert found.time_at(np.array([0.3])) == pytest.approx([0.3 * length / speed], rel=1e-6)


def test_what_comes_after_the_turn_does_not_count():
    length, speed = 6.5e-3, 2.6
    found = strain_history_of(Steady(speed, turn=1e-3), np.linspace(0.0, 1.5e-3, 3001), length)
    assert found.nominal_rate == pytest.approx(speed / length, rel=1e-9)
    assert found.span[1] == pytest.approx(1e-3, abs=1e-6)
    with pytest.raises(ValueError, match=r"a strain of 0\.5 was not reached"):
        found.time_at(np.array([0.5]))


@pytest.mark.parametrize("speed", [0.01, 5.0, -2.0])
def test_a_motion_that_is_no_compression_is_refused(speed):
    with pytest.raises(ValueError, match="largest nominal strain"):
        strain_history_of(Steady(speed), np.linspace(0.0, 1.5e-3, 101), 6.5e-3)


def test_the_rate_of_a_test_between_bars():
    shot = classical_shot(0)
    found = strain_history(shot)
    motion = shot.flyer
    assert isinstance(motion, FrontVelocity)
    inside = (motion.time >= found.span[0]) & (motion.time <= found.span[1])
    mean = float(motion.velocity[inside].mean()) / shot.specimen.length
    # The samples' mean against the fitted path's chord: half a sample at either end.
    assert found.nominal_rate == pytest.approx(mean, rel=0.01)
    # The scale of the waves is uncertain as a whole, and the rate with it.
    assert found.sigma_rate >= motion.sigma_gain * found.nominal_rate > 0.0


GOOD = [rated("a", 1.10, 300.0), rated("b", 1.12, 400.0)]


@pytest.mark.parametrize("verdict", [Verdict.UNEXPLAINED, Verdict.CONTRADICTED])
def test_an_unexplained_shot_is_left_out_and_named(verdict: Verdict) -> None:
    bad = rated("c", 1.50, 500.0, verdict=verdict)
    (group,) = compare([*GOOD, bad]).groups
    assert group.pooled.mean == pytest.approx(1.11, abs=1e-9)
    assert f"c is not counted: {verdict.value}" in group.remarks
    (kept,) = compare([*GOOD, replace(bad, keep_unexplained=True)]).groups
    assert [shot.name for shot in kept.counted] == ["a", "b", "c"]
    assert f"c is included as requested, though it is {verdict.value}" in kept.remarks


@pytest.mark.parametrize("verdict", [Verdict.AT_BOUND, Verdict.NOT_SEEN, Verdict.DISAGREEING])
def test_what_says_no_otherwise_is_never_kept(verdict: Verdict) -> None:
    assert not replace(rated("c", 1.5, 500.0, verdict=verdict), keep_unexplained=True).counted


def test_one_channel_alone_counts() -> None:
    assert rated("c", 1.1, 500.0, verdict=Verdict.OUTLINE_ALONE).counted


def test_an_older_result_is_named() -> None:
    old = replace(GOOD[0], found=replace(GOOD[0].found, fit=()))
    (group,) = compare([old, GOOD[1]]).groups
    assert any("not recorded of a: an older result" in remark for remark in group.remarks)
    assert np.isnan(old.excess("force"))
    assert GOOD[1].excess("force") == pytest.approx(1.0, rel=1e-12)
