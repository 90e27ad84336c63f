"""Budgets of routes and of their difference on a linear problem whose covariance is known."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from kolsky.inverse.estimates import RouteOptimum
from kolsky.uncertainty.budgets import (
    InputChanges,
    Sources,
    budgeted,
    noise_parts,
    root_sum_squares,
    route_difference,
)
from kolsky.uncertainty.mesh_error import MeshChange

RNG = np.random.default_rng(4)
N, K = 12, 30
"""Entries of the force, and of all the data."""
JACOBIAN = np.column_stack([np.linspace(1.0, 3.0, K), np.cos(0.7 * np.arange(K))])
SIGMA = np.where(np.arange(K) < N, 0.2, 0.5)
FLYER = RNG.normal(size=(40, K)) @ (0.3 * RNG.normal(size=(K, K)))
"""Changes by forty replicates; their mean square is the covariance that is true here."""
NAMES = ("stiffness_factor", "damping")


def gain(part: str) -> np.ndarray:
    """Least squares on a part of the data, as a map of all of them."""
    weight = SIGMA**-2 * {"joint": 1.0, "force": np.arange(K) < N, "shape": np.arange(K) >= N}[part]
    return np.linalg.solve((JACOBIAN.T * weight) @ JACOBIAN, JACOBIAN.T * weight)


def optimum(part: str, x: tuple[float, float]) -> RouteOptimum:
    G = gain(part)
    names = {"joint": "joint", "force": "force only", "shape": "shape only"}
    return RouteOptimum(names[part], part, np.array(x), 1.0, G, (G * SIGMA**2) @ G.T)


def sources(mesh: np.ndarray | None = None) -> Sources:
    coarser = np.zeros(K) if mesh is None else mesh
    return Sources(InputChanges({"flyer motion": FLYER}, {}), MeshChange(coarser, np.zeros(K), 2.0))


def drawn(n: int) -> np.ndarray:
    """Data of which the noise and the flyer's part are drawn from what is true."""
    rng = np.random.default_rng(9)
    flyer = rng.normal(size=(n, len(FLYER))) @ FLYER / np.sqrt(len(FLYER))
    return SIGMA * rng.normal(size=(n, K)) + flyer


def test_the_budget_of_a_route_is_what_draws_scatter_by() -> None:
    n = 20_000
    for part in ("joint", "force", "shape"):
        said = budgeted(NAMES, optimum(part, (1.0, 2.0)), sources())
        scatter = (drawn(n) @ gain(part).T).std(axis=0)
        # A standard deviation of n draws is known to 1 / sqrt(2 n) of itself; four times that.
        np.testing.assert_allclose(list(said.sigma.values()), scatter, rtol=4.0 / np.sqrt(2.0 * n))
        flyer = next(part.sigma for part in said.budget if part.source == "flyer motion")
        covariance = gain(part) @ (FLYER.T @ FLYER / len(FLYER)) @ gain(part).T
        np.testing.assert_allclose(list(flyer.values()), np.sqrt(np.diag(covariance)), rtol=1e-12)


def test_the_difference_has_a_budget_of_its_own() -> None:
    n = 20_000
    force, shape = optimum("force", (1.5, 2.0)), optimum("shape", (1.0, 2.25))
    found = route_difference(NAMES, [optimum("joint", (1.2, 2.1)), force, shape], sources())
    assert found.values == {"stiffness_factor": 0.5, "damping": -0.25}
    scatter = (drawn(n) @ (gain("force") - gain("shape")).T).std(axis=0)
    np.testing.assert_allclose(list(found.sigma.values()), scatter, rtol=4.0 / np.sqrt(2.0 * n))
    # Not the sum of the two routes' own: the flyer moves both.
    apart = [budgeted(NAMES, one, sources()).sigma["stiffness_factor"] for one in (force, shape)]
    assert abs(found.sigma["stiffness_factor"] / np.hypot(*apart) - 1.0) > 0.02


def test_what_moves_both_alike_is_no_part_of_their_difference() -> None:
    # A change of the data like that of a parameter moves every least-squares answer by the same.
    alike = Sources(
        InputChanges(
            {"flyer motion": np.outer([0.3, -0.3], JACOBIAN[:, 0])}, {"force scale": JACOBIAN[:, 1]}
        ),
        MeshChange(0.1 * JACOBIAN[:, 0], JACOBIAN[:, 1], 2.0),
    )
    pair = [optimum("force", (1.0, 2.0)), optimum("shape", (1.0, 2.0))]
    found = route_difference(NAMES, pair, alike)
    assert found.values == pytest.approx({"stiffness_factor": 0.0, "damping": 0.0}, abs=1e-12)
    own = root_sum_squares({"residuals": np.sqrt(np.diag(pair[0].residual + pair[1].residual))})
    np.testing.assert_allclose(list(found.sigma.values()), own, rtol=1e-12)
    # Each alone has it all: 0.3 of the flyer, and of the mesh what an order of 2.1 corrects more than 3.2.
    parts = {part.source: part.sigma for part in budgeted(NAMES, pair[0], alike).budget}
    assert parts["flyer motion"]["stiffness_factor"] == pytest.approx(0.3)
    assert parts["force scale"]["damping"] == pytest.approx(1.0)
    assert parts["mesh"]["stiffness_factor"] == pytest.approx(0.1 / (2.0**2.1 - 1.0) - 0.1 / (2.0**3.2 - 1.0))


