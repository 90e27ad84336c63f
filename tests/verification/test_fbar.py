"""The F-bar element; figures and tolerances as on the page (`fbar.py`)."""

import dynamic_bonded as dynamic
import energy
import fbar
import frictionless
import numpy as np
import patch
import pytest
import static_bonded as static
from elements import evaluate
from scene import DENSITY, LENGTH, RADIUS, shear_modulus, smooth_stroke

from explicit import Model, Samples, Sampling, cylinder, run
from explicit.elements import ELEMENTS
from explicit.elements.base import INVERTED
from explicit.materials import neo_hookean


@pytest.mark.parametrize("element", list(ELEMENTS))
@pytest.mark.parametrize("precision", list(patch.TOLERANCE))
def test_patch_and_rigid_motion_of_every_element(element: str, precision: str) -> None:
    single = fbar.single(element)
    for found in (single.interior, single.face, single.rigid):
        assert found[precision] < patch.TOLERANCE[precision]


@pytest.mark.parametrize("element", list(ELEMENTS))
def test_damping_power_of_every_element(element: str) -> None:
    assert abs(fbar.single(element).rate_power) < 1e-13  # sums of a few products of order one


@pytest.mark.parametrize("element", list(ELEMENTS))
@pytest.mark.parametrize("law", [neo_hookean, frictionless.yeoh_like])
def test_forces_are_the_gradient_of_the_energy(element: str, law: object) -> None:
    material = law(27e3)  # type: ignore[operator]
    errors = fbar.gradient_errors(element, material)
    assert errors.min() < fbar.GRADIENT_TOLERANCE
    assert errors[0] > 1e3 * errors.min()  # the difference formula's own error, of second order
    assert errors[-1] > 1e2 * errors.min()  # round-off over the step
    # a hundred times closer, four digits
    assert np.log10(errors[0] / errors[2]) == pytest.approx(2.0 * np.log10(np.sqrt(10.0) ** 2), abs=0.1)


@pytest.mark.parametrize("element", list(ELEMENTS))
def test_energy_balance_of_every_element(element: str) -> None:
    assert max(fbar.single(element).imbalance.values()) < energy.TOLERANCE


@pytest.mark.parametrize("element", list(ELEMENTS))
def test_frictionless_compression_of_every_element(element: str) -> None:
    assert fbar.single(element).frictionless < frictionless.FORCE_TOLERANCE


@pytest.mark.parametrize("element", list(ELEMENTS))
@pytest.mark.parametrize("poisson", fbar.POISSON)
@pytest.mark.parametrize(("beta", "kind"), [(0.0, "deviatoric"), (2.5e-5, "deviatoric"), (2.5e-5, "full")])
def test_the_step_bound_is_one(element: str, poisson: float, beta: float, kind: str) -> None:
    found = fbar.bound_quality(element, poisson, beta=beta, kind=kind)
    assert found.least >= fbar.BOUND_FLOOR[element]


@pytest.mark.parametrize("element", list(ELEMENTS))
@pytest.mark.parametrize("poisson", fbar.POISSON)
@pytest.mark.parametrize(("beta", "kind"), [(0.0, "deviatoric"), (2.5e-5, "deviatoric"), (2.5e-5, "full")])
def test_the_bound_by_eigenvalue_is_a_sharper_one(
    element: str, poisson: float, beta: float, kind: str
) -> None:
    found = fbar.bound_quality(element, poisson, beta=beta, kind=kind, by="eigenvalue")
    by_trace = fbar.bound_quality(element, poisson, beta=beta, kind=kind)
    assert found.least >= 1.0  # a bound, with nothing left out
    # Undamped and nearly incompressible both are the volumetric part's; this one holds the pressure's work.
    assert found.median <= max(by_trace.median, 1.05)


def test_one_gauss_point_inside_out_is_reported() -> None:
    mesh = cylinder(RADIUS, LENGTH, n_radial=2, n_axial=2)
    size = np.array([RADIUS, LENGTH]) / 2.0
    motion = np.zeros((4, 4, 2))
    law = neo_hookean(27e3)
    for share, turned in ((0.3, False), (0.7, True)):
        motion[3, 2] = -share * size  # the outer upper corner, toward the element's middle and past it
        found = evaluate("fbar", mesh, law, motion, poisson=0.495)
        assert (found.omega_squared[:3] < 1e-6 * INVERTED).all()
        assert bool(found.omega_squared[3] == INVERTED) == turned
        # its area is still positive: the one-point element does not see it
        assert evaluate("one_point", mesh, law, motion, poisson=0.495).omega_squared[3] < INVERTED


