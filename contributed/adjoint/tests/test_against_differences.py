"""Gradients by the adjoint against differences of runs with the same steps, a closed form, and each other."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from math import pi, sqrt
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import explicit
from contributed.adjoint import Gradient, Objective, by_curve_stress, by_table, forward_run, gradient
from contributed.adjoint.perturbed_runs import Histories, Jacobian, jacobian
from explicit import RIGID, CharacteristicBar, Model, Samples, Sampling, Stepping, cylinder
from explicit.materials import MarlowLaw, marlow_from_curve, neo_hookean
from explicit.model import scale_of
from kolsky.inverse.problem import prepare_shot
from kolsky.inverse.settings import Numerics
from kolsky.shot.load import load_shot
from tests.helpers.order import fitted_order
from tests.verification.scene import (
    DENSITY,
    LENGTH,
    RADIUS,
    gentle_start,
    ninth,
    ninth_slope,
    rms,
    shear_modulus,
    speed_after_rise,
)

FloatArray = NDArray[np.float64]

SHOT = Path(__file__).resolve().parents[3] / "runs" / "open-01"
END = 1.4e-3
"""End of the runs [s]: 55 % compression, with side contact."""
STEPS = 10.0 ** -np.arange(4.0, 6.6, 0.5)
"""Relative steps of the differences: most are too small to change the step in which a node lands."""
N_DIRECTIONS = 4
"""Random directions of a table."""
SHORT = 7e-4
"""End of the run with friction and full damping, which needs short steps [s]."""
POINT = {"stiffness_factor": 1.1, "poisson": 0.495, "damping": 2.5e-5, "mass_damping": 50.0, "friction": 0.3}
BAR = CharacteristicBar(impedance=30.0, round_trip=3e-4)
"""A light and short bar: the platen in front of it moves by half a millimetre."""
ALLOWED = 1e-6
"""Allowed difference between a gradient and its difference quotient [-]. It is the round-off of the objective
over a step of 1e-6 or more. The run amplifies the round-off of 1e-15 a hundredfold."""
FORWARD = 1e-10
"""Allowed distance from `explicit.run` over the largest value [-]. The cause is round-off, because only
`explicit.run` uses fused multiply-adds. Contact amplifies it; a force divides it by the interval of a
step."""
SHOT_POINTS = (2, 8, 15, 30, 50, 62)
"""Points of the quasi-static curve of open-01 whose derivative is checked by differences."""


@dataclass(frozen=True)
class Check:
    """One derivative against its differences."""

    name: str
    """Parameter or direction."""
    value: float
    """Derivative from the adjoint, per relative change."""
    differences: FloatArray
    """By central differences at `STEPS`."""
    size: float
    """Reference of a distance: the derivative, or the largest one of its kind [-]."""

    @property
    def error(self) -> FloatArray:
        """Relative distance at each step [-]."""
        return np.abs(self.differences - self.value) / self.size

    @property
    def best(self) -> float:
        """Distance at the step after which the differences change least, chosen without the adjoint [-]."""
        return float(self.error[np.abs(np.diff(self.differences)).argmin()])

    @property
    def allowed(self) -> float:
        """`ALLOWED`, or the second smallest change between neighbouring differences if it is larger [-].
        Sliding contact may raise the minimum of the V. Two differences may agree by chance, so the smallest
        change is not used."""
        return max(ALLOWED, float(np.sort(np.abs(np.diff(self.differences)))[1]) / self.size)


def curve() -> tuple[FloatArray, FloatArray]:
    """A stiffening compression curve: stretch [-] and nominal stress [Pa]."""
    lam = np.linspace(0.995, 0.3, 41)
    return lam, shear_modulus(0.5) * (lam - lam**-2) * (1.0 + 0.2 * (lam**2 + 2.0 / lam - 3.0))


def scene_model(
    contact: str, element: str, damping: str, *, end: float = END, support: CharacteristicBar = RIGID
) -> tuple[Model, Sampling]:
    """A flyer of 2.6 m/s on 8 × 11 elements of Marlow's law with 33 knots."""
    model = Model(
        cylinder(RADIUS, LENGTH, n_radial=8, n_axial=11),
        DENSITY,
        (marlow_from_curve(*curve(), n_knots=33),),
        (speed_after_rise(2.6, 50e-6, end=END),),
        faces=contact,
        side=contact,
        support=support,
        element=element,
        damping_kind=damping,  # type: ignore[arg-type]
    )
    times = np.linspace(0.0, end, 101)[1:]
    return model, Sampling(times, times[9::10])


