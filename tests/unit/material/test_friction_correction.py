"""The correction of end friction: its band, the weights of the laws, rejected inputs."""

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import chi2

from kolsky.base.apparatus import Specimen
from kolsky.material.end_friction import correct, fits
from kolsky.material.end_friction.correct import (
    DRIFTS,
    _correction,
    _drift_remark,
    _poisson_change,
    _range_drift,
    cause_of_misfit,
    correct_friction,
    range_drift,
    slow_change,
    slow_error,
)
from kolsky.material.end_friction.fits import ModelOptimum, bic, local_rms, model_weights, on_refined_mesh
from kolsky.material.end_friction.problem import CorrectionNumerics, EndFriction, MeasuredSpecimen, ModelFit
from kolsky.material.reference_curve import model_summary
from kolsky.material.uniaxial import CurveBand

N = 16
STRAIN = np.linspace(0.05, 0.5, N)
SPECIMEN = Specimen(diameter=9.5e-3, length=6.5e-3, density=0.0)
FINER = 0.004
"""The made refined mesh is softer by this much, relative to stress."""


class Factor:
    """A model with one unknown: T = exp(x) 10 kPa times the strain."""

    name, bounds = "factor", (np.full(1, -np.inf), np.full(1, np.inf))

    def __init__(self, off=0.0):
        self.off = off

    def stress(self, theta, strain):
        return np.exp(theta[0] + self.off * strain) * 1e4 * strain

    def prior(self, theta):
        return np.zeros(0), np.zeros((0, 1))


@dataclass(frozen=True)
class Made(MeasuredSpecimen):
    """Simulated tests in closed form: S = 1.3 T, `FINER` less on the refined mesh; 2 e a unit of friction."""

    def simulate(self, model, theta, *, refined=False, derivatives=True):
        S = 1.3 * model.stress(theta, self.strain) * np.exp(-FINER if refined else 0.0)
        by = np.column_stack([S, 2.0 * S * self.strain])
        bulge = np.full(N, 1e-3 + (2e-6 if refined else 0.0))
        return SimpleNamespace(stress=S, stress_by=by, bulge=bulge, past=0.3, snaps=1)


def made_test(ends=None, noise=0.01):
    S = 1.3e4 * STRAIN
    return Made(STRAIN, S, np.full(N, noise), SPECIMEN, ends or EndFriction("bonded"), CorrectionNumerics())


def found(test, off=0.0, theta=0.0, refined=True):
    model = Factor(off)
    x = np.array([theta])
    made = test.simulate(model, x)
    J = np.ones((N, 1)) / test.noise[:, None]
    missed = np.log(made.stress / test.stress)
    mesh = test.simulate(model, x, refined=True) if refined else None
    return ModelOptimum(model, x, made, J, float(np.sum((missed / test.noise) ** 2)), missed, mesh)


def band(noise=0.0, mode=None):
    S = 1.3e4 * STRAIN
    modes = np.empty((0, N)) if mode is None else mode[None] * S
    return CurveBand(STRAIN, S, noise * S, modes, () if mode is None else ("between tests",))


@pytest.fixture
def plain(monkeypatch):
    row = SimpleNamespace(weight=1.0)
    monkeypatch.setattr(correct, "model_fit", lambda *a: row)


def test_the_curve_moves_to_the_refined_mesh_with_a_share_in_the_band(plain):
    """The force falls by 0.4 % with the mesh, so the curve rises by it; share 1.25 / 2 over 1.5^2 - 1."""
    test = made_test()
    fits, test = on_refined_mesh([found(test, refined=False)], test)
    made = _correction(band(), test, fits, np.ones(1), [])
    np.testing.assert_allclose(made.band.stress, 1e4 * STRAIN * np.exp(FINER), rtol=1e-9)
    np.testing.assert_allclose(
        made.band.parts()["mesh"] / made.band.stress, FINER * 0.5 * 1.25 / (1.5**2 - 1.0), rtol=1e-9
    )
    # An error of the force that is common to all strains goes into the one unknown whole.
    np.testing.assert_allclose(made.band.parts()["elements"] / made.band.stress, 6e-4, rtol=1e-9)
    np.testing.assert_allclose(made.ratio, 1.3 * np.exp(-FINER))
    assert (made.past_data, made.snaps, made.coefficient) == (0.3, 1, None)


