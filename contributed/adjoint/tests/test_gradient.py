"""The adjoint: transposed maps, independence of the segments, identities, and rejected inputs."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from contributed.adjoint import StepSequence, by_curve_stress, by_table, forward_run, gradient
from contributed.adjoint.passes import ForceSampling
from contributed.adjoint.perturbed_runs import (
    BACKWARD,
    CENTRAL,
    FORWARD,
    Histories,
    jacobian,
    same_steps,
    stencil_for,
)
from explicit import CharacteristicBar, Model, PlatenMotion, Samples, Sampling, Stepping, cylinder
from explicit.materials import AnyLaw, marlow_from_curve, neo_hookean
from explicit.materials.laws import MooneyRivlin, Ogden2, Yeoh
from explicit.model import scale_of
from explicit.relaxation import PronySeries

README = Path(__file__).resolve().parents[1] / "README.md"
TIMES = np.linspace(0.0, 9e-4, 13)[1:]
SAMPLING = Sampling(force_times=TIMES, surface_times=TIMES[5::6])
STRETCH = np.linspace(0.97, 0.4, 12)
STRESS = 27e3 * (STRETCH - STRETCH**-2) * (1.0 + 0.3 * (STRETCH**2 + 2.0 / STRETCH - 3.0))
POINT = Samples.of(stiffness_factor=1.2, poisson=0.49, damping=2.5e-5)


def model(**changes: object) -> Model:
    """A specimen pressed at up to 2.6 m/s, bonded."""
    motion = PlatenMotion.sampled(
        lambda t: 2.6 * t**2 / 18e-4, lambda t: 2.6 * t / 9e-4, start=0.0, end=TIMES[-1]
    )
    mesh = cylinder(4.75e-3, 6.5e-3, n_radial=4, n_axial=6)
    law = marlow_from_curve(STRETCH, STRESS, n_knots=17)
    base = Model(mesh=mesh, density=870.0, materials=(law,), motions=(motion,))
    return replace(base, **changes)  # type: ignore[arg-type]


def half_force(found: Histories) -> tuple[float, Histories]:
    """Half the sum of squares of the transmission force."""
    force = found.force_transmission
    return 0.5 * float(force @ force), replace(found.map(np.zeros_like), force_transmission=force)


def test_the_sampling_of_forces_is_transposed() -> None:
    rng = np.random.default_rng(2)
    steps = StepSequence(start=1e-4, dt=rng.uniform(1e-6, 3e-6, 40))
    times = np.sort(rng.uniform(steps.time[0], steps.time[-1], 15))
    sampled = ForceSampling(steps, np.concatenate([[1e-4], times]))
    forces, a, b = rng.standard_normal(40), rng.standard_normal(16), rng.standard_normal(16)
    there = a @ sampled.force(forces) + b @ sampled.impulse(forces)
    # The same sum in a different order: round-off of 40 terms.
    assert sampled.transposed(a, b) @ forces == pytest.approx(there, rel=1e-12)


@pytest.mark.parametrize("every", [1, 7, 1000])
def test_the_gradient_does_not_depend_on_the_checkpoints(every: int) -> None:
    usual = gradient(model(), POINT, SAMPLING, half_force)
    found = gradient(model(), POINT, SAMPLING, half_force, checkpoint_every=every)
    assert np.array_equal(found.histories.force_flyer, usual.histories.force_flyer)
    # Segments add the same numbers in the same order, but the partial sums end at other steps.
    assert np.allclose(found.law, usual.law, rtol=1e-12, atol=1e-12 * np.abs(usual.law).max())
    assert found.damping == pytest.approx(usual.damping, rel=1e-12)


def test_scaling_the_whole_table_is_scaling_the_stiffness() -> None:
    found = gradient(model(), POINT, SAMPLING, half_force)
    law = model().materials[0]
    by_quotient, by_slope = by_table(found, law)
    by_factor = 1.2 * found.stiffness_factor
    # Exact for the discrete equations, up to round-off.
    assert by_quotient @ law.quotient + by_slope @ law.slope == pytest.approx(by_factor, rel=1e-11)
    by_stress = by_curve_stress(found, STRETCH, STRESS, n_knots=17)
    assert by_stress @ STRESS == pytest.approx(by_factor, rel=1e-7)  # the table's differences: 1e-9


def test_given_steps_are_repeated_bit_by_bit() -> None:
    first, steps = forward_run(model(), POINT, SAMPLING)
    again, repeated = forward_run(model(), POINT, SAMPLING, steps=steps)
    assert np.array_equal(steps.dt, repeated.dt)
    for name, values in first.items():
        assert np.array_equal(values, getattr(again, name)), name


def test_the_memory_is_that_of_the_checkpoints_and_one_segment() -> None:
    few, many = (gradient(model(), POINT, SAMPLING, half_force, checkpoint_every=n).memory for n in (5, 50))
    assert few < many  # in a run of so few steps the segment is most of the memory


def wrong_shape(found: Histories) -> tuple[float, Histories]:
    """A cotangent of a single time."""
    return 0.0, replace(found, force_flyer=np.zeros(1))


BAR = CharacteristicBar(impedance=5.0, round_trip=1e-4)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"samples": Samples.of(damping=np.array([0.0, 1e-5]))}, r"samples must be one sample.*got 2"),
        ({"samples": Samples.of(material=1)}, r"names material 1, the model has 0 to 0"),
        (
            {"model": model(support=BAR), "checkpoint_every": 1000},
            r"within a segment of 1000 steps \(round trip 0.0001 s\); use a smaller checkpoint_every",
        ),
        ({"stepping": Stepping(precision="fp32")}, r"runs in 'fp64', got precision 'fp32'"),
        ({"stepping": Stepping(max_steps=3)}, r"max_steps was used up. Cure: raise max_steps"),
        ({"objective": wrong_shape}, r"force_flyer must have shape \(12,\), got \(1,\)"),
        ({"checkpoint_every": 0}, r"checkpoint_every must be >= 1 step, got 0"),
        ({"steps": StepSequence(0.0, np.full(4, 1e-6))}, r"the 4 recorded steps end at"),
        ({"sampling": Sampling(TIMES - 1e-3, TIMES)}, r"is before the model's start"),
        ({"model": model(materials=(neo_hookean(1.0),))}, r"Cure:"),
        ({"model": model(relaxation=(PronySeries((0.4,), (1e-3,)),))}, r"knows no branches that relax"),
        ({"steps": StepSequence(0.0, np.full(18, 5e-5))}, r"Cure:"),  # far above the stable step
    ],
)
def test_what_cannot_be_differentiated_is_refused(changes, message) -> None:
    arguments = {"model": model(), "samples": POINT, "sampling": SAMPLING, "objective": half_force, **changes}
    with pytest.raises(ValueError, match=message):
        gradient(**arguments)


def test_the_example_of_the_readme() -> None:
    (example,) = re.findall(r"^```python\n(.*?)^```$", README.read_text("utf-8"), re.DOTALL | re.MULTILINE)
    names: dict = {}
    exec(compile(example, str(README), "exec"), names)
    found = names["slopes"]

    def forces(factor: float) -> np.ndarray:
        samples = Samples.of(poisson=0.49, stiffness_factor=factor)
        histories, _ = forward_run(names["model"], samples, names["sampling"], steps=found.steps)
        return histories.force_transmission

    difference = (forces(1.0 + 1e-4) - forces(1.0 - 1e-4)) / 2e-4
    by_force = float(found.histories.force_transmission @ difference)
    # Truncation error of steps of 1e-4, larger with waves in a coarse mesh.
    assert found.stiffness_factor == pytest.approx(by_force, rel=1e-4)
    assert names["by_stiffness"].derivative.force_transmission.shape == (1, 10)
    assert names["by_stiffness"].study.smooth.all()


def test_a_gradient_of_another_law_is_refused() -> None:
    found = gradient(model(), POINT, SAMPLING, half_force)
    with pytest.raises(ValueError, match=r"the gradient has 89 constants of a law, this law has 19"):
        by_table(found, neo_hookean(27e3))


MATERIAL_TIMES = np.linspace(0.0, 6e-4, 9)[1:]
MATERIAL_SAMPLING = Sampling(MATERIAL_TIMES, MATERIAL_TIMES[3::4])
STEP = 1e-6
"""Relative step of the central differences: their error is STEP^2 plus round-off 1e-15 / STEP = 1e-9, times a
hundred for cancellation in a sum of squares of forces."""


def material_model(law: AnyLaw, **options: str) -> Model:
    """A coarser model, compressed for a shorter time."""
    motion = PlatenMotion.sampled(
        lambda t: 2.6 * t**2 / 12e-4, lambda t: 2.6 * t / 6e-4, start=0.0, end=MATERIAL_TIMES[-1]
    )
    mesh = cylinder(4.75e-3, 6.5e-3, n_radial=3, n_axial=4)
    return model(mesh=mesh, materials=(law,), motions=(motion,), **options)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("law", "options"),
    [
        (Ogden2(20e3, 1.8, 5e3, -2.5), {"element": "fbar", "volumetric": "simo_taylor"}),
        (MooneyRivlin(9e3, 3e3, 400.0), {"volumetric": "logarithmic"}),
    ],
    ids=lambda x: x.NAME if hasattr(x, "NAME") else "-".join(x.values()),
)
def test_the_stiffness_factor(law: AnyLaw, options: dict[str, str]) -> None:
    problem = material_model(law, **options)
    found = gradient(problem, POINT, MATERIAL_SAMPLING, half_force)
    ends = []
    for sign in (1.0, -1.0):
        moved = replace(POINT, stiffness_factor=POINT.stiffness_factor * (1.0 + sign * STEP))
        histories, _ = forward_run(problem, moved, MATERIAL_SAMPLING, steps=found.steps)
        ends.append(half_force(histories)[0])
    assert found.stiffness_factor == pytest.approx((ends[0] - ends[1]) / (2.0 * 1.2 * STEP), rel=1e-6)
    assert np.isfinite(found.law).all()  # although both stretches in the plane are one at rest


@pytest.mark.slow
def test_the_constants_of_a_law() -> None:
    law = Yeoh(12e3, 900.0, 70.0)
    found = gradient(material_model(law), POINT, MATERIAL_SAMPLING, half_force)
    for place in range(3):
        ends, h = [], STEP * float(law.constants()[place]) * (1.0, 10.0, 100.0)[place]
        for side in (h, -h):
            moved = law.of(law.constants() + side * np.eye(3)[place])
            histories, _ = forward_run(material_model(moved), POINT, MATERIAL_SAMPLING, steps=found.steps)
            ends.append(half_force(histories)[0])
        by_constant = found.law[place] + (2.0 * found.shear_modulus if place == 0 else 0.0)  # mu_0 = 2 C10
        assert by_constant == pytest.approx((ends[0] - ends[1]) / (2.0 * h), rel=1e-5)


def jacobian_model() -> Model:
    """The same of a neo-Hookean law."""
    return model(materials=(neo_hookean(27e3),))


def test_every_parameter_at_its_lower_bound_against_the_adjoint() -> None:
    names = ("stiffness_factor", "poisson", "damping", "mass_damping")
    point = Samples.of(poisson=0.0, damping=0.0, mass_damping=0.0)
    found = jacobian(jacobian_model(), point, SAMPLING, parameters=names)
    assert found.steps_shared
    rng = np.random.default_rng(5)
    weights = found.nominal.map(lambda f: rng.standard_normal(f.shape) / np.abs(f).max())
    exact = gradient(jacobian_model(), point, SAMPLING, lambda h: (0.0, weights), stepping=found.stepping)
    for p, name in enumerate(names):
        slope = sum(float((f[p] * getattr(weights, k)).sum()) for k, f in found.derivative.items())
        bound = sum(float((f[p] * np.abs(getattr(weights, k))).sum()) for k, f in found.error.items())
        assert slope == pytest.approx(getattr(exact, name), rel=1e-7), name  # round-off over a step of 1e-5
        assert abs(slope - getattr(exact, name)) <= bound, name


def test_a_step_that_follows_the_deformation_is_reported() -> None:
    assert not jacobian(jacobian_model(), Samples.of(), SAMPLING, stepping=Stepping()).steps_shared


def test_the_common_step_lies_below_the_bound_of_every_sample() -> None:
    stepping = same_steps(jacobian_model(), Samples.of(stiffness_factor=np.array([0.5, 2.0])), SAMPLING)
    alone = same_steps(jacobian_model(), Samples.of(stiffness_factor=2.0), SAMPLING)
    assert stepping.largest_step == alone.largest_step  # the stiffer sample has the smaller bound
    soft = same_steps(jacobian_model(), Samples.of(stiffness_factor=0.5), SAMPLING)
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
def test_what_cannot_be_differentiated_is_refused_in_a_jacobian(changes, message) -> None:
    arguments = {"samples": Samples.of(), "parameters": ("stiffness_factor",), **changes}
    if "relative_steps" in changes and "samples" in changes:
        arguments["parameters"] = ("poisson",)
    with pytest.raises(ValueError, match=message):
        jacobian(jacobian_model(), arguments.pop("samples"), SAMPLING, **arguments)
