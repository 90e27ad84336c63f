"""Order of the time integration: a smooth bonded impact with fixed steps, each half of the previous one."""

from functools import cache
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from order import FittedOrder, assert_order, fitted_order
from scene import DENSITY, LENGTH, RADIUS, FloatArray, shear_modulus, smooth_stroke

from explicit import Model, Samples, Sampling, Stepping, cylinder, run
from explicit.materials import neo_hookean

DURATION = 4e-4
"""Duration of the platen's motion [s]: a shear wave needs 0.9 ms for the radius, so waves are resolved."""
STROKE = 0.05  # nominal compression of the motion [-]
TIMES = DURATION * np.array([0.24, 0.5, 0.74, 0.9])
"""Times of comparison [s], a whole number of every step and away from the ends of the motion, where its
acceleration has a kink."""
STEPS = DURATION / 100.0 / 2.0 ** np.arange(7)  # steps [s]: 4, 2, 1, ... µs.
DAMPING = 2.5e-5  # Stiffness-proportional damping of the paper [s]
USUAL_STEP = 1.5e-6  # step of 16 × 22 elements with this damping [s]
QUANTITIES = ("transmission force", "flyer force", "impulse", "positions")
ALLOWED = 0.1
"""Allowed distance of a fitted order from theory [-]: the next term of the error at the coarsest steps."""
LAG_TOLERANCE = 5e-3  # allowed first-order error of the force at the usual step, over the largest force [-]


Result = SimpleNamespace


def histories(damping: float, step: float) -> tuple[dict[str, FloatArray], float]:
    """The compared quantities at `TIMES` and the step that was taken [s]."""
    model = Model(
        cylinder(RADIUS, LENGTH, n_radial=8, n_axial=11),
        DENSITY,
        (neo_hookean(shear_modulus(0.495)),),
        (smooth_stroke(STROKE * LENGTH, DURATION, end=2.0 * DURATION),),
    )
    response = run(
        model,
        Samples.of(poisson=0.495, damping=damping),
        Sampling(TIMES, TIMES, all_nodes=True),
        stepping=Stepping(largest_step=step),
    )
    assert response.nodes is not None
    values = (response.force_transmission, response.force_flyer, response.impulse_transmission)
    rest = model.mesh.nodes
    found = dict(zip(QUANTITIES, (*(v[0] for v in values), response.nodes[0] - rest), strict=True))
    return found, float(response.smallest_step[0])


def _series(damping: float) -> dict[str, FloatArray]:
    """Differences between neighbouring steps."""
    runs = []
    for step in STEPS:
        values, taken = histories(damping, float(step))
        if abs(taken / step - 1.0) > 1e-12:
            raise AssertionError(f"a step of {step:.3g} s was asked for, {taken:.3g} s was taken")
        runs.append(values)
    difference = {}
    for name in QUANTITIES:
        size = np.abs(runs[-1][name]).max()
        pairs = pairwise(runs)
        difference[name] = np.array([np.abs(a[name] - b[name]).max() / size for a, b in pairs])
    return difference


@cache
def case() -> Result:
    """Seven steps without and with damping."""
    undamped, damped = _series(0.0), _series(DAMPING)
    return Result(
        undamped=undamped,  # Largest difference to half the step, by quantity [-], shape [n_steps - 1].
        damped=damped,  # the same with deviatoric damping
        # fit of the undamped differences against the step
        order={name: fitted_order(STEPS[:-1], undamped[name]) for name in QUANTITIES},
        # fit of the damped differences over the three smallest steps
        damped_order={name: fitted_order(STEPS[-4:-1], damped[name][-3:]) for name in QUANTITIES},
    )


def lag(result: Result, name: str) -> float:
    """First-order part of the error at `USUAL_STEP` with damping, over the largest value [-]."""
    # A first-order error at step h is twice the difference between h and h / 2.
    return float(2.0 * result.damped[name][-1] * USUAL_STEP / STEPS[-2])


def shown(result: Result) -> dict[str, object]:
    """What the page and the index show beside the fields of the result."""
    steps = [f"{1e6 * step:g}" for step in STEPS[:-1]]

    def rows(series: dict[str, FloatArray], fits: dict[str, FittedOrder]) -> list[list[str]]:
        return [
            [
                name,
                *(f"{v:.1e}" for v in series[name]),
                f"{fits[name].order:.3f} +- {fits[name].standard_error:.3f}",
            ]
            for name in QUANTITIES
        ]

    orders = [fit.order for fit in result.order.values()]
    return locals()


@pytest.mark.parametrize("quantity", QUANTITIES)
def test_undamped_motion_is_second_order_in_time(quantity: str) -> None:
    assert_order(
        STEPS[:-1], case().undamped[quantity], 2.0, ALLOWED
    )  # the next term at the coarsest steps moves the fit by 0.03


@pytest.mark.parametrize("quantity", QUANTITIES)
def test_damping_with_the_lagged_velocity_is_first_order(quantity: str) -> None:
    # Three smallest steps: at the larger ones the second-order part is still as large.
    assert_order(STEPS[-4:-1], case().damped[quantity][-3:], 1.0, ALLOWED)


def test_first_order_part_is_small_at_the_usual_step() -> None:
    # Half a step over the damping time is 3 %, of a damping force that is a tenth of the whole: 0.3 %.
    assert lag(case(), "transmission force") < LAG_TOLERANCE
