"""Remarks on both sides of their thresholds; quoted values and their noise by hand."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from kolsky.bars.budget import propagate
from kolsky.bars.records import BudgetTable, Contribution, FaceWaves, History, Quantity, Reduction
from kolsky.bars.reduction import summary as quoted
from kolsky.bars.reduction.summary import EnergyBalance, Summary, spread_of, summarise, way_sigmas
from kolsky.bars.reduction.validity import Span
from kolsky.bars.reduction.windows import PulseCheck
from kolsky.bars.signals.arrival import Arrival
from kolsky.bars.signals.bridge import Bridge, Linear
from kolsky.base.apparatus import Bar, Specimen

STEP = 1e-6
BAR = Bar(diameter=20e-3, length=2.0, youngs_modulus=200e9, density=8000.0)
SPECIMEN = Specimen(diameter=10e-3, length=4e-3, density=1000.0)


def check(delay, sigma=1e-6):
    """A pulse predicted at 1 ms and observed later."""
    arrival = Arrival(1e-3 + delay, sigma, 1e-3, 1e-5, 2e-3, -1.0)
    return PulseCheck(1e-3, arrival, "observed", delay, sigma)


GIVEN = {
    "allowance": 0.05,
    "stations": {"incident": SimpleNamespace(position=1.0), "transmission": SimpleNamespace(position=0.5)},
    "bars": {"incident": BAR, "transmission": BAR},
}


def made_budget(*, curvature=0.0, sigma=0.1, zero=0.0):
    """Of two values, 1 each: the first bends, and `zero` of its variance is the incident gauge's drift."""
    names = ("largest strain", "peak stress")
    quantities = [Quantity(name, 1.0, 1.0, "1", "A") for name in ("incident gauge, drift 1", "specimen, x")]
    parts = sigma * np.sqrt([zero, 1.0 - zero])
    return SimpleNamespace(
        quantities=quantities,
        value=dict.fromkeys(names, np.float64(1.0)),
        contribution={names[0]: parts, names[1]: np.array([0.0, sigma])},
        sigma=lambda name: np.float64(sigma),
        nonlinearity={names[0]: curvature, names[1]: 0.0}.get,
    )


def remarks(
    *,
    balanced=(0.0, 1e-4),
    reflected=None,
    transmitted=None,
    uncertainty=None,
    toe=0.0,
    faults=(None, None),
    modulus="",
    **budget,
):
    strain = {"three waves": SimpleNamespace(value=toe * np.arange(5) / 4)}
    return quoted.remarks(
        SimpleNamespace(balanced=balanced, time=0.1 * STEP * np.arange(5), strain=strain),
        made_budget(**budget),
        (reflected or check(0.0), transmitted or check(0.0)),
        SimpleNamespace(
            **GIVEN, uncertainty={"specimen_length": 0.01} if uncertainty is None else uncertainty
        ),
        SimpleNamespace(
            plateau=SimpleNamespace(stress_fault=faults[0], rate_fault=faults[1]),
            modulus=None if modulus else 1.0,
            modulus_reason=modulus,
        ),
    )


def test_a_test_in_order_has_no_remark():
    assert remarks() == []


def test_no_equilibrium_is_remarked():
    (said,) = remarks(balanced=None)
    assert "nowhere in equilibrium within 5 %" in said
    assert "kolsky identify" in said


def test_a_missing_modulus_is_remarked_where_there_is_equilibrium():
    why = "no modulus: 2 samples rise in equilibrium; at least 10 are needed"
    assert remarks(modulus=why) == [f"{why}; cure: a slower rise of the pulse (a pulse shaper)"]
    assert len(remarks(modulus=why, balanced=None)) == 1  # that of the equilibrium


def test_a_missing_reflected_pulse_is_remarked():
    missing = PulseCheck(1e-3, None, "incident gauge: no negative pulse")
    assert remarks(reflected=missing) == ["no reflected pulse is found: incident gauge: no negative pulse"]


@pytest.mark.parametrize(("delay", "remarked"), [(3.19e-6, 0), (3.21e-6, 1), (-3.19e-6, 0), (-3.21e-6, 1)])
def test_a_delayed_reflected_pulse_is_remarked_beyond_three_sigma_and_two_samples(delay, remarked):
    """Sigma 1 us, samples 0.1 us: 3 * 1 + 2 * 0.1 = 3.2 us."""
    said = remarks(reflected=check(delay))
    assert len(said) == remarked
    assert all(f"{1e6 * delay:+.2f} us" in line for line in said)


