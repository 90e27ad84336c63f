"""Inputs of a test's budget by name and value, and their effects on the results in closed form."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from elastic_layer import Layer

from kolsky.bars.records import Quantity, Windows
from kolsky.bars.reduction.analyse import analyse
from kolsky.bars.reduction.varied_test import (
    VariedTest,
    bar_correlations,
    bar_quantities,
    budget_quantities,
    length_quantities,
    varied_bar,
    varied_position,
    varied_specimen,
)
from kolsky.bars.reduction.windows import StationInput, WavesInput
from kolsky.bars.signals.bridge import Linear
from kolsky.base.apparatus import Bar, Specimen
from kolsky.base.records import Recording

BAR = Bar(diameter=15e-3, length=1.5, youngs_modulus=190e9, density=8048.0, poisson=0.29)
SPECIMEN = Specimen(diameter=10e-3, length=5e-3, density=1200.0)
UNCERTAINTY = {
    "bar_modulus": 0.01,
    "bar_density": 0.002,
    "bar_diameter": 0.003,
    "bar_poisson": 0.004,
    "specimen_diameter": 0.005,
    "specimen_length": 0.006,
    "gauge_distance": 7e-4,
    "gauge_calibration": 0.008,
}


FEW = ("specimen_diameter", "specimen_length", "gauge_distance", "gauge_calibration")


def plain(quantities):
    return {q.name: (pytest.approx(q.value), pytest.approx(q.sigma), q.unit, q.kind) for q in quantities}


def test_quantities_of_a_bar():
    assert plain(bar_quantities(BAR, "incident", UNCERTAINTY)) == {
        "incident bar, Young's modulus": (190e9, 1.9e9, "Pa", "B"),
        "incident bar, density": (8048.0, 16.096, "kg/m^3", "B"),
        "incident bar, diameter": (15e-3, 45e-6, "m", "B"),
        "incident bar, Poisson's ratio": (0.29, 0.004, "1", "B"),
    }
    measured = bar_quantities(BAR, "incident", {**UNCERTAINTY, "bar_wave_speed": 0.001})
    assert (measured[0].name, measured[0].unit) == ("incident bar, wave speed", "m/s")
    assert measured[0].sigma == pytest.approx(1e-3 * BAR.wave_speed)


def test_quantities_of_lengths():
    positions = {"incident": 0.75, "transmission": 0.5, "incident far": 1.1}
    assert plain(length_quantities(SPECIMEN, positions, UNCERTAINTY)) == {
        "specimen, diameter": (10e-3, 50e-6, "m", "B"),
        "specimen, length": (5e-3, 30e-6, "m", "B"),
        "incident gauge, distance": (0.75, 7e-4, "m", "B"),
        "transmission gauge, distance": (0.5, 7e-4, "m", "B"),
        "incident far gauge, distance": (1.1, 7e-4, "m", "B"),
    }


def test_other_values_of_the_quantities():
    values = {
        "incident bar, density": 8000.0,
        "incident bar, wave speed": 5000.0,
        "incident bar, diameter": 0.016,
    }
    found = varied_bar(BAR, "incident", values)
    assert (found.youngs_modulus, found.density, found.diameter) == (pytest.approx(200e9), 8000.0, 0.016)
    assert varied_bar(BAR, "transmission", values) == BAR
    found = varied_bar(
        BAR, "incident", {"incident bar, Young's modulus": 2e11, "incident bar, Poisson's ratio": 0.3}
    )
    assert (found.youngs_modulus, found.poisson) == (2e11, 0.3)
    size = varied_specimen(SPECIMEN, {"specimen, diameter": 0.011, "specimen, length": 0.006})
    assert (size.diameter, size.length) == (0.011, 0.006)
    assert varied_position(0.5, "incident", {"incident gauge, distance": 0.6}) == 0.6
    assert varied_position(0.5, "transmission", {"incident gauge, distance": 0.6}) == 0.5


def given(**changes):
    """A test in a made-up record: an elastic specimen, strains recorded as such."""
    scene = Layer(rise=30e-6)
    signals = scene.signals(noise=1e-6)
    stations = {}
    for side, signal in zip(("incident", "transmission"), signals, strict=True):
        strain = signal.strain
        recording = Recording(strain.time, strain.value, side, "1", Path("scope.csv"), "0" * 64)
        stations[side] = StationInput(
            (recording,), Linear(1.0, unit="1"), signal.position, (strain.start, strain.start + 20e-6), 0.0, 1
        )
    bars = {"incident": scene.first, "transmission": scene.second}
    options = {"stations": stations, "bars": bars, "uncertainty": UNCERTAINTY, **changes}
    return WavesInput("made", scene.specimen, **options)


def test_every_input_is_in_the_budget():
    test = given()
    zero = Quantity("{} gauge, zero", 0.0, 1e-7, "1", "A", 10.0)
    stations = {
        side: SimpleNamespace(quantities=[replace(zero, name=f"{side} gauge, zero")]) for side in test.bars
    }
    names = {q.name for q in budget_quantities(test, stations)}
    assert names == {
        "specimen, diameter",
        "specimen, length",
        "specimen, density",
        *(
            f"{side} {what}"
            for side in ("incident", "transmission")
            for what in (
                "gauge, zero", "gauge, distance", "bar, Young's modulus", "bar, density", "bar, diameter",
                "bar, Poisson's ratio",
            )
        ),
    }  # fmt: skip


def test_bars_of_one_rod_have_their_errors_in_common():
    quantities = [*bar_quantities(BAR, "incident", {}), *bar_quantities(BAR, "transmission", {})]
    assert bar_correlations(given(), quantities) == {}
    assert bar_correlations(given(alike=True), quantities) == {
        (f"incident bar, {what}", f"transmission bar, {what}"): 1.0
        for what in ("Young's modulus", "density", "diameter", "Poisson's ratio")
    }
    assert bar_correlations(given(alike=True), quantities[:4]) == {}


def test_shares_of_the_budget_are_those_of_the_formulas():
    """Three-wave stress: E A (e_i + e_r + e_t) / 2 A_s; strain: c / L times integrals."""
    found = analyse(given(uncertainty={key: UNCERTAINTY[key] for key in FEW}))
    stress, sigma, _ = found.budget.results["peak stress"]
    strain, spread, _ = found.budget.results["largest strain"]
    rows = {row.quantity.name: row for row in found.budget.contributions}
    # Stress goes with 1 / d^2, strain with 1 / L; both with the calibration, of which the incident gauge's
    # waves and the transmitted one's carry half the stress each in equilibrium.
    assert rows["specimen, diameter"].shares["peak stress"] == pytest.approx(
        (2 * 0.005 * stress / sigma) ** 2, rel=1e-3
    )
    assert rows["specimen, length"].shares["largest strain"] == pytest.approx(
        (0.006 * strain / spread) ** 2, rel=1e-3
    )
    assert rows["specimen, length"].shares["peak stress"] == pytest.approx(0.0, abs=1e-9)
    half = (0.5 * 0.008 * stress / sigma) ** 2
    assert rows["transmission gauge, strain per volt"].shares["peak stress"] == pytest.approx(half, rel=0.2)
    for side in ("incident", "transmission"):
        assert rows[f"{side} gauge, distance"].quantity.sigma == 7e-4
        assert rows[f"{side} gauge, distance"].shares["largest strain"] > 1e-4
    for name in found.budget.results:
        assert sum(row.shares.get(name, 0.0) for row in rows.values()) == pytest.approx(1.0)
    band = found.reduction.stress["three waves"]
    # The combined one, not noise alone; the peak's sample moves a little with the inputs.
    assert band.sigma[np.abs(band.value).argmax()] == pytest.approx(sigma, rel=0.01)


def test_the_model_of_the_budget_holds_its_windows():
    test = given()
    windows = Windows((-160e-6, 0.0), (150e-6, 310e-6), (95e-6, 255e-6), source="shot file")
    varied = VariedTest(test, windows, -0.75 / BAR.wave_speed)
    near = varied.carried({}, dispersive=False)
    scaled = varied.carried({"transmission gauge, strain per volt": 1.1}, dispersive=False)
    np.testing.assert_allclose(scaled.transmitted, 1.1 * near.transmitted, atol=1e-15)
    np.testing.assert_array_equal(scaled.incident, near.incident)
    moved = varied.carried(
        {"transmission gauge, distance": 0.5 + 4 * 1e-7 * BAR.wave_speed}, dispersive=False
    )
    assert moved.transmitted[:-4] == pytest.approx(near.transmitted[4:], abs=1e-9)  # four samples of 0.1 us
