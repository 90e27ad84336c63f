"""Batches, precision, and the effect of each kind of damping on the step."""

from dataclasses import fields
from functools import cache
from types import SimpleNamespace
from typing import Literal

import numpy as np
import pytest
from scene import DENSITY, LENGTH, RADIUS, shear_modulus, speed_after_rise

from explicit import Model, Response, Samples, Sampling, Stepping, cylinder, run
from explicit.materials import marlow_from_curve, neo_hookean

END = 1.5e-3
TIMES = np.linspace(0.0, END, 301)[1:]
Precision = Literal["fp32", "fp64"]
PRECISIONS: tuple[Precision, ...] = ("fp64", "fp32")
FORCE_TOLERANCE, PLACE_TOLERANCE = 0.01, 0.2e-6
"""Allowed difference of single from double precision: force [N] (of some 20 N) and position [m]; both far
below what an instrument resolves (3 N, 0.03 mm)."""
DAMPING = (2.5e-5, 1e-4)  # the two stiffness-proportional dampings of the paper [s]
STEP_TOLERANCE = 1e-3
"""Allowed relative error of the step with full damping [-]: at rest the damping is exactly beta times the
stiffness, so only the solver's floor of the volumetric factor and rounding are left."""


Result = SimpleNamespace


def same_bits(a: Response, i: int, b: Response, j: int) -> bool:
    """Whether row i of one response and row j of another agree in every array, NaN included."""
    one, other = a.select([i]), b.select([j])
    arrays = [
        (getattr(one, f.name), getattr(other, f.name))
        for f in fields(Response)
        if isinstance(getattr(one, f.name), np.ndarray)
    ]
    arrays += [(getattr(one.energy, f.name), getattr(other.energy, f.name)) for f in fields(one.energy)]
    same = all(np.array_equal(x, y, equal_nan=x.dtype.kind == "f") for x, y in arrays)
    return same and one.outcomes == other.outcomes


def _model() -> Model:
    """Coulomb contact, two materials and two motions to choose from; small."""
    stretch = np.linspace(0.3, 0.97, 30)
    mu = shear_modulus(0.495)
    stiffening = marlow_from_curve(stretch, mu * (1.6 - 0.6 * stretch) * (stretch - stretch**-2))
    motions = tuple(speed_after_rise(speed, 50e-6, end=END) for speed in (2.6, 1.8))
    plain = marlow_from_curve(stretch, mu * (stretch - stretch**-2))
    mesh = cylinder(RADIUS, LENGTH, n_radial=8, n_axial=11)
    return Model(mesh, DENSITY, (plain, stiffening), motions, faces="coulomb", side="coulomb")


SEVEN = {
    "stiffness_factor": np.array([1.0, 0.8, 1.2, 1.0, 1.1, 0.9, 1.0]),
    "poisson": np.array([0.495, 0.49, 0.499, 0.495, 0.45, 0.495, 0.498]),
    "damping": np.array([0.0, 2.5e-5, 1e-4, 0.0, 2.5e-5, 5e-5, 1e-5]),
    "friction": np.array([0.0, 0.1, 0.3, 0.5, 1.0, 0.2, 2.0]),
    "mass_damping": np.array([0.0, 100.0, 0.0, 50.0, 0.0, 10.0, 0.0]),
    "material": np.array([0, 1, 0, 1, 1, 0, 0]),
    "motion": np.array([0, 0, 1, 1, 0, 1, 0]),
}
"""Seven different simulations."""


def _seven(precision: Precision) -> dict[str, bool]:
    """Compare a batch of seven, with one and two threads, with seven batches of one."""
    model, sampling, stepping = _model(), Sampling(TIMES, TIMES[9::10]), Stepping(precision=precision)
    single = [
        run(model, Samples.of(**{k: v[i : i + 1] for k, v in SEVEN.items()}), sampling, stepping=stepping)
        for i in range(7)
    ]
    same = {}
    for threads in (1, 2):
        batch = run(model, Samples.of(**SEVEN), sampling, stepping=stepping, threads=threads)
        same[f"{precision}, {threads} thread{'s' * (threads > 1)}"] = all(
            same_bits(batch, i, one, 0) for i, one in enumerate(single)
        )
    return same


