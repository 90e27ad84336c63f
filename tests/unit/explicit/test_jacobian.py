"""Derivatives by differences: formulas at bounds, what is refused, and an error estimate that holds."""

from dataclasses import replace

import numpy as np
import pytest

from explicit import Model, PlatenMotion, Samples, Sampling, Stepping, cylinder
from explicit.adjoint import gradient
from explicit.adjoint.perturbed_runs import jacobian, same_steps
from explicit.materials import neo_hookean
from explicit.model import BACKWARD, CENTRAL, FORWARD, scale_of, stencil_for

TIMES = np.linspace(0.0, 9e-4, 13)[1:]
SAMPLING = Sampling(force_times=TIMES, surface_times=TIMES[5::6])


def model(**changes: object) -> Model:
    """A specimen pressed at up to 2.6 m/s, bonded."""
    motion = PlatenMotion.sampled(
        lambda t: 2.6 * t**2 / 18e-4, lambda t: 2.6 * t / 9e-4, start=0.0, end=TIMES[-1]
    )
    mesh = cylinder(4.75e-3, 6.5e-3, n_radial=4, n_axial=6)
    base = Model(mesh=mesh, density=870.0, materials=(neo_hookean(27e3),), motions=(motion,))
    return replace(base, **changes)  # type: ignore[arg-type]


def test_every_parameter_at_its_lower_bound_against_the_adjoint() -> None:
    names = ("stiffness_factor", "poisson", "damping", "mass_damping")
    point = Samples.of(poisson=0.0, damping=0.0, mass_damping=0.0)
    found = jacobian(model(), point, SAMPLING, parameters=names)
    assert found.steps_shared
    rng = np.random.default_rng(5)
    weights = found.nominal.map(lambda f: rng.standard_normal(f.shape) / np.abs(f).max())
    exact = gradient(model(), point, SAMPLING, lambda h: (0.0, weights), stepping=found.stepping)
    for p, name in enumerate(names):
        slope = sum(float((f[p] * getattr(weights, k)).sum()) for k, f in found.derivative.items())
        bound = sum(float((f[p] * np.abs(getattr(weights, k))).sum()) for k, f in found.error.items())
        assert slope == pytest.approx(getattr(exact, name), rel=1e-7), name  # round-off over a step of 1e-5
        assert abs(slope - getattr(exact, name)) <= bound, name


def test_a_step_that_follows_the_deformation_is_reported() -> None:
    assert not jacobian(model(), Samples.of(), SAMPLING, stepping=Stepping()).steps_shared


def test_the_common_step_lies_below_the_bound_of_every_sample() -> None:
    stepping = same_steps(model(), Samples.of(stiffness_factor=np.array([0.5, 2.0])), SAMPLING)
    alone = same_steps(model(), Samples.of(stiffness_factor=2.0), SAMPLING)
    assert stepping.largest_step == alone.largest_step  # the stiffer sample has the smaller bound
    soft = same_steps(model(), Samples.of(stiffness_factor=0.5), SAMPLING)
    assert stepping.largest_step < 0.6 * soft.largest_step  # sqrt(4) in the wave speed


@pytest.mark.parametrize(
    ("name", "value", "widest", "expected"),
    [
        ("damping", 2.5e-5, 2.5e-6, CENTRAL),
        ("damping", 0.0, 1e-6, FORWARD),
        ("poisson", 0.49999, 1e-5, BACKWARD),
        ("poisson", 0.499, 1e-4, CENTRAL),
        ("stiffness_factor", 1.0, 0.1, CENTRAL),
    ],
)
def test_a_formula_stays_inside_the_range(name, value, widest, expected) -> None:
    assert stencil_for(name, value, widest) is expected


@pytest.mark.parametrize("stencil", [CENTRAL, FORWARD, BACKWARD])
def test_a_formula_is_exact_for_a_parabola(stencil) -> None:
    x, h = 0.3, 0.01
    values = 2.0 - 3.0 * (x + stencil.offsets * h) + 5.0 * (x + stencil.offsets * h) ** 2
    assert stencil.weights @ values / h == pytest.approx(-3.0 + 10.0 * x, rel=1e-12)  # round-off over h


def test_a_scale_of_poissons_ratio_is_its_distance_from_a_half() -> None:
    assert scale_of("poisson", 0.499) == pytest.approx(1e-3)
    assert scale_of("friction", 0.0) == 0.1


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"samples": Samples.of(damping=np.array([0.0, 1e-5]))}, r"samples must be one sample.*got 2"),
        ({"parameters": ("stiffness",)}, r"different names of stiffness_factor.*got 'stiffness'"),
        ({"parameters": ("damping", "damping")}, r"different names.*got 'damping'"),
        ({"parameters": ("friction",)}, r"friction has no effect with faces 'bonded'.*choose 'coulomb'"),
        ({"relative_steps": (0.1, 0.01)}, r"relative_steps must be 3 or more.*got \[0.1, 0.01\]"),
        ({"relative_steps": (0.1, 0.2, 0.01)}, r"positive and descending"),
        ({"relative_steps": (1.5, 0.1, 0.01), "samples": Samples.of(poisson=0.3)}, r"has no room|ended at"),
        ({"stepping": Stepping(max_steps=3)}, r"run 0 at stiffness_factor = 1 ended.*raise max_steps"),
    ],
)
def test_what_cannot_be_differentiated_is_refused(changes, message) -> None:
    arguments = {"samples": Samples.of(), "parameters": ("stiffness_factor",), **changes}
    if "relative_steps" in changes and "samples" in changes:
        arguments["parameters"] = ("poisson",)
    with pytest.raises(ValueError, match=message):
        jacobian(model(), arguments.pop("samples"), SAMPLING, **arguments)