def test_noise_and_modes_of_the_test_are_modes_of_the_curve(plain):
    """One unknown averages n points: noise over root n, a mode by its mean."""
    test = made_test()
    mode = np.linspace(0.0, 0.02, N)
    made = _correction(band(0.03, mode), test, [found(test)], np.ones(1), [])
    parts = {name: part / made.band.stress for name, part in made.band.parts().items() if name != "noise"}
    noise = np.sqrt(
        sum(row**2 for row, name in zip(made.band.modes, made.band.names, strict=True) if name == "noise")
    )
    np.testing.assert_allclose(noise / made.band.stress, 0.03 / np.sqrt(N), rtol=1e-6)
    np.testing.assert_allclose(parts["between tests"], 0.01, rtol=1e-6)
    assert not made.band.noise.any()


def test_a_misfit_larger_than_the_noise_is_in_the_band(plain):
    test = made_test()
    one = found(test, theta=0.02)  # simulated 2 % above the test at every strain
    made = _correction(band(0.001), test, [one], np.ones(1), [])
    rows = [row for row, name in zip(made.band.modes, made.band.names, strict=True) if name == "noise"]
    # Alike at every strain: (1 + 0.9) / (1 - 0.9) = 19 times the variance of independent ones.
    expected = 0.02 * np.sqrt(19.0 / N)
    np.testing.assert_allclose(np.sqrt(sum(r**2 for r in rows)) / made.band.stress, expected, rtol=1e-6)


def test_the_spread_of_laws_is_in_the_band(plain):
    """Two laws of weights 0.8 and 0.2, d apart: variance 0.16 d^2, the mean 0.2 d from the first."""
    test = made_test()
    laws = [found(test), found(test, off=0.1)]
    made = _correction(band(), test, laws, np.array([0.8, 0.2]), [])
    d = 0.1 * STRAIN
    np.testing.assert_allclose(made.band.parts()["law"] / made.band.stress, 0.4 * d, rtol=1e-9)
    np.testing.assert_allclose(made.band.stress, 1e4 * STRAIN * np.exp(0.2 * d), rtol=1e-9)


def test_a_declared_frictions_sigma_is_in_the_band(plain):
    """ln S rises by 2 e per unit of friction; the one unknown takes the mean of it away from T."""
    test = made_test(EndFriction("coulomb", 0.3, 0.05))
    made = _correction(band(), test, [found(test)], np.ones(1), [])
    assert (made.coefficient, made.sigma) == (0.3, 0.05)
    np.testing.assert_allclose(
        made.band.parts()["friction"] / made.band.stress, 0.05 * 2.0 * STRAIN.mean(), rtol=1e-9
    )


def test_weights_are_those_of_schwarz():
    test = made_test()
    S = {"a": 20.0, "b": 24.0}
    laws = [SimpleNamespace(chi2=S["a"], theta=np.zeros(4)), SimpleNamespace(chi2=S["b"], theta=np.zeros(2))]
    # b is the best by chi2 + k ln n; its mean square residual 24 / 14 scales both.
    scale = 24.0 / 14.0
    expected = np.array([20.0 / scale + 4 * np.log(N), 24.0 / scale + 2 * np.log(N)])
    np.testing.assert_allclose(bic(laws, test), expected)
    ratio = np.exp(-0.5 * (expected[0] - expected[1]))
    np.testing.assert_allclose(model_weights(laws, test), [ratio / (1 + ratio), 1 / (1 + ratio)])


def test_a_fit_moves_to_its_own_refined_mesh():
    """One unknown: the force that the refined mesh takes, the law gives back; the noise is that mesh's."""
    test = made_test()
    one = found(test, refined=False)
    (moved,), finer = on_refined_mesh([one], test)
    # Of the change 1.25 / 2 over 1.5^2 - 1, a half, is not known of the refined mesh.
    noise = np.sqrt(0.01**2 - 0.002**2 + 0.001**2 + (0.5 * FINER) ** 2)
    np.testing.assert_allclose(finer.noise, noise)
    np.testing.assert_allclose(moved.theta, [FINER], rtol=1e-12)
    np.testing.assert_allclose(moved.jacobian, 1.0 / noise)
    np.testing.assert_allclose(moved.mesh_change, -FINER)
    assert (moved.chi2, moved.misfit) == (pytest.approx(0.0, abs=1e-20), pytest.approx(0.0, abs=1e-12))


def test_what_a_mesh_does_beside_the_law_is_left_in_the_misfit():
    """A mesh's force that wavers by +- a about its mean: the one unknown takes the mean, a is left."""
    a = np.where(np.arange(N) % 2, 0.003, -0.003)
    test = replace(made_test(), stress=1.3e4 * STRAIN * np.exp(-a))
    (moved,), finer = on_refined_mesh([found(test, refined=False)], test)
    assert moved.misfit == pytest.approx(0.003, rel=1e-12)
    assert moved.chi2 == pytest.approx(N * (0.003 / finer.noise[0]) ** 2, rel=1e-12)