def test_a_mean_dilatation_does_not_lock_where_full_integration_would() -> None:
    # With J at each point, K = 5000 mu on 8 x 11 elements would multiply the force; it changes by a little.
    forces = [static_force(poisson) for poisson in (0.495, 0.4999)]
    assert forces[1] / forces[0] == pytest.approx(1.0, abs=0.05)  # 3 mu K / (3 K + mu): 1 %, and confinement


def static_force(poisson: float) -> float:
    model = Model(
        cylinder(RADIUS, LENGTH, n_radial=8, n_axial=11),
        DENSITY,
        (neo_hookean(shear_modulus(0.495)),),
        (smooth_stroke(0.1 * LENGTH, 0.02, end=0.021),),
        element="fbar",
    )
    times = np.array([0.0205])
    response = run(model, Samples.of(poisson=poisson, mass_damping=500.0), Sampling(times, times))
    return float(response.force_transmission[0, 0])


def test_coarse_static_force_and_radius() -> None:
    found = static.compress(static.COARSE, element="fbar")
    assert found.completed
    assert np.abs(static.force_error(found)).max() < fbar.STATIC_TOLERANCE["coarse"]
    assert np.abs(found.radius - static.reference().radius).max() < fbar.RADIUS_TOLERANCE["coarse"]
    assert (found.hourglass == 0.0).all()


@pytest.mark.parametrize("element", list(ELEMENTS))
def test_impact_on_every_mesh(element: str) -> None:
    errors = fbar.impact_errors(element, 5e3)
    assert errors[0] < fbar.IMPACT_TOLERANCE["coarse"]
    assert errors[-1] < fbar.IMPACT_TOLERANCE["fine"]
    assert fbar.impact_outlines(element)[-1].max() < dynamic.PROFILE_TOLERANCE
    assert (np.diff(errors) < 0.0).all()


def test_both_elements_converge_to_one_impact() -> None:
    assert fbar.limit_differences(5e3, dynamic.END)[2] < fbar.AGREEMENT


@pytest.mark.slow
@pytest.mark.parametrize("element", list(ELEMENTS))
def test_order_of_every_element(element: str) -> None:
    assert fbar.small_order(element).order > 2.0  # second order; steeper while 5 kHz is near a mesh's cut-off


@pytest.mark.slow
def test_fine_static_force_and_radius() -> None:
    found = static.compress((48, 66), element="fbar")
    assert np.abs(static.force_error(found)).max() < fbar.STATIC_TOLERANCE["fine"]
    assert np.abs(found.radius - static.reference().radius).max() < fbar.RADIUS_TOLERANCE["fine"]


@pytest.mark.slow
def test_extrapolated_static_forces() -> None:
    wanted = static.reference()
    for element in fbar.ELEMENTS:
        force = fbar.static_limits(element)[0].value
        assert np.abs(force / wanted.force - 1.0).max() < fbar.LIMIT_TOLERANCE
    common = fbar.common_forces()
    found = np.array([one.value for one in common])
    assert np.abs(found / wanted.force - 1.0).max() < fbar.LIMIT_TOLERANCE
    # no node has landed at 10 %: one law for eight meshes, and the reference within its own uncertainty
    assert common[0].deviation < 1e-3 * wanted.force[0]
    assert abs(found[0] - wanted.force[0]) < wanted.sigma[0]
    # at most the singular edge's order in linear theory, first order or not far below
    assert 0.6 < common[0].order < fbar.STATIC_ORDER


@pytest.mark.slow
def test_hourglass_stiffness_matters_on_a_flat_disc_and_not_on_a_fine_mesh() -> None:
    spread = {}
    for mesh in (fbar.DISC_MESHES[0], fbar.DISC_MESHES[-1]):
        forces = [fbar.disc(mesh, "one_point", chi).force[-1] for chi in fbar.CHI]
        spread[mesh] = np.ptp(forces) / fbar.disc(mesh, "fbar").force[-1]
    coarse, fine = spread.values()
    assert coarse > 0.05  # what the page warns of
    assert fine < 0.01