def half_square(scale: Histories) -> Objective:
    """Half the sum of squares of all histories, each divided by its largest value."""
    size = scale.map(lambda f: np.array(np.abs(f).max()))

    def objective(found: Histories) -> tuple[float, Histories]:
        over = {name: f / getattr(size, name) for name, f in found.items()}
        value = 0.5 * sum(float((f**2).sum()) for f in over.values())
        return value, Histories(**{name: f / getattr(size, name) for name, f in over.items()})

    return objective


def differences(evaluate: Callable[[float], float], steps: FloatArray = STEPS) -> FloatArray:
    """Central differences of a function of a relative change."""
    return np.array([(evaluate(h) - evaluate(-h)) / (2.0 * h) for h in steps])


def parameter_check(
    model: Model, sampling: Sampling, found: Gradient, objective: Objective, name: str
) -> Check:
    """A scalar parameter, by its relative scale."""
    samples = Samples.of(**POINT)
    scale = scale_of(name, POINT[name])

    def evaluate(h: float) -> float:
        moved = replace(samples, **{name: getattr(samples, name) + h * scale})
        return objective(forward_run(model, moved, sampling, steps=found.steps)[0])[0]

    value = getattr(found, name) * scale
    return Check(name, value, differences(evaluate), abs(value))


def table_check(
    model: Model,
    sampling: Sampling,
    found: Gradient,
    objective: Objective,
    rng: np.random.Generator,
    name: str,
) -> Check:
    """A random direction of all nodes of the table, quotients and slopes alike."""
    law = model.materials[0]
    assert isinstance(law, MarlowLaw)
    quotient = rng.standard_normal(len(law.quotient)) * law.quotient
    slope = rng.standard_normal(len(law.slope)) * np.abs(law.slope).max()

    def evaluate(h: float) -> float:
        moved = replace(law, quotient=law.quotient + h * quotient, slope=law.slope + h * slope)
        varied = replace(model, materials=(moved,))
        return objective(forward_run(varied, Samples.of(**POINT), sampling, steps=found.steps)[0])[0]

    by_quotient, by_slope = by_table(found, law)
    value = float(by_quotient @ quotient + by_slope @ slope)
    return Check(name, value, differences(evaluate), abs(value))


def scene(
    contact: str, element: str, damping: str, *, end: float = END, support: CharacteristicBar = RIGID
) -> tuple[float, list[Check]]:
    """Distance of the forward run from `explicit.run` over the largest value, and every derivative."""
    model, sampling = scene_model(contact, element, damping, end=end, support=support)
    samples = Samples.of(**POINT)
    reference = Histories.of(explicit.run(model, samples, sampling)).map(lambda f: f[0])
    objective = half_square(reference)
    found = gradient(model, samples, sampling, objective)
    size = reference.map(np.abs)
    forward = max(
        np.abs(f - getattr(reference, name)).max() / getattr(size, name).max()
        for name, f in found.histories.items()
    )
    names = [name for name in POINT if name != "friction" or contact == "coulomb"]
    checks = [parameter_check(model, sampling, found, objective, name) for name in names]
    rng = np.random.default_rng(3)
    checks += [
        table_check(model, sampling, found, objective, rng, f"table, direction {k + 1}")
        for k in range(N_DIRECTIONS)
    ]
    return float(forward), checks


@pytest.mark.parametrize(
    ("contact", "element", "damping", "options"),
    [
        ("bonded", "one_point", "deviatoric", {"end": 3e-4}),
        *(
            pytest.param(*scene, marks=pytest.mark.slow)
            for scene in (
                ("bonded", "one_point", "deviatoric", {"support": BAR}),
                ("rough", "one_point", "deviatoric", {}),
                ("coulomb", "fbar", "full", {"end": SHORT}),
            )
        ),
    ],
)
def test_gradients_against_differences(contact: str, element: str, damping: str, options: Any) -> None:
    forward, checks = scene(contact, element, damping, **options)
    assert forward < FORWARD
    for check in checks:
        assert check.allowed < 1e-5  # the check must be able to fail
        assert check.best < check.allowed, check.name
    if options == {"end": 3e-4}:  # before landing, the largest step has truncation error only
        assert max(check.best for check in checks) < ALLOWED
        assert checks[0].error[0] > 10.0 * checks[0].best