def test_the_radius_of_the_refined_mesh_is_compared():
    """The refined mesh's radius is 2 um more, which no unknown changes: (2 / 1)^2 a point is left."""
    test = replace(made_test(), bulge=np.full(N, 1e-3), bulge_scale=1e-6)
    one = found(test, refined=False)
    one = replace(one, jacobian=np.vstack([one.jacobian, np.zeros((N, 1))]))
    (moved,), _ = on_refined_mesh([one], test)
    assert moved.chi2 == pytest.approx(4.0 * N, rel=1e-9)


@pytest.mark.parametrize(("chi2", "kept"), [(9.9 * N, False), (10.1 * N, True)])
def test_a_law_that_is_far_off_stays_on_the_coarse_mesh(chi2, kept):
    test = made_test()
    far = replace(found(test, refined=False), chi2=chi2)
    made, _ = on_refined_mesh([found(test, refined=False), far], test)
    assert (made[1].mesh is None) is kept


class Falling(Factor):
    """A law whose stress the mesh's step would take below none: (1 - 300 x) 10 kPa times the strain."""

    name = "falling"

    def stress(self, theta, strain):
        return (1.0 - 300.0 * theta[0]) * 1e4 * strain


def test_a_direction_that_the_test_does_not_tell_is_not_moved_in():
    test = made_test()
    one = found(test, refined=False)
    one.model.bounds = np.full(2, -np.inf), np.full(2, np.inf)
    # A second unknown of a millionth of the first one's effect: uncut it would go to a thousand and more.
    wavering = np.where(np.arange(N) % 2, 1e-6, -1e-6)
    jacobian = np.column_stack([one.jacobian[:, 0], wavering / test.noise])
    one = replace(one, theta=np.array([0.0, 0.5]), jacobian=jacobian, off=1e3 * wavering)
    (moved,), _ = on_refined_mesh([one], test)
    np.testing.assert_allclose(moved.theta, [FINER, 0.5], rtol=1e-9)


def test_a_law_that_would_lose_its_stress_keeps_its_fit():
    test = made_test()
    one = replace(found(test, refined=False), model=Falling())
    (kept,), finer = on_refined_mesh([one], test)
    assert (kept.mesh, kept.theta) == (None, pytest.approx(one.theta))
    assert kept.chi2 == pytest.approx(float(np.sum(finer.residual(one.made) ** 2)))


def test_a_law_without_stress_at_some_strain_is_a_failed_one(monkeypatch):
    test = made_test()
    bad = replace(found(test), model=Falling(), theta=np.array([0.01]))
    monkeypatch.setattr(correct, "checked_test", lambda *a: test)
    monkeypatch.setattr(correct, "on_refined_mesh", lambda found, test: (found, test))
    monkeypatch.setattr(correct, "fit_nodes", lambda test: [found(test), bad])
    monkeypatch.setattr(correct, "model_fit", lambda *a: SimpleNamespace(weight=1.0))
    made = correct_friction(band(), SPECIMEN, EndFriction("bonded"), laws=())
    assert np.isfinite(made.band.stress).all()
    assert [m.name for m in made.models[1:]] == ["falling"]
    assert "not positive" in made.models[1].reason


def test_a_law_past_its_bound_stays_at_it():
    test = made_test()
    one = found(test, refined=False)
    one.model.bounds = np.full(1, -np.inf), np.full(1, 0.25 * FINER)
    (moved,), finer = on_refined_mesh([one], test)
    np.testing.assert_allclose(moved.theta, 0.25 * FINER)
    assert moved.misfit == pytest.approx(0.75 * FINER, rel=1e-9)
    assert moved.chi2 == pytest.approx(N * (0.75 * FINER / finer.noise[0]) ** 2, rel=1e-9)


def test_the_size_of_a_mesh_error_is_its_root_mean_square_over_laws_and_neighbours():
    first, second = np.array([0.0, 3.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0, 2.0])
    # Squares' means: 0, 5, 0, 2; each with its neighbours, the ends twice.
    np.testing.assert_allclose(local_rms([first, second]) ** 2, [5 / 3, 5 / 3, 7 / 3, 4 / 3])


def test_constants_move_with_the_mesh():
    test = made_test()
    one = found(test)
    assert test.moved(one.gain, one.made, one.mesh) == pytest.approx([FINER], rel=1e-9)


