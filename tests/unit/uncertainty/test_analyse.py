"""Other results of identify for open-01: profiles, declared uncertainties, posterior."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from doe import Box, ResponseSurrogate, full_factorial
from kolsky.base.records import ForceHistory
from kolsky.identification import identify
from kolsky.inverse.coarse_search import CorrectedSurrogate
from kolsky.inverse.objective import Objective
from kolsky.inverse.observations import observe
from kolsky.inverse.problem import prepare_shot
from kolsky.inverse.result import POSTERIOR, PROFILE, Declaration, Identification
from kolsky.inverse.settings import Numerics, Settings
from kolsky.report.scene.scene_data import scene_of
from kolsky.shot.load import load_shot
from kolsky.uncertainty.analyse import UncertaintyAnalysis, noise_shares
from kolsky.uncertainty.profiles import LinearisedOptimum, full_likelihood, reduced_likelihood

OPEN_01 = Path(__file__).parents[3] / "runs" / "open-01"
COARSE = Settings(
    free={"stiffness_factor": (1.0, 1.25)},
    numerics=Numerics(mesh=(12, 16)),
    refined_mesh=(18, 24),
    replicates=0,
)
DECLARED = {
    "poisson": 5e-4, "friction": 0.1, "curve_scale": 0.01, "specimen_density": 0.01, "sensitivity": 0.01,
    "Z_offset": 0.0, "y_offset": 5e-6,
}  # fmt: skip


@pytest.fixture(scope="module")
def found() -> Identification:
    return identify(replace(load_shot(OPEN_01), uncertainty=DECLARED), COARSE)


def _shift(found: Identification, key: str) -> float:
    part = next(part for part in found.systematic if part.key == key)
    return part.shifts["stiffness_factor"]


def test_scale_of_the_curve_is_the_stiffness_factor_itself(found: Identification) -> None:
    """m multiplies the curve: a curve higher by 1 % gives an m lower by 1 %, whatever the mesh."""
    m = found.estimates["stiffness_factor"].value
    # Both slopes are central differences, over 1 % and 0.45 % of m, of forces that ring in so coarse a mesh.
    assert _shift(found, "curve_scale") == pytest.approx(-0.01 * m, rel=0.05)


def test_density_force_and_stiffness_scale_together(found: Identification) -> None:
    """Density, force and m larger by the same factor leave every motion as it is."""
    m = found.estimates["stiffness_factor"].value
    # A larger sensitivity is a smaller force.
    together = _shift(found, "specimen_density") - _shift(found, "sensitivity")
    assert together == pytest.approx(0.01 * m, rel=0.05)  # as above


def test_the_scale_of_the_curve_is_invisible_and_density_is_a_force_gain(found: Identification) -> None:
    parts = {part.key: part for part in found.systematic}
    # Its direction is m times the parameter's; what is left is the error of two central differences.
    assert parts["curve_scale"].visible < 1e-3
    assert parts["specimen_density"].alike == ("sensitivity",)
    assert parts["sensitivity"].alike == ("specimen_density",)
    assert parts["sensitivity"].visible > 0.5
    # d ln m: of density less that of the force's scale is 1, of the curve -1.
    moves = {key: part.moves["stiffness_factor"] for key, part in parts.items() if part.moves}
    m = found.estimates["stiffness_factor"].value
    together = moves["specimen_density"] - moves["sensitivity"]
    assert together == pytest.approx(0.01 * m, rel=0.02)  # central differences of what rings
    assert moves["curve_scale"] == pytest.approx(-0.01 * m, rel=0.02)  # as above
    # What is undeclared has its sensitivity too.
    assert parts["specimen_length"].status == "not declared, counted as exact"
    assert moves["specimen_length"] != 0.0


def test_declared_parts_are_listed_and_add_up(found: Identification) -> None:
    status = {part.key: part.status for part in found.systematic}
    assert status["poisson"] == "varied"
    assert status["damping"] == "not declared, counted as exact"
    assert status["friction"] == "no effect: nothing slides"
    assert status["Z_offset"] == "declared exact"
    e = found.estimates["stiffness_factor"]
    shifts = [part.shifts["stiffness_factor"] for part in found.systematic if part.shifts]
    assert len(shifts) == 5
    assert e.sigma_systematic == pytest.approx(np.sqrt(np.sum(np.square(shifts))), rel=1e-12)
    assert e.sigma > e.sigma_systematic > e.sigma_noise


def test_profile_agrees_with_curvature_and_answer(found: Identification) -> None:
    (profile,) = found.profiles
    low, high = profile.interval
    e = found.estimates["stiffness_factor"]
    # 1.96 sigma to both sides, the front face's noise among them, but for what curvature of the response adds
    # to Gauss and Newton's: residuals on so coarse a mesh are large. The stated sigma is no smaller than if
    # all noise were each entry's own; the profile, which knows what is common, is narrower by that.
    own = np.hypot(e.noise_parts["force and shape"], e.noise_parts.get("flyer motion", 0.0))
    assert 0.7 < 0.5 * (high - low) / (1.96 * own) < 1.2
    assert profile.verdict == "identified"
    assert 0.0 < profile.error < profile.level  # so coarse a mesh rings; the slow test has a better one
    method = next(method for method in found.methods if method.name == PROFILE)
    # Its slopes at the answer are the answer's: what is left is curvature over a step that was not taken.
    assert abs(method.distances["stiffness_factor"]) < 0.02
    assert found.ridge is None
    assert found.posterior is None


@pytest.fixture(scope="module")
def surrogate() -> tuple[CorrectedSurrogate, Objective, Box]:
    """A surrogate of open-01 on a mesh that is too coarse for anything but algebra."""
    prepared = prepare_shot(load_shot(OPEN_01))
    box = Box.of({"stiffness_factor": (1.05, 1.2)})
    points = full_factorial(box, 5).points
    from kolsky.inverse.observations import predict

    response = prepared.forward.run({"stiffness_factor": points[:, 0]}, Numerics(mesh=(8, 11)))
    prediction = predict(response, prepared.observations)
    objective = Objective(prepared.observations, np.asarray(prediction.inside.all(axis=0)))
    vectors = objective.vectors(prediction)
    model = CorrectedSurrogate(ResponseSurrogate.fit(box, points, vectors, scale=objective.noise))
    model = model.through(np.array([1.13]), vectors[3], 0.1 * (vectors[3] - vectors[2])[:, None])
    return model, objective.with_discrepancy(vectors[2]), box


def test_reduced_likelihood_is_the_whole_one(surrogate: tuple[CorrectedSurrogate, Objective, Box]) -> None:
    model, objective, box = surrogate
    short, whole = reduced_likelihood(model, objective, box), full_likelihood(model, objective, box)
    u = np.linspace(0.0, 1.0, 7)[:, None]
    chi2 = objective.chi2(model.predict(box.scale(u)))
    brief = (short.residuals(u) ** 2).sum(axis=1)
    assert len(short.data) < 10 < len(whole.data)
    np.testing.assert_allclose(brief, chi2, rtol=1e-9)  # round-off of a QR of 2,500 rows
    full = [whole.deviance(r) for r in whole.residuals(u)]
    np.testing.assert_allclose(np.diff(full), np.diff(chi2), rtol=1e-9)  # they differ by a constant


@pytest.mark.slow
def test_what_the_data_cannot_see_is_said() -> None:
    free = {"stiffness_factor": (1.0, 1.25), "mass_damping": (0.0, 1e-3)}
    found = identify(OPEN_01, replace(COARSE, free=free))  # a folder is loaded
    m, alpha = found.profiles
    # 1e-3 1/s over 1.4 ms dissipates a millionth, which no force of 0.03 N and no 4 um tell.
    assert alpha.verdict == "not seen"
    assert np.isnan(alpha.interval).all()
    assert m.verdict == "identified"
    assert found.ridge.names == ("stiffness_factor", "mass_damping")
    assert any("mass_damping is not seen" in warning for warning in found.warnings)


@pytest.mark.slow
def test_posterior_agrees_with_the_profile() -> None:
    pytest.importorskip("emcee")
    finer = replace(COARSE, numerics=Numerics(mesh=(18, 24)), refined_mesh=(32, 44))
    found = identify(load_shot(OPEN_01), replace(finer, bayes=True))
    assert found.posterior.converged
    assert found.profiles[0].error <= 0.1 * found.profiles[0].level  # confirmed by runs along it
    assert found.posterior.names == ("stiffness_factor", "force_discrepancy", "shape_discrepancy")
    low, high = found.profiles[0].interval
    # Flat prior and nearly a parabola: the same interval, but for discrepancies that vary too, and the
    # quantiles of some thousand samples (3 % of the length).
    assert found.posterior.lower[0] == pytest.approx(low, abs=0.15 * (high - low))
    assert found.posterior.upper[0] == pytest.approx(high, abs=0.15 * (high - low))
    for name in (PROFILE, POSTERIOR):
        method = next(method for method in found.methods if method.name == name)
        assert method.converged
        assert abs(method.distances["stiffness_factor"]) < 0.25


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
    answer: Any = SimpleNamespace(
        objective=SimpleNamespace(covariance=lambda slope, vector: np.array([[0.13**2 / 3.0]])),
        slope=None,
        vector=None,
        local=Box.of({"stiffness_factor": (0.9, 1.4)}),
    )
    assert noise_shares(answer, analysis.systematic) == pytest.approx([0.25], rel=1e-12)
    assert noise_shares(answer, ()) == pytest.approx([1.0])


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


def test_the_specimen_of_the_pictures_is_undeformed_before_the_impact(found: Identification) -> None:
    """The picture uses the mesh of the answer. Another grading would show stretches from 0.6 to 1.4."""
    scene = scene_of(found, chosen=lambda n: [0])
    np.testing.assert_allclose(scene.values[0], 1.0, atol=1e-12)  # round-off