def test_declared_inputs_are_counted_by_each_map() -> None:
    rows = np.stack([JACOBIAN[:, 0] * (np.arange(K) < N), 2.0 * JACOBIAN[:, 1]])
    declared = replace(sources(), declared=np.sqrt(2.0) * rows)
    pair = [optimum("force", (1.0, 2.0)), optimum("shape", (1.0, 2.0))]
    parts = [{p.source: p.sigma for p in budgeted(NAMES, one, declared).budget} for one in pair]
    assert parts[0]["declared inputs"] == pytest.approx({"stiffness_factor": 1.0, "damping": 2.0})
    assert parts[1]["declared inputs"] == pytest.approx({"stiffness_factor": 0.0, "damping": 2.0}, abs=1e-12)
    found = route_difference(NAMES, pair, declared)
    apart = {p.source: p.sigma for p in found.budget}["declared inputs"]
    assert apart == pytest.approx({"stiffness_factor": 1.0, "damping": 0.0}, abs=1e-12)


def test_a_rough_response_counts_as_each_map_makes_of_it() -> None:
    """Two runs that deviate like a parameter, one in the force alone: 0.3 and 0.4 move the joint optimum; the
    route of the force by 0.3 and 0.4, that of the outline by 0.4 alone, and their difference by 0.3."""
    rough = np.stack([0.3 * JACOBIAN[:, 0] * (np.arange(K) < N), 0.4 * JACOBIAN[:, 0]])
    given = replace(sources(), deviations=rough)
    pair = [optimum("force", (1.0, 2.0)), optimum("shape", (1.0, 2.0))]
    parts = [{p.source: p.sigma for p in budgeted(NAMES, one, given).budget} for one in pair]
    assert parts[0]["roughness"] == pytest.approx({"stiffness_factor": 0.5, "damping": 0.0}, abs=1e-12)
    assert parts[1]["roughness"] == pytest.approx({"stiffness_factor": 0.4, "damping": 0.0}, abs=1e-12)
    found = route_difference(NAMES, pair, given)
    apart = {p.source: p.sigma for p in found.budget}["roughness"]
    assert apart == pytest.approx({"stiffness_factor": 0.3, "damping": 0.0}, abs=1e-12)
    assert sources().roughness(gain("joint")) is None


def test_a_route_is_corrected_by_its_own_map() -> None:
    mesh = np.where(np.arange(K) < N, 0.2, 0.0)  # of the force alone
    for part in ("force", "shape"):
        said = budgeted(NAMES, optimum(part, (1.0, 2.0)), sources(mesh))
        move = gain(part) @ mesh / (2.0**3.2 - 1.0)
        np.testing.assert_allclose(list(said.correction.values()), move, atol=1e-15)
        np.testing.assert_allclose(list(said.parameters.values()), move + np.array([1.0, 2.0]), rtol=1e-12)
        assert said.on_mesh("stiffness_factor") == pytest.approx(1.0, rel=1e-12)
    pair = [optimum("force", (1.0, 2.0)), optimum("shape", (1.0, 2.0))]
    found = route_difference(NAMES, pair, sources(mesh))
    assert found is not None
    move = gain("force") @ mesh / (2.0**3.2 - 1.0)  # the outline has none
    np.testing.assert_allclose(list(found.values.values()), move, rtol=1e-12)


def test_without_an_outline_there_is_no_difference() -> None:
    assert route_difference(NAMES, [optimum("force", (1.0, 2.0))], sources()) is None


def test_the_answer_counts_residuals_replicates_and_scales() -> None:
    objective = SimpleNamespace(
        gain=lambda slope: np.linalg.pinv(slope),
        residual_covariance=lambda slope, vector: np.diag([4.0, 9.0]),
    )
    fine = SimpleNamespace(
        objective=objective,
        jacobian=JACOBIAN,
        x=np.zeros(2),
        model=lambda x: np.zeros((1, K)),
    )
    changes = InputChanges({"flyer motion": JACOBIAN[:, :1].T}, {"force scale": JACOBIAN[:, 0]})
    found = noise_parts(fine, Sources(changes, MeshChange(np.zeros(K), None, 2.0)))  # type: ignore[arg-type]
    np.testing.assert_allclose(found["force and shape"], [2.0, 3.0])
    np.testing.assert_allclose(found["flyer motion"], [1.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(found["force scale"], [1.0, 0.0], atol=1e-12)