def test_a_distance_and_a_wave_speed_have_their_say_in_an_arrival():
    """5000 m/s: 2 x 1 m at 1 % are 4 us, 2 x 5 mm 2 us; half of E's 2 % is the speed's 1 %."""
    given = SimpleNamespace(**GIVEN, uncertainty={"bar_wave_speed": 0.01, "gauge_distance": 5e-3})
    reflected, transmitted = way_sigmas(given)
    assert reflected == pytest.approx(np.hypot(4e-6, 2e-6))
    assert transmitted == pytest.approx(np.sqrt(2e-6**2 + 1e-6**2 + 2 * 1e-6**2))
    given = SimpleNamespace(**GIVEN, uncertainty={"bar_modulus": 0.016, "bar_density": 0.012})
    assert way_sigmas(given)[0] == pytest.approx(4e-6)
    wide = {"bar_wave_speed": 0.01}  # 4 us; 3 hypot(4, 1) + 0.2 = 12.57 us
    assert remarks(reflected=check(12.5e-6), uncertainty=wide) == []
    assert len(remarks(reflected=check(12.6e-6), uncertainty=wide)) == 1


@pytest.mark.parametrize(("delay", "remarked"), [(-3.19e-6, 0), (-3.21e-6, 1), (50e-6, 0)])
def test_a_transmitted_pulse_must_not_come_before_its_time(delay, remarked):
    said = remarks(transmitted=check(delay))
    assert len(said) == remarked
    assert all(line.startswith("the transmitted pulse arrives -3.21 us") for line in said)


@pytest.mark.parametrize(("toe", "remarked"), [(0.0199, 0), (0.0201, 1)])
def test_a_late_transmitted_pulse_is_judged_by_the_strain_before_it(toe, remarked):
    """0.2 us late, half of the record: half of its strain."""
    said = remarks(transmitted=check(0.2e-6), toe=toe)
    assert len(said) == remarked
    assert all("0.2 us late, when the specimen is shortened by 1 %" in line for line in said)


@pytest.mark.parametrize(("share", "remarked"), [(0.49, 0), (0.51, 1)])
def test_a_drift_that_decides_is_remarked(share, remarked):
    said = remarks(zero=share)
    assert len(said) == remarked
    assert all("dominate the uncertainty of the largest strain (51 % of" in line for line in said)
    assert remarks(zero=0.9, sigma=9e-4) == []  # of less than a thousandth nobody needs to know


def test_a_mean_that_is_not_quoted_is_said_with_its_reason():
    assert remarks(faults=("no plateau: short", "no plateau: short"))[0].startswith(
        "no mean stress and no mean rate are quoted: no plateau: short; cure"
    )
    said = remarks(faults=(None, "no plateau: the rate falls"))
    assert len(said) == 1
    assert said[0].startswith("no mean rate is quoted: no plateau: the rate falls; cure")


@pytest.mark.parametrize(("curvature", "remarked"), [(0.2, 0), (0.201, 1)])
def test_nonlinear_values_are_named(curvature, remarked):
    said = remarks(curvature=curvature)
    assert len(said) == remarked
    assert all(line.startswith("the largest strain depends on its inputs nonlinearly") for line in said)


@pytest.mark.parametrize(
    ("uncertainty", "remarked"), [({}, 1), ({"bar_modulus": 0.0}, 1), ({"bar_modulus": 1e-9}, 0)]
)
def test_undeclared_uncertainties_are_remarked(uncertainty, remarked):
    said = remarks(uncertainty=uncertainty)
    assert len(said) == remarked
    assert all("add a table [uncertainty]" in line for line in said)


def test_a_relative_calibration_uncertainty_is_one_of_its_scale():
    bridge = Bridge("quarter", gauge_factor=2.1, excitation=5.0)
    assert quoted.calibration_sigma(bridge, 0.01) == {"gauge_factor": pytest.approx(0.021)}
    assert quoted.calibration_sigma(Linear(4e-4), 0.01) == {"factor": pytest.approx(4e-6)}


def history(value, sigma, unit="1"):
    value = np.asarray(value, dtype=float)
    return History(value, np.broadcast_to(np.asarray(sigma, dtype=float), value.shape).copy(), unit)


def reduction(strain, rate, stress, *, balanced, sigma=(0.0, 0.0, 0.0)):
    """A reduction of three given histories, alike in every analysis, forces and velocities zero."""
    three = [
        history(v, s, u) for v, s, u in zip((strain, rate, stress), sigma, ("1", "1/s", "Pa"), strict=True)
    ]
    zero = history(np.zeros(len(strain)), 0.0)
    keys = ("one wave", "two waves", "three waves")
    return Reduction(
        STEP * np.arange(len(strain)),
        *(dict.fromkeys(keys, one) for one in three),
        zero, zero, zero, zero, np.zeros(len(strain)), balanced,
    )  # fmt: skip


