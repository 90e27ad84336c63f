"""Whole tests between bars from files: budget against re-runs, baselines, tension, impossible arrivals."""

from dataclasses import replace

import barshots
import numpy as np
import pytest
from barshots import bar_shot

from kolsky.bars.reduction.analyse import analyse
from kolsky.shot.bars import load_waves

DECLARED = """gauge_calibration = "1 %"
gauge_distance = "0.5 mm"
bar_wave_speed = "0.1 %"
bar_density = "0.2 %"
bar_diameter = "0.1 %"
specimen_length = "0.5 %"
"""


def strains(**more):
    """Times and the two gauges' strains: every fourth sample, 0.4 us, is enough and four times as fast."""
    return barshots.strains(noise=2e-6, every=4, **more)


def shot(folder, columns, **parts):
    """The test of a folder whose dispersion is left alone."""
    off = "punching = false, dispersion = false"
    return load_waves(bar_shot(folder, columns=columns, corrections=off, **{"more": DECLARED, **parts}))


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    given = shot(tmp_path_factory.mktemp("honest") / "shot", strains())
    return given, analyse(given)


def moved(given, name, step):
    """The test with one declared input moved."""
    side, what = name.split(" ", 1)
    if side == "specimen,":
        specimen = given.specimen
        return replace(given, specimen=replace(specimen, **{what: getattr(specimen, what) + step}))
    bars, stations = dict(given.bars), dict(given.stations)
    if what == "gauge, distance":
        stations[side] = replace(stations[side], position=stations[side].position + step)
    elif what == "gauge, strain per volt":
        calibration = replace(stations[side].calibration, factor=stations[side].calibration.factor + step)
        stations[side] = replace(stations[side], calibration=calibration)
    else:
        bar = bars[side]
        speed, density, diameter = (
            value + (step if key in what else 0.0)
            for key, value in (
                ("speed", bar.wave_speed),
                ("density", bar.density),
                ("diameter", bar.diameter),
            )
        )
        bars[side] = replace(bar, diameter=diameter, density=density, youngs_modulus=density * speed**2)
    return replace(given, bars=bars, stations=stations)


INPUTS = [
    "specimen, diameter",
    "specimen, length",
    *(f"{side} {what}" for side in ("incident", "transmission") for what in ("gauge, strain per volt",
     "gauge, distance", "bar, wave speed", "bar, density", "bar, diameter")),
]  # fmt: skip


def test_all_four_values_are_quoted_and_right(made):
    _, found = made
    assert set(found.budget.results) == {"largest strain", "peak stress", "mean stress", "mean rate"}
    stress, sigma, _ = found.budget.results["mean stress"]
    assert stress == pytest.approx(250e6, abs=2.0 * sigma)
    assert abs(stress - 250e6) < 0.003 * 250e6  # noise of 2e-6 in 1.5e-3 over a baseline of 200 samples
    rate, sigma, _ = found.budget.results["mean rate"]
    assert rate == pytest.approx(2375.0, rel=0.003)
    assert not any("plateau" in remark or "arrives" in remark for remark in found.remarks)


@pytest.mark.slow
@pytest.mark.parametrize("name", INPUTS)
def test_a_run_with_an_input_moved_by_its_sigma_gives_what_the_budget_says(made, name):
    """Windows, pulses and plateau are found anew; whatever makes a tenth of the uncertainty, within 20 %."""
    given, best = made
    row = next(row for row in best.budget.contributions if row.quantity.name == name)
    assert row.quantity.sigma > 0.0
    runs = {sign: analyse(moved(given, name, sign * row.quantity.sigma)).budget.results for sign in (1, -1)}
    for value, (at, sigma, _) in best.budget.results.items():
        said = sigma * np.sqrt(max(row.shares[value], 0.0))
        for sign, other in runs.items():
            change = abs(other[value][0] - at)
            assert change == pytest.approx(said, rel=0.2, abs=0.1 * sigma), (value, sign)


def test_where_a_baseline_ends_does_not_matter_much(tmp_path):
    """A wander of 4 um/m; 15 us less of the baseline changed U of the peak stress from 270 to 22 MPa."""
    t, first, second = strains()
    wander = 4e-6 * np.sin(2 * np.pi * t / 260e-6)
    found = []
    for number, end in enumerate((80, 65)):
        columns, ends = (t, first + wander, second + wander), f'["0 us", "{end} us"]'
        found.append(
            analyse(shot(tmp_path / f"{number}", columns, baseline=ends)).budget.results["peak stress"]
        )
    (one, u_one, _), (other, u_other, _) = found
    assert 0.4 < u_one / u_other < 2.5
    assert abs(one - other) < 2.0 * np.hypot(u_one, u_other)


def test_a_baseline_that_holds_the_pulse_is_refused(tmp_path):
    with pytest.raises(ValueError, match=r"incident gauge: the baseline .* is not at rest: from 0\.000199"):
        analyse(shot(tmp_path / "a", strains(), baseline='["0 us", "215 us"]'))


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"late": -85e-6}, "the reflected pulse arrives -8"),
        ({"late": 20e-6}, "the reflected pulse arrives +2"),
        ({"shift": -14e-6}, "the transmitted pulse arrives -1"),
        ({"shift": 14e-6}, "the transmitted pulse rises 1"),
    ],
)
def test_pulses_at_impossible_times_are_remarked(tmp_path, options, words):
    found = analyse(shot(tmp_path / "a", strains(**options), more=""))
    assert [remark for remark in found.remarks if remark.startswith(words)]


def test_tension_whose_balance_begins_after_the_stress_has_fallen(tmp_path):
    """The forces meet only at the end, at half of the largest stress; a balance of 30 % is taken."""
    given = shot(tmp_path / "a", strains(soft=0.6), waves='load = "compression"\nbalance = "30 %"')
    assert given.allowance == 0.3
    pulled = shot(tmp_path / "b", strains(soft=0.6), factor=-1e3, waves='load = "tension"\nbalance = "30 %"')
    for one in (given, pulled):
        found = analyse(one)
        assert found.budget.results["peak stress"][0] == pytest.approx(250e6, rel=0.2)


def test_no_mean_without_a_plateau(tmp_path):
    """The stress falls by 60 % along the pulse: the mean of it is no material's."""
    found = analyse(shot(tmp_path / "a", strains(soft=0.6)))
    assert "mean stress" not in found.budget.results
    assert any(remark.startswith("no mean") and "no plateau" in remark for remark in found.remarks)


def test_the_declared_share_of_the_pulse_is_taken(tmp_path):
    assert shot(tmp_path / "a", strains(), waves='plateau = "95 %"').plateau == 0.95