def test_a_constant_whose_interval_reaches_zero_is_not_determined():
    none = np.zeros(0)
    constants, sigma = {"a": 2.1, "b": -2.1, "c": 1.9, "d": -1.9}, dict.fromkeys("abcd", 1.0)
    law = ModelFit("law", constants, sigma, np.eye(4), none, 0.0, 0.0, 1.0)
    assert law.not_determined == ("c", "d")
    assert model_summary(law)["not_determined"] == ["c", "d"]


def test_a_limit_beyond_every_strain_is_not_determined():
    none = np.zeros(0)
    for Jm, determined in ((99e3, True), (101e3, False)):
        constants, sigma = {"mu": 2e6, "Jm": Jm}, {"mu": 1.0, "Jm": 1.0}
        law = ModelFit("gent", constants, sigma, np.eye(2), none, 0.0, 0.0, 1.0)
        assert law.not_determined == (() if determined else ("Jm",))


class Library(fits.LibraryModel):
    """Two constants, a modulus of 1 Pa and a limit."""

    names, units, name = ("mu", "Jm"), np.array([1.0, 1.0]), "gent"

    def __init__(self):
        pass

    def stress(self, theta, strain):
        return theta[0] * strain


@pytest.mark.parametrize("slope", [1e-12, 0.0])
def test_a_constant_that_hardly_moves_the_force_has_the_interval_of_its_own_slope(slope):
    """Rows (1, 0) and (0, slope): standard uncertainties 1 and 1 over the slope, infinite without one."""
    J = np.zeros((N, 2))
    J[0, 0], J[1, 1] = 1.0, slope
    one = replace(found(made_test()), model=Library(), theta=np.array([2.5, 1e6]), jacobian=J)
    row = fits.model_fit(one, made_test(), STRAIN, 1.0, 0.0)
    assert row.sigma["mu"] == pytest.approx(1.0)
    assert row.sigma["Jm"] == pytest.approx(1.0 / slope if slope else np.inf)
    assert row.not_determined == ("Jm",)
    assert np.isfinite(row.correlation).all()
    assert model_summary(row)["sigma"]["Jm"] == (row.sigma["Jm"] if slope else None)


def test_constants_of_a_part_of_the_range_in_closed_form():
    """Rows of 1, residuals (a, a, -a, -a): half of them move the unknown by -a, of a variance 1/2 - 1/4."""
    J, a = np.ones((4, 1)), 1.5
    found = range_drift(J, a * np.array([1.0, 1.0, -1.0, -1.0]), [2])
    assert found.change == pytest.approx([-a])
    assert found.excess == pytest.approx([np.sqrt(a**2 - 4.0 * 0.25)])
    assert found.probability == pytest.approx(chi2.sf(a**2 / 0.25, 1))
    assert found.rows == 2
    # within two standard deviations, 2 root(1/4), nothing exceeds the noise
    assert range_drift(J, 0.99 * np.array([1.0, 1.0, -1.0, -1.0]), [2]).excess == pytest.approx([0.0])
    wide = range_drift(J, a * np.array([1.0, 1.0, -1.0, -1.0]), [2], excess=16.0)
    assert wide.excess == pytest.approx([0.0])
    # one row and two unknowns: nothing is compared
    assert range_drift(np.ones((4, 2)), np.ones(4), [1, 3]).excess == pytest.approx([0.0, 0.0])


def test_a_test_that_leaves_the_law_is_said_to():
    """The force falls short over the last four tenths: half of the test gives another constant."""
    test = made_test()
    off = np.where(STRAIN > 0.35, -0.06, 0.0)
    one = replace(found(test), off=off - off.mean())
    drift = _range_drift(one, test)
    assert drift.probability < DRIFTS
    assert drift.excess[0] > 0.01
    row = SimpleNamespace(name="yeoh", constants={"C10": 2.0})
    assert f"C10 {2.0 + drift.change[0]:.5g}" in _drift_remark(row, drift, np.ones(1))
    assert _range_drift(replace(one, off=np.zeros(N)), test).excess == pytest.approx([0.0])