def faces(n, *, sigma=1.0, white=None):
    zero, pulse = np.zeros(n), np.ones(n)
    names = ("incident", "reflected", "transmitted")
    return FaceWaves(
        STEP * np.arange(n), pulse, zero, zero, dict.fromkeys(names, sigma), BAR, BAR,
        white=None if white is None else dict.fromkeys(names, white),
    )  # fmt: skip


def test_the_energy_is_taken_up_to_the_largest_strain():
    """Strain 0, 1, ... 6, 5, 4 %: largest at 6 us."""
    strain = 0.01 * np.array([0, 1, 2, 3, 4, 5, 6, 5, 4.0])
    stress, rate = 10.0 * np.arange(9.0), 100.0 + np.arange(9.0)
    r = reduction(strain, rate, stress, balanced=(2e-6, 8e-6), sigma=(1e-3, 2.0, 3.0))
    found = summarise(r, faces(9, sigma=1.0, white=2.0), SPECIMEN)  # white / sigma = 2: four samples one
    s, dot = stress[:7], rate[:7]
    assert found.absorbed.value == pytest.approx(STEP * np.sum(0.5 * ((s * dot)[1:] + (s * dot)[:-1])))
    assert found.absorbed.sigma == pytest.approx(
        STEP * np.sqrt(4.0 * np.sum((dot * 3.0) ** 2 + (s * 2.0) ** 2))
    )
    assert found.mean_stress is None  # it rises all the way
    assert found.plateau.stress_fault is not None


def test_a_loading_modulus_is_a_line_up_to_half_the_stress():
    """Stress 5e9 e + 1e6 over 41 samples: the samples of equilibrium up to half the largest stress."""
    strain = 1e-3 * np.arange(41.0)
    stress = 5e9 * strain + 1e6
    r = reduction(strain, np.ones(41), stress, balanced=(4.5e-6, 40e-6), sigma=(0.0, 0.0, 2e5))
    found = summarise(r, faces(41, sigma=1.0, white=3.0), SPECIMEN)
    used = strain[5:20]  # 5e9 e + 1e6 > 100.5e6 from e = 0.0199 on
    assert found.modulus.value == pytest.approx(5e9)
    spread = np.sum((used - used.mean()) ** 2)
    assert found.modulus.sigma == pytest.approx(3.0 * 2e5 / np.sqrt(spread))
    assert found.modulus_reason.startswith("15 samples in equilibrium")
    for begin, words in ((10.5e-6, "9 samples rise"), (19.5e-6, "equilibrium begins at 50 %")):
        none = summarise(reduction(strain, np.ones(41), stress, balanced=(begin, 40e-6)), faces(41), SPECIMEN)
        assert none.modulus is None
        assert words in none.modulus_reason
    ten = summarise(reduction(strain, np.ones(41), stress, balanced=(9.5e-6, 40e-6)), faces(41), SPECIMEN)
    assert ten.modulus_reason.startswith("10 samples")


def test_no_modulus_where_equilibrium_begins_when_the_stress_has_fallen():
    """Stress up to 4 and down to 0.4 of it while the strain still grows; balanced from there on."""
    strain = 1e-3 * np.arange(41.0)
    stress = 1e8 * np.interp(np.arange(41), [0, 20, 40], [0.0, 1.0, 0.2])
    r = reduction(strain, np.ones(41), stress, balanced=(36e-6, 40e-6))
    found = summarise(r, faces(41), SPECIMEN)
    assert found.modulus is None
    assert "begins after the largest stress" in found.modulus_reason


def test_spread_of_the_largest_strains():
    strains = {"a": history([0.0, 0.09], 0.0), "b": history([0.11, 0.0], 0.0), "c": history([0.0, 0.10], 0.0)}
    assert spread_of(strains) == pytest.approx(0.2)  # 0.02 over 0.10
    assert spread_of({k: History(-h.value, h.sigma, "1") for k, h in strains.items()}) == pytest.approx(0.2)


