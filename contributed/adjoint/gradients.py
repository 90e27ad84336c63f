"""The gradient of one objective with respect to all inputs of a simulation: parameters, and the law's
constants or curve.

The kernels read a cubic for every interval of Marlow's law. It follows from the quotient 2 U' and its slope
at both ends: two unknowns at every knot. The monotone cubic gives the slopes from the points of a curve. The
derivative by a point is therefore the sum of its effects on the neighbouring quotients and slopes.
"""

from collections.abc import Callable
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from contributed.adjoint.passes import StepSequence, reverse, run_forward
from contributed.adjoint.perturbed_runs import Histories
from contributed.adjoint.plan import plan
from explicit.arrays import FloatArray
from explicit.materials import MarlowLaw, marlow_from_curve
from explicit.model import Model, Samples, Sampling, Stepping

Objective = Callable[[Histories], tuple[float, Histories]]
"""A function of the histories of a simulation that returns a number and its derivative by every entry."""

CHECKPOINT_EVERY = 50
"""Steps of a segment. Longer segments need more memory for rows and less for checkpoints."""


@dataclass(frozen=True)
class Gradient:
    """Derivatives of an objective at one sample, with the sequence of time steps held fixed."""

    objective: float
    """The objective [its unit]."""
    histories: Histories
    """The forward run, without leading axes."""
    stiffness_factor: float
    """Derivative by m [1]."""
    poisson: float
    """Derivative by Poisson's ratio [1]."""
    damping: float
    """Derivative by beta [1/s]."""
    friction: float
    """Derivative by Coulomb's coefficient [1]; 0 if no contact law uses it."""
    mass_damping: float
    """Derivative by alpha [s]."""
    law: FloatArray
    """Partial derivatives by the law's constants as the kernels read them, at a fixed initial shear modulus.
    The order and the units are those of `MaterialLaw.parameters`."""
    shear_modulus: float
    """Partial derivative by the law's initial shear modulus [1/Pa], at a fixed stress of the law. The modulus
    acts through the bulk modulus, the damping and the hourglass control."""
    steps: StepSequence
    memory: int
    """Memory of checkpoints, rows of a segment and their gradients [B]."""


def gradient(
    model: Model,
    samples: Samples,
    sampling: Sampling,
    objective: Objective,
    *,
    stepping: Stepping | None = None,
    steps: StepSequence | None = None,
    checkpoint_every: int = CHECKPOINT_EVERY,
) -> Gradient:
    """Differentiate any function of the histories by all parameters and the whole material table at once.

    One forward run in phases measures its steps and stores a checkpoint every `checkpoint_every` steps. The
    reverse pass takes the segments from the last to the first. It recomputes each segment on a `warp.Tape`
    and differentiates it. The cost does not depend on the number of unknowns. The result is the derivative of
    the discrete response, with fixed time steps and fixed contact decisions (README.md).

    ``model``: the model to simulate. ``samples``: one sample: where to differentiate. ``sampling``: the
    recorded times. ``objective``: ``objective(histories) -> (value, cotangent)``: a number and, as
    `Histories` of the same shapes, its derivative by every entry. Begin a cotangent with `Histories.zeros`.
    ``stepping``: numerical choices; fp64 only. ``steps``: the time steps to take; default: measured as by
    `explicit.run`. ``checkpoint_every``: steps of a segment. Raises ValueError if there is not exactly one
    sample, or a requested time is before the start. If the wave in a bar returns within a segment, or the run
    does not reach its end. If the cotangent and the histories have different shapes.
    """
    if checkpoint_every < 1:
        raise ValueError(f"checkpoint_every must be >= 1 step, got {checkpoint_every}")
    ready = plan(model, samples, stepping or Stepping(), checkpoint_every)
    forward = run_forward(ready, sampling, steps)
    value, cotangent = objective(forward.histories)
    for name, values in cotangent.items():
        shape = getattr(forward.histories, name).shape
        if np.shape(values) != shape:
            raise ValueError(f"the cotangent's {name} must have shape {shape}, got {np.shape(values)}")
    raw = reverse(ready, sampling, forward, cotangent)
    return Gradient(
        objective=float(value),
        histories=forward.histories,
        friction=float(raw["friction"][0]),
        law=raw["row"],
        steps=forward.steps,
        memory=forward.memory + ready.window.memory,
        **_by_parameter(model, samples, raw["solids"][0]),
    )


def forward_run(
    model: Model,
    samples: Samples,
    sampling: Sampling,
    *,
    stepping: Stepping | None = None,
    steps: StepSequence | None = None,
) -> tuple[Histories, StepSequence]:
    """The forward run of `gradient` without the reverse pass, for difference quotients. It can repeat given
    steps.

    Raises ValueError as `gradient`.
    """
    forward = run_forward(plan(model, samples, stepping or Stepping(), CHECKPOINT_EVERY), sampling, steps)
    return forward.histories, forward.steps


