"""Declared uncertainties: what each does to the data vector, in closed form, with runs made up."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from doe import Box
from kolsky.base.records import CentreLine, ForceHistory
from kolsky.inverse.objective import Objective
from kolsky.inverse.observations import observe
from kolsky.inverse.parameters import PARAMETERS
from kolsky.inverse.uncertainty_results import Declaration
from kolsky.uncertainty.analyse import UncertaintyAnalysis
from kolsky.uncertainty.profile_likelihood import LinearisedOptimum
from kolsky.uncertainty.systematic import DeclaredInput

FloatArray = NDArray[np.float64]
TIME = np.linspace(0.0, 1e-3, 101)
FRAMES = np.array([0.25e-3, 0.75e-3])


def objective() -> Objective:
    """Ten bins of a force of 1e5 N/s, and two points of an outline."""
    line = CentreLine(FRAMES, np.arange(2), np.array([1e-3, 2e-3]), np.array([5e-3, 6e-3]), np.full(2, 1e-6))
    history = ForceHistory(TIME, 1e5 * TIME, np.full(TIME.size, 0.5))
    return Objective(observe(history, line, window=(0.0, 1e-3), bin_width=1e-4), np.ones(2, dtype=bool))


class Quadratic(DeclaredInput):
    """Runs whose data vector is 3 p + 2 p^2 of the parameter p in every entry."""

    def run(self, forward: Any, **named: float) -> Any:
        (value,) = named.values() if named else (forward.shot.interface.friction,)
        return value

    def vector(self, response: Any) -> FloatArray:
        return np.full(len(self.objective.data), 3.0 * response + 2.0 * response**2)


def made(
    key: str, sigma: float, reference: Any, kind: type[DeclaredInput] = Quadratic, **held: float
) -> DeclaredInput:
    one = objective()
    interface = SimpleNamespace(friction=0.1, faces="coulomb", side="coulomb")
    shot = SimpleNamespace(
        model=SimpleNamespace(poisson=0.4, damping=0.0, mass_damping=0.0), interface=interface
    )
    stages: Any = SimpleNamespace(
        observations=one.observations,
        prepared=SimpleNamespace(forward=SimpleNamespace(shot=shot)),
        settings=SimpleNamespace(held=held, numerics=None),
        box=Box.of({"stiffness_factor": (0.5, 1.5)}),
    )
    return kind(key, sigma, stages, np.ones(1), one, reference)


def test_a_larger_sensitivity_is_a_smaller_force() -> None:
    change = made("sensitivity", 0.02, None).change()
    # Prediction minus data rises where the data fall, by their share; the outline stays.
    np.testing.assert_allclose(change[:10], 0.02 * objective().data[:10], rtol=1e-15)
    np.testing.assert_array_equal(change[10:], 0.0)


def test_a_later_clock_is_a_force_of_an_earlier_time() -> None:
    steep = SimpleNamespace(force_times=TIME, force_transmission=np.array([2e5 * TIME]))
    change = made("clock_offset", 1e-6, steep).change()
    # The model's own slope of 2e5 N/s times 1 us.
    np.testing.assert_allclose(change[:10], 0.2, rtol=1e-9)
    np.testing.assert_array_equal(change[10:], 0.0)


def test_an_axis_further_away_is_an_outline_further_out() -> None:
    change = made("Z_offset", 3e-6, None).change()
    np.testing.assert_array_equal(change[:10], 0.0)
    np.testing.assert_allclose(change[10:], -3e-6, rtol=1e-15)


def test_a_parameter_is_moved_to_both_sides_or_to_the_one_that_is_allowed() -> None:
    # Central: ((3 + 4 p) sigma) at p = 0.4, exact for a quadratic.
    np.testing.assert_allclose(made("poisson", 0.05, 0.4).change(), (3.0 + 1.6) * 0.05, rtol=1e-12)
    # No Poisson's ratio above 0.4999: p(0.4) - p(0.3), which is 0.3 + 2 (0.16 - 0.09).
    np.testing.assert_allclose(made("poisson", 0.1, 0.4).change(), 0.44, rtol=1e-12)
    # No damping below zero: p(0.001) - p(0).
    np.testing.assert_allclose(made("damping", 1e-3, 0.0).change(), 3e-3 + 2e-6, rtol=1e-12)


def test_friction_that_is_not_named_is_changed_in_the_shot(monkeypatch: pytest.MonkeyPatch) -> None:
    def changed(shot: Any, value: float) -> Any:
        return SimpleNamespace(interface=SimpleNamespace(friction=value))

    monkeypatch.setitem(PARAMETERS, "friction", replace(PARAMETERS["friction"], changed=changed))
    monkeypatch.setattr(
        "kolsky.uncertainty.systematic.replace", lambda forward, shot: SimpleNamespace(shot=shot)
    )
    named: list[str] = []

    class Told(Quadratic):
        def run(self, forward: Any, **given: float) -> Any:
            named.extend(given)
            return super().run(forward, **given)

    np.testing.assert_allclose(made("friction", 0.1, 0.1, Told).change(), 3.4 * 0.1, rtol=1e-12)
    assert named == []
    # Held, it makes everything slide already.
    np.testing.assert_allclose(made("friction", 0.1, 0.5, Told, friction=0.5).change(), 5.0 * 0.1, rtol=1e-12)
    assert named == ["friction", "friction"]


def test_declared_parts_add_in_quadrature() -> None:
    def part(key: str, shift: float) -> Declaration:
        return Declaration(key, 0.1, "1", {"stiffness_factor": shift}, "varied")

    silent = Declaration("y_offset", float("nan"), "m", {}, "not declared, counted as exact")
    analysis = UncertaintyAnalysis(
        systematic=(part("poisson", 0.03), part("damping", -0.04), part("sensitivity", 0.12), silent),
        profiles=(),
        ridge=None,
        posterior=None,
        found=None,
        warnings=(),
        runs=0,
    )
    assert analysis.sigma_systematic("stiffness_factor") == pytest.approx(0.13, rel=1e-12)
    assert analysis.sigma_systematic("friction") == 0.0


def test_correlation_is_the_sandwich_over_the_independent_variance_never_below_one() -> None:
    n = 40
    pairs = np.tile([1.0, 1.0, -1.0, -1.0], 10)
    edges = 2.0**-17 * np.arange(n + 1)
    for residual, expected in ((3.0 * pairs, 20 * 0.0225 * 20.0 / 19.0), (0.0 * pairs, None)):
        history = ForceHistory(np.linspace(0.0, edges[-1], 401), np.zeros(401), np.full(401, 0.3))
        seen = observe(history, None, window=(0.0, float(edges[-1])), bin_width=2.0**-17)
        bins = replace(seen.bins, edges=edges, mean=residual, sigma=np.full(n, 0.3))
        one = Objective(replace(seen, bins=bins), np.zeros(0, dtype=bool))
        slope = np.ones((n, 1))
        found = LinearisedOptimum(
            np.ones(1), Box.of({"m": (0.0, 2.0)}), one, np.zeros(n), slope, np.zeros((n, 1))
        )
        ratio = 1.0 if expected is None else expected / (0.09 / n)
        np.testing.assert_allclose(found.correlation, [ratio], rtol=1e-9)