def test_quoted_values_of_largest_magnitude_and_over_a_span():
    strain, stress = [0.0, 0.1, 0.3, 0.2], [0.0, -5.0, 4.0, 3.0]
    r = reduction(strain, [1.0, 2.0, 3.0, 4.0], stress, balanced=(1e-6, 3e-6),
                  sigma=([1, 2, 3, 4.0], 0.5, [5, 6, 7, 8.0]))  # fmt: skip
    mean = Quantity("mean", 0.0, 7.0, "Pa", "A")
    summary = replace(summarise(r, faces(4), SPECIMEN), mean_stress=mean, mean_rate=None)
    span = Span(1e-6, 3e-6, np.array([0.0, 1.0, 1.0, 0.5]))
    found = quoted.numbers(r, summary, span)
    assert {k: float(v) for k, v in found.items()} == pytest.approx(
        {"largest strain": 0.3, "peak stress": -5.0, "mean stress": 0.5 / 2.5}
    )
    assert quoted.noise(r, summary) == pytest.approx(
        {"largest strain": 3.0, "peak stress": 6.0, "mean stress": 7.0}
    )
    with pytest.raises(ValueError, match="mean stress: nothing is left of the plateau"):
        quoted.numbers(r, summary, None)
    assert quoted.span_quantities(summary) == []
    standing = replace(summary, plateau=replace(summary.plateau, span=Span(1e-6, 41e-6, span.weight)))
    # A varied input that leaves no plateau is judged over the test's own.
    kept = replace(summary, plateau=replace(summary.plateau, span=span))
    assert quoted.numbers(r, kept, None)["mean stress"] == pytest.approx(0.5 / 2.5)
    assert [(q.name, q.sigma) for q in quoted.span_quantities(standing)] == [
        ("plateau, beginning", pytest.approx(2e-6)),  # 5 % of 40 us
        ("plateau, end", pytest.approx(2e-6)),
    ]


def test_a_quoted_value_that_bends_has_the_mean_square_of_its_two_changes():
    """y = 3 x + 4 x^2 over x = 0 +- 1: changes of 7 and of 1, whose mean square is 25. A history stays."""
    budget = propagate(
        lambda values: {
            name: 3.0 * values["x"] + 4.0 * values["x"] ** 2 for name in ("peak stress", "stress")
        },
        [Quantity("x", 0.0, 1.0, "1", "B")],
        tolerance=10.0,
    )
    assert quoted.with_both_sides(budget).contribution["peak stress"][0] == pytest.approx(np.sqrt(25.0))
    assert quoted.with_both_sides(budget).contribution["stress"][0] == pytest.approx(3.0)


def test_the_table_of_a_test_in_tension_has_its_sign_and_the_largest_share_first(monkeypatch):
    rows = tuple(
        Contribution(Quantity(name, 0.0, 1.0, "1", "B"), {"largest strain": share})
        for name, share in (("small", 0.1), ("negative", -0.6), ("middle", 0.3))
    )
    table = BudgetTable({"largest strain": (0.2, 0.01, "1")}, rows)
    monkeypatch.setattr(quoted, "budget_table", lambda budget, results: table)
    found = quoted.table(SimpleNamespace(value={}), -1.0)
    assert found.results == {"largest strain": (-0.2, 0.01, "1")}
    assert [row.quantity.name for row in found.contributions] == ["negative", "middle", "small"]


def test_facts_of_a_record():
    r = reduction([0.0, 0.1, 0.2], [0.0, 1.0, 1.0], [0.0, 1.0, 2.0], balanced=(1e-6, 2e-6))
    summary = summarise(r, faces(3), SPECIMEN)
    assert summary.energy == EnergyBalance(
        summary.energy.incident, 0.0, 0.0, summary.energy.incident, summary.energy.deformation
    )
    assert summary.energy.deformation == pytest.approx(
        SPECIMEN.area * 4e-3 * 2e-6
    )  # 0, 1, 2 W/m^3: 0.5 + 1.5
    strain = SimpleNamespace(interval=STEP, sigma=3e-6)
    station = SimpleNamespace(signal=SimpleNamespace(strain=strain, bar=BAR))
    windows = SimpleNamespace(incident=(1e-4, 3e-4))
    found = quoted.facts(
        {"incident": station, "transmission": station}, check(0.0).observed,
        (check(2e-6), PulseCheck(1.0, None, "none")), windows, r, summary,
    )  # fmt: skip
    assert found["duration of the incident pulse"] == (pytest.approx(1e-3), "s")
    assert found["length of the windows"] == (pytest.approx(2e-4), "s")
    assert found["reflected pulse, later than predicted by"] == (pytest.approx(2e-6), "s")
    assert "transmitted pulse, later than predicted by" not in found
    assert found["time to equilibrium"] == (pytest.approx(1e-6), "s")
    assert found["wave speed, incident bar"] == (pytest.approx(5000.0), "m/s")
    assert isinstance(summary, Summary)