def _by_parameter(model: Model, samples: Samples, solid: NDArray[np.void]) -> dict[str, float]:
    """Derivatives by the parameters from those by moduli and viscosities (chain rule of
    `explicit.arguments.batch_of`)."""
    m, nu, beta = (float(getattr(samples, f.name)[0]) for f in fields(samples)[:3])
    at_rest = model.materials[int(samples.material[0])].initial_shear_modulus
    mu, chi, full = at_rest * m, model.hourglass, float(model.damping_kind == "full")
    ratio = 2.0 * (1.0 + nu) / (3.0 * (1.0 - 2.0 * nu))  # K / mu
    by_ratio = mu * (solid["bulk"] + full * beta * solid["bulk_viscosity"])
    by_beta = (
        solid["shear_viscosity"] + full * ratio * solid["bulk_viscosity"] + chi * solid["hourglass_viscosity"]
    )
    by_mu = ratio * solid["bulk"] + chi * solid["hourglass"] + beta * by_beta
    return {
        "stiffness_factor": float(solid["scale"] + at_rest * by_mu),
        "poisson": float(by_ratio * 2.0 / (1.0 - 2.0 * nu) ** 2),
        "damping": float(mu * by_beta),
        "mass_damping": float(solid["mass_damping"]),
        "shear_modulus": float(m * by_mu),
    }


RELATIVE_STEP = 1e-7
"""Relative step of the differences of a table by its curve. The measured relative error is 1e-9."""


def by_table(gradient: Gradient, law: MarlowLaw) -> tuple[FloatArray, FloatArray]:
    """Derivatives of the objective by the knots of the law's table, with quotients and slopes as independent
    variables.

    ``gradient``: of a model whose sample has this law. ``law``: the law. Returns: derivative by 2 U' at each
    knot [1/Pa]. The first one is also the initial shear modulus. Its effect on the bulk modulus, the damping
    and the hourglass control is included. Returns: derivative by the slope of 2 U' in s at each knot [1/Pa].
    Raises ValueError if the gradient has another number of constants than the law.
    """
    n = len(law.parameters())
    if len(gradient.law) != n:
        raise ValueError(f"the gradient has {len(gradient.law)} constants of a law, this law has {n}")
    count = len(law.quotient)
    by_value, by_rise, by_square, by_cube = gradient.law[n - 5 * count : n - count].reshape(-1, 4).T.copy()
    # An interval's square and cubic coefficients follow from both ends (`MarlowLaw.cubics`); beyond the data
    # they are 0.
    square, cube = by_square[:-1], by_cube[:-1]
    by_value[:-1] -= 3.0 * square - 2.0 * cube
    by_value[1:] += 3.0 * square - 2.0 * cube
    by_rise[:-1] -= 2.0 * square - cube
    by_rise[1:] -= square - cube
    by_value[0] += gradient.shear_modulus
    return by_value, by_rise * law.step  # the row stores slopes times the step


def by_curve_stress(
    gradient: Gradient, stretch: FloatArray, stress: FloatArray, *, n_knots: int = 129
) -> FloatArray:
    """Derivative of the objective by the stress of each point of the uniaxial curve.

    The table is linear in the stresses of the curve except for the slopes of the monotone cubic. Its
    derivative is computed by central differences of `marlow_from_curve`, which needs no simulation.

    ``gradient``: of a model whose sample has the law ``marlow_from_curve(stretch, stress, n_knots=n_knots)``.
    ``stretch``, ``stress``, ``n_knots``: the curve, as there; shape [n]. Returns: derivatives [1/Pa], 0 for a
    point at rest. Raises ValueError as `marlow_from_curve`, or if the gradient is of another law.
    """
    law = marlow_from_curve(stretch, stress, n_knots=n_knots)
    by_quotient, by_slope = by_table(gradient, law)
    by_stress = np.zeros(len(stress))
    for i in np.flatnonzero(np.asarray(stress) != 0.0):
        h = RELATIVE_STEP * abs(stress[i])
        ends = []
        for side in (h, -h):
            shifted = np.array(stress, dtype=float)
            shifted[i] += side
            ends.append(marlow_from_curve(stretch, shifted, n_knots=n_knots))
        quotient = (ends[0].quotient - ends[1].quotient) / (2.0 * h)
        slope = (ends[0].slope - ends[1].slope) / (2.0 * h)
        by_stress[i] = by_quotient @ quotient + by_slope @ slope
    return by_stress
