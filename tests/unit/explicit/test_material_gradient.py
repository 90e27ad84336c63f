"""The adjoint through closed-form laws and volumetric forms: against differences over the same steps."""

from dataclasses import replace

import numpy as np
import pytest

from explicit import Model, PlatenMotion, Samples, Sampling, cylinder
from explicit.adjoint import forward_run, gradient
from explicit.adjoint.perturbed_runs import Histories
from explicit.materials import AnyLaw
from explicit.materials.laws import MooneyRivlin, Ogden2, Yeoh

TIMES = np.linspace(0.0, 6e-4, 9)[1:]
SAMPLING = Sampling(TIMES, TIMES[3::4])
POINT = Samples.of(stiffness_factor=1.2, poisson=0.49, damping=2.5e-5)
STEP = 1e-6
"""Relative step of the central differences: their error is STEP^2 and 1e-15 / STEP of rounding, 1e-9, with a
hundred for what cancels in a sum of squares of forces."""


def model(law: AnyLaw, **options: str) -> Model:
    """A specimen pressed at up to 2.6 m/s, bonded."""
    motion = PlatenMotion.sampled(
        lambda t: 2.6 * t**2 / 12e-4, lambda t: 2.6 * t / 6e-4, start=0.0, end=TIMES[-1]
    )
    mesh = cylinder(4.75e-3, 6.5e-3, n_radial=3, n_axial=4)
    return Model(mesh, 870.0, (law,), (motion,), **options)  # type: ignore[arg-type]


def half_force(found: Histories) -> tuple[float, Histories]:
    """Half the sum of squares of the transmission force."""
    force = found.force_transmission
    return 0.5 * float(force @ force), replace(found.map(np.zeros_like), force_transmission=force)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("law", "options"),
    [
        (Ogden2(20e3, 1.8, 5e3, -2.5), {"element": "one_point"}),
        (Ogden2(20e3, 1.8, 5e3, -2.5), {"element": "fbar", "volumetric": "simo_taylor"}),
        (MooneyRivlin(9e3, 3e3, 400.0), {"volumetric": "logarithmic"}),
    ],
    ids=lambda x: x.NAME if hasattr(x, "NAME") else "-".join(x.values()),
)
def test_the_stiffness_factor(law: AnyLaw, options: dict[str, str]) -> None:
    problem = model(law, **options)
    found = gradient(problem, POINT, SAMPLING, half_force)
    ends = []
    for sign in (1.0, -1.0):
        moved = replace(POINT, stiffness_factor=POINT.stiffness_factor * (1.0 + sign * STEP))
        histories, _ = forward_run(problem, moved, SAMPLING, steps=found.steps)
        ends.append(half_force(histories)[0])
    assert found.stiffness_factor == pytest.approx((ends[0] - ends[1]) / (2.0 * 1.2 * STEP), rel=1e-6)
    assert np.isfinite(found.law).all()  # though both stretches in the plane are one at rest


@pytest.mark.slow
@pytest.mark.parametrize("place", range(3))
def test_the_constants_of_a_law(place: int) -> None:
    law = Yeoh(12e3, 900.0, 70.0)
    found = gradient(model(law), POINT, SAMPLING, half_force)
    ends, h = [], STEP * float(law.constants()[place]) * (1.0, 10.0, 100.0)[place]
    for side in (h, -h):
        moved = law.of(law.constants() + side * np.eye(3)[place])
        histories, _ = forward_run(model(moved), POINT, SAMPLING, steps=found.steps)
        ends.append(half_force(histories)[0])
    by_constant = found.law[place] + (2.0 * found.shear_modulus if place == 0 else 0.0)  # mu_0 = 2 C10
    assert by_constant == pytest.approx((ends[0] - ends[1]) / (2.0 * h), rel=1e-5)