@pytest.mark.slow
def test_gradient_of_a_measured_shot_by_its_curve() -> None:
    """chi-square of the force bins of open-01 at m = 1, by the stress of points of its quasi-static curve."""
    shot = load_shot(SHOT)
    prepared = prepare_shot(shot)
    bins, sampling = prepared.observations.bins, prepared.forward.sampling
    model = prepared.forward.model(Numerics(mesh=(16, 22)))
    samples = Samples.of(poisson=shot.model.poisson, damping=shot.model.damping)
    edge = np.searchsorted(sampling.force_times, bins.edges - 1e-9)
    width = np.diff(bins.edges)

    def objective(found: Histories) -> tuple[float, Histories]:
        residual = (np.diff(found.impulse_transmission[edge]) / width - bins.mean) / bins.sigma
        by_bin = 2.0 * residual / bins.sigma / width
        cotangent = found.map(np.zeros_like)
        np.add.at(cotangent.impulse_transmission, edge[1:], by_bin)
        np.add.at(cotangent.impulse_transmission, edge[:-1], -by_bin)
        return float(residual @ residual), cotangent

    found = gradient(model, samples, sampling, objective)
    stretch, stress = shot.curve.stretch, shot.curve.stress
    by_stress = by_curve_stress(found, stretch, stress) * stress

    def check(i: int) -> Check:
        def evaluate(h: float) -> float:
            moved = stress.copy()
            moved[i] *= 1.0 + h
            varied = replace(model, materials=(marlow_from_curve(stretch, moved),))
            return objective(forward_run(varied, samples, sampling, steps=found.steps)[0])[0]

        largest = float(np.abs(by_stress).max())
        return Check(f"point {i}", float(by_stress[i]), differences(evaluate, STEPS[1:4]), largest)

    for point in SHOT_POINTS:
        assert check(point).best < ALLOWED, point
    # Scaling every stress is scaling m; the differences of the table have an error of 1e-9.
    assert by_stress.sum() == pytest.approx(found.stiffness_factor, rel=1e-8)


SMOOTH_END = 5e-4
"""End of the runs before a node of the side lands [s]."""
LADDER = tuple(10.0 ** (-0.5 * k) for k in range(2, 17))
"""Relative steps from 0.1 to 1e-8."""
PARAMETERS = ("stiffness_factor", "poisson", "damping", "mass_damping")
JACOBIAN_POINT = {"poisson": 0.495, "damping": 2.5e-5, "mass_damping": 50.0, "friction": 0.3}
MESHES = ((8, 11), (16, 22), (32, 44))
WIDE, BETWEEN = (0.03, 0.02, 0.015), (1e-5, 5e-6, 2.5e-6)
"""Ladders of steps that include some landings, and between two landings [-]."""
BOTTOM = 1e-7
"""Allowed change of a derivative at the minimum of the V [-]. It is the round-off of 1e-15 over a step of
1e-5. A few hundred steps amplify it a hundredfold."""
ADJOINT = 1e-7
"""Allowed distance of the differences from the adjoint, over the derivative [-]: as `BOTTOM`."""
WAVE = 3e-3
"""Allowed rms distance from the closed form of a wave, over the derivative's rms [-]. The error is
dispersion. The limit is twice the error of 88 elements along the length and half the error of 44."""


def impact(end: float, n: tuple[int, int] = (16, 22), law: str = "bonded") -> tuple[Model, Sampling]:
    """A flyer of 2.6 m/s, with one contact law on faces and side."""
    model = Model(
        cylinder(RADIUS, LENGTH, n_radial=n[0], n_axial=n[1]),
        DENSITY,
        (neo_hookean(shear_modulus(0.495)),),
        (speed_after_rise(2.6, 50e-6, end=END),),
        faces=law,
        side=law,
    )
    times = np.linspace(0.0, end, 101)[1:]
    return model, Sampling(times, times[9::10])


