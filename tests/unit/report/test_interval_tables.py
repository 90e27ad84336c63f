"""Arithmetic of texts about an interval: budgets, shares, limits, other choices; closed forms."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from synthetic import synthetic

from kolsky.inverse.result import Declaration, Estimate, Identification, ParameterProfile, Verdict
from kolsky.report.figures.base import weighted_chi2
from kolsky.report.pages.identification import answer_row, check_run_rows
from kolsky.report.pages.rates import mean_and_scatter
from kolsky.report.pages.surfaces import calibration_summary
from kolsky.report.pages.uncertainty import changes, choices, likelihood_tables, parts
from kolsky.report.pages.waves import answers, quantity
from kolsky.results import numbers
from kolsky.results.display import in_display_units
from kolsky.results.nomenclature import in_words, short
from kolsky.results.printed import answer as printed_answer

MADE = synthetic()
"""One free parameter, m = 1.12."""
NOISE = {"force and shape": 3.0, "flyer motion": 4.0}
"""Root sum of squares 5."""


def estimate(**changed: Any) -> Estimate:
    """An estimate of 100 with u = sqrt(5² + 12²) = 13."""
    fields: dict[str, Any] = {
        "name": "stiffness_factor", "unit": "1", "value": 100.0, "sigma_noise": 5.0, "sigma_numerical": 12.0,
        "mesh_shift": -7.0, "noise_parts": NOISE, "numerical_parts": {"mesh": 12.0},
        "outcome": Verdict.IDENTIFIED,
    }  # fmt: skip
    return Estimate(**fields | changed)


def of(e: Estimate, **changed: Any) -> Identification:
    """The made-up result with this estimate."""
    return replace(MADE, estimates={"stiffness_factor": e}, **changed)


def profile(together: float, alone: float) -> ParameterProfile:
    """A profile with these half widths of its intervals."""
    return ParameterProfile(
        name="stiffness_factor", values=np.zeros(2), rise=np.zeros(2), points=np.zeros((2, 1)), level=3.84,
        correlation=1.0, interval=(1.0 - together, 1.0 + together), alone=(1.0 - alone, 1.0 + alone),
        verdict="identified", text="", error=0.0,
    )  # fmt: skip


# The budget of one estimate


def test_a_budget_adds_squares_and_gives_shares_of_the_variance() -> None:
    shown = answer_row(estimate())
    assert (shown["value"], shown["uncertainty"], shown["combined"]) == ("100", "26", "13.0")
    assert shown["interval"] == ["74", "126"]  # 100 ± 2 · 13
    assert shown["relative"] == "26 %"
    assert shown["budget"] == [  # u²/13² of each
        ("noise of force and outline", "3.0", "5.3 %", "part"),
        ("noise of the front face's motion", "4.0", "9.5 %", "part"),
        ("noise, all sources", "5.0", "15 %", "sum"),
        ("mesh and step", "12.0", "85 %", "sum"),
    ]


def test_declared_and_several_numerical_parts_have_lines_of_their_own() -> None:
    shown = answer_row(
        estimate(
            sigma_numerical=5.0,
            numerical_parts={"mesh": 3.0, "roughness": 4.0},
            sigma_systematic=np.sqrt(119.0),
        )
    )
    assert [row[0] for row in shown["budget"][3:]] == [
        "error of mesh and step",
        "roughness of the simulated response",
        "numerics, all sources",
        "declared uncertainties of the inputs",
    ]
    assert shown["budget"][-1][2] == "70 %"  # 119 / 169


@pytest.mark.parametrize(("whole", "adds_up"), [(5.09, True), (5.11, False), (4.91, True), (4.89, False)])
def test_parts_add_up_to_two_percent(whole: float, adds_up: bool) -> None:
    assert answer_row(estimate(sigma_noise=whole))["sums_up"] is adds_up


def test_the_line_of_the_terminal_has_k_2() -> None:
    assert printed_answer(estimate()) == "m = 100 ± 26 (k = 2)"
    assert printed_answer(estimate(outcome=Verdict.AT_BOUND)).endswith(f": {Verdict.AT_BOUND.value.upper()}")


def test_the_energy_imbalance_is_a_percentage() -> None:
    ledger, response = MADE.response.energy, MADE.response
    off = replace(ledger, external=ledger.external + 0.01 * ledger.external.max())
    rows = dict(check_run_rows(replace(MADE, response=replace(response, energy=off))))
    before = dict(check_run_rows(MADE))["worst energy imbalance"]
    assert rows["worst energy imbalance"] != before
    assert rows["time reached"].startswith(numbers.plain(1e3 * float(response.end_times[0])))


# What would narrow an interval


def test_half_of_a_part_takes_three_quarters_of_its_square() -> None:
    first, second, *_ = changes(of(estimate()))
    # 2 sqrt(13² - 0.75 · 12²) = 15.6 and 2 sqrt(13² - 0.75 · 4²) = 25.1
    said = "Halving the error of mesh and step would bring U of m from 26 to 16 (85 % of the variance)"
    assert first == said
    assert "from 26 to 25 (9.5 % of the variance)" in second


@pytest.mark.parametrize(("share", "listed"), [(0.021, True), (0.019, False)])
def test_parts_below_two_percent_of_the_variance_are_not_listed(share: float, listed: bool) -> None:
    u = 49.5  # U = 99; halving takes 0.75 share / 2 of it, 0.7 or 0.8, so that either would read "to 98"
    noise = {"force and shape": u * np.sqrt(1.0 - share), "force scale": u * np.sqrt(share)}
    e = estimate(sigma_noise=u, noise_parts=noise, sigma_numerical=0.0, numerical_parts={"mesh": 0.0})
    assert any("force’s scale" in line for line in changes(of(e))) is listed


def test_a_declared_input_counts_by_the_size_of_its_shift() -> None:
    declared = Declaration(
        key="poisson", sigma=0.001, unit="1", shifts={"stiffness_factor": -12.0}, status="varied"
    )
    e = estimate(sigma_numerical=0.0, numerical_parts={"mesh": 0.0}, sigma_systematic=12.0)
    found = parts(of(e, systematic=(declared,)), e)
    assert next(iter(found)) == "declared uncertainty of the Poisson’s ratio ν"  # the largest first
    assert np.hypot.reduce(list(found.values())) == pytest.approx(13.0)


@pytest.mark.parametrize(("alone", "told"), [(0.94, True), (0.96, False)])
def test_other_parameters_count_where_they_widen_by_a_twentieth(alone: float, told: bool) -> None:
    both = synthetic(("stiffness_factor", "friction"))
    lines = changes(replace(both, profiles=(profile(1.0, alone),)))
    assert any("profile interval of m from ±1 to" in line for line in lines) is told


@pytest.mark.parametrize(("share", "told"), [(0.011, True), (0.009, False)])
def test_a_longer_curve_is_asked_for_from_one_percent_of_the_volume(share: float, told: bool) -> None:
    response = replace(
        MADE.response, extrapolated_share=np.array([share]), largest_strain_measure=np.array([2.0])
    )
    lines = [line for line in changes(replace(MADE, response=response)) if "quasi-static curve to" in line]
    assert bool(lines) is told
    if told:  # lam² + 2 / lam = 3 + 2², its root below 1: 0.2892
        assert "nominal strain of −0.71 instead of −0.8" in lines[0]
        assert "1.1 % of the specimen’s volume" in lines[0]


# Other choices, intervals from the profile, declared inputs


def shifts(row: dict[str, Any]) -> list[Any]:
    """The shifts of the parameters in a row of the choices."""
    return list(row.values())[2:-1]


def test_intervals_are_rounded_by_their_width_and_may_be_open() -> None:
    made = replace(MADE, profiles=(replace(profile(0.05, 0.02), alone=(np.nan, 1.02)),))
    (row,) = likelihood_tables(made)["verdicts"]
    # distances from 1.12: 0.17, 0.07, 0.10; rounded by 0.17 to hundredths
    assert row["ends"] == ["0.95", "1.05", "open", "1.02"]


@pytest.mark.parametrize(
    ("key", "sigma", "unit", "shown"),
    [
        ("poisson", 0.005, "1", "0.005"),
        ("curve_scale", 0.02, "1", "2 %"),
        ("clock_offset", 2e-6, "s", "2 µs"),
        ("specimen_length", 1e-5, "m", "10 µm"),
    ],
)
def test_declared_uncertainties_are_shown_in_their_units(
    key: str, sigma: float, unit: str, shown: str
) -> None:
    declared = Declaration(key=key, sigma=sigma, unit=unit, shifts={}, status="varied")
    (row,) = likelihood_tables(replace(MADE, systematic=(declared,)))["declared"]
    assert row["Standard uncertainty"] == shown


# Groups of shots, bars, cameras, weights of figures


def test_the_average_of_shots_has_twice_the_sample_standard_deviation() -> None:
    def shot(m: float) -> SimpleNamespace:
        terms = SimpleNamespace(phi_force=m, phi_shape=2.0 * m)
        return SimpleNamespace(
            history=SimpleNamespace(nominal_rate=100.0 * m), m=m, found=SimpleNamespace(terms=terms)
        )

    group: Any = SimpleNamespace(pooled=object(), counted=[shot(m) for m in (1.0, 2.0, 3.0, 4.0)])
    row = mean_and_scatter(group)
    # s² = 5/3 with n - 1: U = 2 s = 2.58
    assert (row["m"], row["U_m"], row["U_rate"], row["rate"]) == ("2.5", "2.6", "260", "250")
    assert row["U_phi_shape"] == "5.2"


def test_quoted_results_of_bars_have_k_2() -> None:
    result: Any = SimpleNamespace(
        budget=SimpleNamespace(results={"modulus": (2.5e6, 0.13e6, "Pa"), "arrival": (1e-3, 2e-6, "s")})
    )
    assert answers(result) == [
        {"Quantity": "modulus", "Value": "2.50", "U": "0.26", "Unit": "MPa"},
        {"Quantity": "arrival", "Value": "1000.0", "U": "4.0", "Unit": "µs"},
    ]
    assert (quantity(2e9, "Pa"), quantity(5e-3, "1"), quantity(2e-2, "1")) == ("2 GPa", "5000 µm/m", "0.02")


def test_parameters_of_cameras_have_k_2() -> None:
    camera = SimpleNamespace(fx=1000.0, fy=1.0, cx=1.0, cy=1.0, skew=0.0, distortion=(0.0,) * 5)
    rig = SimpleNamespace(cameras=(camera, camera), relative=(np.eye(3), np.array([0.1, 0.0, 0.0])))
    sigma = {"fx0": 0.25, "fx1": 0.25, "tx": 1e-5, "ty": 1e-5, "tz": 1e-5}
    checks = SimpleNamespace(fit_rms=0.1, held_out_rms=0.1, distance_ratio=1.0, distance_rms=0.0)
    found: Any = SimpleNamespace(
        checks=checks, sigma=sigma, rig=rig, free=("fx",), pairs=(), unit=1.0, clustering=1.0
    )
    rows = calibration_summary(found)
    assert rows["camera 0, fx"] == "1000.00 ± 0.50 px (k = 2)"
    assert rows["relative tx"] == "100.000 ± 0.020 mm (k = 2)"


def test_runs_are_weighted_by_noise_and_discrepancy_in_quadrature() -> None:
    result: Any = SimpleNamespace(
        comparison=SimpleNamespace(
            force_sigma=np.array([3.0, 3.0, 30.0]),
            centre_line=SimpleNamespace(time=np.zeros(1), sigma=np.array([1.0])),
        ),
        surrogate={"force_discrepancy": 4.0, "shape_discrepancy": 2.0},
        design=SimpleNamespace(chi2_force=np.array([25.0]), chi2_shape=np.array([10.0])),
    )
    # median noise 3: 25 · 9 / (9 + 16), and 10 · 1 / (1 + 4)
    np.testing.assert_allclose(weighted_chi2(result), [11.0])


def test_a_time_on_a_clock_that_runs_for_long_keeps_its_digits() -> None:
    assert quantity(58.300004196, "s") == "58.300004196 s"
    assert quantity(0.0999, "s") == "9.99e+04 µs"


def test_changes_are_the_parts_of_the_interval() -> None:
    made = in_display_units(synthetic())
    e = made.estimates["stiffness_factor"]
    named = parts(made, e)
    assert np.hypot.reduce(list(named.values())) == pytest.approx(e.sigma)  # nothing twice, nothing left out
    first, *_ = changes(made)
    words, sigma = next(iter(named.items()))
    assert sigma == max(named.values())
    half = 2.0 * np.sqrt(
        e.sigma**2 - sigma**2 + (0.5 * sigma) ** 2
    )  # the part itself halved, the others kept
    assert first.startswith(f"Halving the {words} would bring U of m from {2.0 * e.sigma:.4f} to {half:.4f} ")


def test_nothing_is_advised_from_parts_that_do_not_add_up() -> None:
    made = synthetic()
    e = replace(made.estimates["stiffness_factor"], noise_parts={"force and shape": 0.5})
    assert not [x for x in changes(replace(made, estimates={"stiffness_factor": e})) if "Halving" in x]


def test_what_was_not_varied_is_said() -> None:
    rows = {row["Choice"]: row for row in choices(in_display_units(synthetic()))}
    assert shifts(rows["End of the window"]) == [numbers.NOTHING]
    assert "Not varied" in rows["End of the window"]["What was done"]
    assert rows["Poisson’s ratio ν"]["What was done"] == "Not varied"


def test_parameters_in_sentences_have_their_words() -> None:
    text = "stiffness_factor is identified, friction is not seen"
    assert in_words(text, ["stiffness_factor", "friction"]) == (
        "stiffness factor m is identified, Coulomb friction f is not seen"
    )
    assert in_words("with friction as a parameter; mass_damping") == (
        "with friction as a parameter; mass-proportional damping α"
    )
    assert short("poisson") == "Poisson’s ratio ν"