def first_step(damping: float, kind: Literal["deviatoric", "full"]) -> float:
    """Step of the undeformed 16 × 22 specimen [s], with the whole stability bound."""
    motion = speed_after_rise(2.6, 50e-6, end=END)
    material = neo_hookean(shear_modulus(0.495))
    model = Model(cylinder(RADIUS, LENGTH), DENSITY, (material,), (motion,), damping_kind=kind)
    start = Sampling(np.array([1e-9]), np.array([1e-9]))
    samples = Samples.of(poisson=0.495, damping=damping)
    return float(run(model, samples, start, stepping=Stepping(safety=1.0)).smallest_step[0])


@cache
def case() -> Result:
    """Bits and differences in both precisions, and steps."""
    same = {name: value for precision in PRECISIONS for name, value in _seven(precision).items()}

    motion = speed_after_rise(2.6, 50e-6, end=END)
    model = Model(cylinder(RADIUS, LENGTH), DENSITY, (neo_hookean(shear_modulus(0.495)),), (motion,))
    double, single = (
        run(model, Samples.of(poisson=0.495), Sampling(TIMES, TIMES), stepping=Stepping(precision=name))
        for name in PRECISIONS
    )
    forces = ("force_flyer", "force_transmission")
    places = ("surface_r", "surface_y")
    undamped = first_step(0.0, "deviatoric")
    xi = np.array(DAMPING) / undamped  # beta omega / 2 with the bound's own omega = 2 / step
    return Result(
        # Whether every row of a batch of seven is the single simulation to the last bit, by precision and
        # threads.
        same=same,
        # largest force difference of single from double precision [N]
        force_difference=max(float(np.abs(getattr(single, n) - getattr(double, n)).max()) for n in forces),
        # largest position difference of the side surface [m]
        place_difference=max(float(np.abs(getattr(single, n) - getattr(double, n)).max()) for n in places),
        largest_force=float(double.force_flyer.max()),  # largest force [N]
        # Step at rest undamped, with deviatoric and with full damping [s], shape [n_dampings].
        steps={
            "undamped": np.full(len(DAMPING), undamped),
            "deviatoric": np.array([first_step(beta, "deviatoric") for beta in DAMPING]),
            "full": np.array([first_step(beta, "full") for beta in DAMPING]),
        },
        # closed form of the step with full damping [s], shape [n_dampings]
        predicted=undamped * (np.sqrt(1.0 + xi**2) - xi),
    )


def shown(result: Result) -> dict[str, object]:
    """What the page and the index show beside the fields of the result."""
    bits = [[name, "yes" if value else "NO"] for name, value in result.same.items()]

    steps = [
        [
            f"{beta:g}",
            *(f"{1e6 * result.steps[name][k]:.4f}" for name in ("undamped", "deviatoric", "full")),
            f"{1e6 * result.predicted[k]:.4f}",
            f"{result.steps['deviatoric'][k] / result.steps['full'][k]:.1f}",
        ]
        for k, beta in enumerate(DAMPING)
    ]
    header = [
        "damping [s]", "undamped [µs]", "deviatoric [µs]", "full [µs]", "full, closed form [µs]",
        "deviatoric / full",
    ]  # fmt: skip
    return locals()


@pytest.mark.parametrize("precision", PRECISIONS)
@pytest.mark.parametrize("threads", ["1 thread", "2 threads"])
def test_batch_of_one_is_a_row_of_a_batch_of_seven_to_the_last_bit(precision: str, threads: str) -> None:
    assert case().same[f"{precision}, {threads}"]


def test_single_precision_is_enough() -> None:
    result = case()
    assert result.force_difference < FORCE_TOLERANCE
    assert result.place_difference < PLACE_TOLERANCE
    assert result.force_difference > 0.0  # the two are different arithmetic, not one kernel used twice


def test_step_with_full_damping_is_the_closed_form() -> None:
    result = case()
    np.testing.assert_allclose(result.steps["full"], result.predicted, rtol=STEP_TOLERANCE)


def test_deviatoric_damping_hardly_touches_the_step_and_full_divides_it() -> None:
    steps = case().steps
    # beta mu << beta K at nu = 0.495: xi is a hundredth of full damping's for the volumetric mode, and the
    # shear modes, ten times slower, set it: between half of the undamped step and all of it.
    assert (steps["deviatoric"] > 0.4 * steps["undamped"]).all()
    assert (steps["deviatoric"] < steps["undamped"]).all()
    assert (steps["deviatoric"] / steps["full"] > 10.0).all()
