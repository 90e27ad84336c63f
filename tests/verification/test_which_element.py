"""Which element to take; figures and tolerances as on the page (`which_element.py`)."""

import numpy as np
import pytest
import which_element as topic
from elements import evaluate
from fbar import states
from order import assert_order
from scene import DENSITY, LENGTH, RADIUS

from explicit import Model, cylinder
from explicit.materials import neo_hookean
from explicit.mesh import element_geometry

COARSE = topic.COARSE[-1]


@pytest.mark.parametrize("form", list(topic.FORMS))
def test_artificial_energy_is_small(form: str) -> None:
    ledger = topic.batch(form, COARSE).energy
    assert (ledger.artificial_share() < topic.ARTIFICIAL).all()
    assert (ledger.artificial[:, -1] < topic.ARTIFICIAL * ledger.elastic[:, -1]).all()
    assert ledger.imbalance().max() < 1e-3  # as of the page on energy: the dissipation is accounted for


def test_each_form_has_its_energy() -> None:
    for form, stored, lost in (
        ("one-point, stiffness", True, True),  # a stiffness is damped like the solid
        ("one-point, viscous", False, True),
        ("F-bar", False, False),
    ):
        ledger = topic.batch(form, COARSE).energy
        assert bool((ledger.hourglass[:, -1] > 0.0).all()) == stored
        assert bool((ledger.hourglass_damping[:, -1] > 0.0).all()) == lost
        # a viscosity never gives energy back; 1e-12 of the strain energy is round-off
        assert np.diff(ledger.hourglass_damping).min() >= -1e-12 * ledger.elastic.max()


def test_artificial_energy_vanishes_with_the_mesh() -> None:
    sizes = [topic.size(mesh) for mesh in topic.COARSE]
    for form in list(topic.FORMS)[:2]:
        shares = [topic.artificial_share(form, mesh) for mesh in topic.COARSE]
        # second order where strain is smooth, first at the singular edges
        assert_order(sizes, shares, 1.5, 0.75, at_least=True)


def test_viscous_control_is_the_stated_share_of_critical_damping() -> None:
    """A pattern alone: force 2 eps sqrt(mu h rho V) times its speed, along gamma; closed form."""
    mesh, law, share = cylinder(RADIUS, LENGTH, n_radial=4, n_axial=5), neo_hookean(27e3), 0.2
    geometry = element_geometry(mesh)
    pattern = np.array([1.0, -1.0, 1.0, -1.0])
    velocity = np.zeros((mesh.n_elements, 4, 2))
    velocity[:, :, 1] = 0.01 * pattern
    given = {"poisson": 0.495, "hourglass": share, "density": DENSITY, "velocity": velocity}
    found = evaluate("one_point", mesh, law, 0.0 * velocity, hourglass_form="viscous", **given)  # type: ignore[arg-type]
    critical = 2.0 * np.sqrt(27e3 * geometry.hourglass_y * DENSITY * geometry.volume)
    speed = 0.01 * geometry.gamma @ pattern
    np.testing.assert_allclose(found.forces[..., 1], (share * critical * speed)[:, None] * geometry.gamma)
    np.testing.assert_allclose(found.artificial, share * critical * speed**2)
    assert (found.power == 0.0).all()  # beta = 0: nothing else dissipates
    # and it is felt by the step: the damped bound is that of xi = C / (2 omega)
    still = evaluate(
        "one_point", mesh, law, 0.0 * velocity, hourglass_form="viscous", **{**given, "hourglass": 0.0}
    )  # type: ignore[arg-type]
    assert (found.omega_squared > still.omega_squared).all()


def test_viscous_control_leaves_linear_fields_alone() -> None:
    mesh, law = cylinder(RADIUS, LENGTH, n_radial=5, n_axial=6), neo_hookean(27e3)
    motion = states(mesh, 0.4, 3)
    r, y = (mesh.nodes[mesh.quads][..., i] for i in (0, 1))
    rate = np.stack([0.3 * r + 0.1 * y, 0.2 * r - 0.6 * y], axis=-1)
    found = evaluate(
        "one_point", mesh, law, motion, poisson=0.495, velocity=rate, hourglass=0.3, hourglass_form="viscous"
    )
    scale = 0.6 * np.sqrt(27e3 * element_geometry(mesh).hourglass_y * element_geometry(mesh).volume)
    assert found.artificial.max() < 1e-20 * scale.max()  # the square of round-off in gamma . v


def test_an_unknown_form_is_refused() -> None:
    given = topic.shot().forward.model(topic.Numerics(mesh=(2, 2)))
    with pytest.raises(ValueError, match="hourglass_form must be 'stiffness' or 'viscous', got 'enhanced'"):
        Model(given.mesh, given.density, given.materials, given.motions, hourglass_form="enhanced")  # type: ignore[arg-type]


@pytest.mark.parametrize("form", list(topic.FORMS))
def test_coarse_mesh_identifies_m(form: str) -> None:
    assert topic.identified(form, COARSE) == pytest.approx(topic.TRUTH, abs=topic.FACTOR_TOLERANCE["coarse"])


@pytest.mark.slow
def test_m_converges_to_the_known_answer() -> None:
    result = topic.case()
    for one in result.found.series.values():
        assert one.factor[-1] == pytest.approx(topic.TRUTH, rel=topic.FACTOR_TOLERANCE["fine"])
        assert one.weighted[-1] == pytest.approx(topic.TRUTH, rel=topic.FACTOR_TOLERANCE["fine"])
        assert (np.diff(np.abs(one.factor - topic.TRUTH)) < 0.0).all()
        # second order; the singular edges leave a little of first order
        assert_order(one.sizes, one.factor - result.factor.value, 1.8, 0.4, at_least=True)
    assert result.factor.value == pytest.approx(topic.TRUTH, rel=topic.FACTOR_TOLERANCE["limit"])


@pytest.mark.slow
def test_elements_have_one_limit() -> None:
    result = topic.case()
    assert topic.apart(result.found.force_limits) < topic.LIMITS_APART["force"] * topic.peak()
    assert topic.apart(result.found.outline_limits) < topic.LIMITS_APART["outline"]
    for force, outline in result.orders.values():
        # between the edges' first and the inside's second
        assert force.order > 1.2
        assert outline.order > 1.2


@pytest.mark.slow
def test_grading_pays() -> None:
    even, graded = (
        abs(topic.identified("one-point, stiffness", topic.STUDY, g) - topic.TRUTH) for g in (1.0, 2.0)
    )
    assert graded < 0.8 * even  # a third is saved; 0.8 leaves room for the ringing