def test_derivative_of_a_plane_wave_against_its_closed_form() -> None:
    """A plane wave in a rod without lateral motion: F = Z v at the flyer, 2 Z v one transit later. With Z = A
    sqrt(E rho) and the transit L / c both depend on m through c = sqrt(E / rho) ~ sqrt(m)."""
    speed, rise = 1e-3, 6e-4
    mu = shear_modulus(0.0)
    c = sqrt(2.0 * mu / DENSITY)  # E = 2 mu where Poisson's ratio is 0
    end = 1.9 * LENGTH / c
    model = Model(
        cylinder(RADIUS, LENGTH, n_radial=2, n_axial=88),
        DENSITY,
        (neo_hookean(mu),),
        (gentle_start(speed, rise, end=end),),
        faces="frictionless",
        side="frictionless",
    )
    times = np.linspace(0.0, end, 201)[1:]
    found = jacobian(model, Samples.of(poisson=0.0), Sampling(times, times[-1:])).derivative
    impedance, late = pi * RADIUS**2 * DENSITY * c, times - LENGTH / c
    at_flyer = 0.5 * impedance * speed * ninth(times / rise)
    arrived = 2.0 * impedance * speed
    at_support = arrived * (0.5 * ninth(late / rise) + 0.5 * LENGTH / c / rise * ninth_slope(late / rise))
    assert rms(found.force_flyer[0] - at_flyer) < WAVE * rms(at_flyer)
    assert rms(found.force_transmission[0] - at_support) < WAVE * rms(at_support)


def slopes(stepping: Stepping | None = None) -> Jacobian:
    """Derivatives before landing by all parameters."""
    model, sampling = impact(SMOOTH_END)
    point = Samples.of(**JACOBIAN_POINT)
    return jacobian(model, point, sampling, parameters=PARAMETERS, relative_steps=LADDER, stepping=stepping)


@cache
def common() -> Jacobian:
    """The same, all runs with the same steps."""
    return slopes()


@pytest.mark.slow
def test_the_v_falls_with_the_square_of_the_step_and_rises_with_its_inverse() -> None:
    study = common().study
    assert common().steps_shared
    assert study.smooth.all()
    for step, change in zip(study.step[:3], study.change[:3], strict=True):
        # Only large steps, away from the minimum. 10 % is too large; at 3 % the next term of the error is 0.5
        # %.
        fall = (np.arange(len(change)) < np.argmax(change < 1e-7)) & (np.arange(len(change)) > 0)
        assert abs(fitted_order(step[:-1][fall], change[fall]).order - 2.0) < 0.02
    assert (study.change.min(axis=1) < BOTTOM).all()
    # Round-off over a tenfold smaller step is tenfold larger, within the scatter of round-off.
    rise = np.log10(study.change[:, -1] / study.change[:, -5])
    assert ((rise > 1.5) & (rise < 2.5)).all()


@pytest.mark.slow
def test_steps_that_follow_the_deformation_scatter_and_the_study_says_so() -> None:
    following = slopes(Stepping())
    assert not following.steps_shared
    for p in (0, 2):  # stiffness and damping only: the drag of alpha has almost no effect on the steps
        assert following.study.change[p, 4] > 100.0 * common().study.change[p, 4]
        assert not following.study.smooth[p]


@pytest.mark.slow
@pytest.mark.parametrize("law", ["bonded", "coulomb"])
def test_landing_and_sliding_leave_a_response_that_is_smooth_only_piecewise(law: str) -> None:
    point = Samples.of(**JACOBIAN_POINT)
    model, sampling = impact(END, law=law)
    rolling = jacobian(model, point, sampling, relative_steps=LADDER)
    assert rolling.steps_shared
    assert not rolling.study.smooth.any()
    assert rolling.study.change.min() < BOTTOM  # between two decisions it is smooth
    radius = []
    for n in MESHES:
        model, sampling = impact(END, n, law)
        close, wide = (
            jacobian(model, point, sampling, relative_steps=ladder).derivative.surface_r
            for ladder in (BETWEEN, WIDE)
        )
        radius.append(rms(close - wide) / rms(wide))
    assert radius[-1] < radius[0]  # the effect of a landing depends on the element


@pytest.mark.slow
def test_adjoint_and_differences_agree_within_the_error_estimate() -> None:
    model, sampling = impact(SMOOTH_END)
    rng = np.random.default_rng(1)
    weights = common().nominal.map(lambda f: rng.standard_normal(f.shape) / np.abs(f).max())
    point = Samples.of(**JACOBIAN_POINT)
    exact = gradient(model, point, sampling, lambda h: (0.0, weights), stepping=common().stepping)
    for p, name in enumerate(PARAMETERS):
        by_adjoint = getattr(exact, name)
        slope = sum((f[p] * getattr(weights, k)).sum() for k, f in common().derivative.items())
        bound = sum((f[p] * np.abs(getattr(weights, k))).sum() for k, f in common().error.items())
        assert slope == pytest.approx(by_adjoint, rel=ADJOINT), name
        assert abs(slope - by_adjoint) <= bound, name