def test_an_error_that_neighbouring_strains_share_in_closed_form():
    """About its mean 0.15 % in the root mean square; the mean has 0.06 %, which no number averages."""
    covariance = slow_error(STRAIN)
    rms = np.mean(np.minimum(STRAIN / 0.12, 1.0) ** 2)
    assert np.trace(covariance) / N == pytest.approx(1.5e-3**2 * rms + 6e-4**2)
    # A test that ends at 6 % has half of it at most.
    assert np.diag(slow_error(0.12 * STRAIN)).max() < 1.5e-3**2 * 0.25 * 2.0 + 6e-4**2
    assert covariance.mean() == pytest.approx(6e-4**2)
    # Of a factor of the force (gain 1 / n of each residual over its noise) the mean alone is left.
    noise = np.full(N, 0.02)
    assert slow_change(np.full((1, N), 0.02 / N), noise, STRAIN) == pytest.approx([6e-4])
    # Three strains 0.375 of the range apart and a slope, u = (d_3 - d_1): V = 2 s^2 (1 - k_13) / mean.
    three, apart = np.array([0.2, 0.5, 0.8]), np.exp(-0.5 * np.array([0.0, 0.375, 0.75]) ** 2 / 0.3**2)
    mean = (3.0 + 4.0 * apart[1] + 2.0 * apart[2]) / 9.0
    variance = 2.0 * 1.5e-3**2 * (1.0 - apart[2]) / (1.0 - mean)
    found = slow_change(np.array([[-1.0, 0.0, 1.0, 7.0]]), np.ones(3), three)
    assert found == pytest.approx([np.sqrt(variance)], rel=1e-6)


@dataclass(frozen=True)
class Compressible(Made):
    """A simulated test whose ln S grows by 4 a unit of Poisson's ratio."""

    def simulate(self, model, theta, *, refined=False, derivatives=True):
        made = super().simulate(model, theta)
        made.stress = made.stress * np.exp(4.0 * self.numerics.poisson)
        return made


def test_poissons_ratio_moves_the_constants():
    own = vars(made_test()) | {"numerics": CorrectionNumerics(poisson_sigma=5e-4)}
    test = Compressible(**own)
    assert _poisson_change(found(test, refined=False), test) == pytest.approx([-4.0 * 5e-4])
    assert _poisson_change(found(made_test(), refined=False), made_test()) == pytest.approx([0.0])
    with pytest.raises(ValueError, match="poisson_sigma"):
        CorrectionNumerics(poisson_sigma=0.0011)
    with pytest.raises(ValueError, match=r"refined mesh \(12, 7\) must be finer than \(8, 7\)"):
        CorrectionNumerics(mesh=(8, 7), refined_mesh=(12, 7))


@pytest.mark.parametrize(
    ("where", "words"), [(0, "a toe"), (N - 1, "touched the platens differently"), (N // 2, "did not hold")]
)
def test_a_refusal_names_where_the_test_is_missed(where, words):
    test = made_test()
    one = found(test)
    one.off[where] += np.log(1.2)
    assert words in cause_of_misfit(one, test)
    assert f"most at strain {STRAIN[where]:.3g} (+18.2 %)" in cause_of_misfit(one, test)


@pytest.mark.parametrize(("misfit", "refused"), [(0.0299, False), (0.0301, True)])
def test_a_test_that_no_law_meets_is_refused(misfit, refused, monkeypatch):
    test = made_test()
    monkeypatch.setattr(correct, "checked_test", lambda *a: test)
    monkeypatch.setattr(correct, "on_refined_mesh", lambda found, test: (found, test))
    monkeypatch.setattr(correct, "fit_nodes", lambda test: [found(test, theta=misfit)])
    monkeypatch.setattr(correct, "model_fit", lambda *a: SimpleNamespace(weight=1.0))
    if refused:
        with pytest.raises(ValueError, match="no law fits the test: the best, factor, misses it by 3 %"):
            correct_friction(band(), SPECIMEN, EndFriction("bonded"), laws=())
    else:
        assert correct_friction(band(), SPECIMEN, EndFriction("bonded"), laws=()).misfit == pytest.approx(
            misfit
        )


def test_a_law_that_meets_the_test_as_well_is_named(plain, monkeypatch):
    test = made_test(noise=0.05)
    made = _correction(band(), test, [found(test), found(test, off=0.1)], np.array([0.9, 0.1]), [])
    assert "fits the test within its noise too and differs from factor by 5 %" in made.remarks[0]


def test_more_nodes_are_tried_until_the_residual_is_noise(monkeypatch):
    counts = []

    def fitted(test, model, start):
        counts.append(model.nodes.size)
        chi2 = {5: 40.0, 7: 23.0, 10: 1.0}[model.nodes.size]  # 16 points: 24 is the limit
        return ModelOptimum(model, np.zeros(model.nodes.size), None, np.zeros((N + 3, 1)), chi2, np.zeros(N))

    monkeypatch.setattr(fits, "fit_model", fitted)
    fits.fit_nodes(made_test(), continuations=("tangent",))
    assert counts == [5, 7]
