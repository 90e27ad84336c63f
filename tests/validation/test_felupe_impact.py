"""The impact test by FElupe: its laws, its tangent, a wave, and the solver of this package."""

from argparse import Namespace
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from kolsky.virtual.instruments import free_outline, measure_outline
from kolsky.virtual.material import law_of
from kolsky.virtual.schema import Specification, TruthTable
from kolsky.virtual.specification import read_specification
from kolsky.virtual.truth import KNOT, SurfaceHistory, TruthError, simulate_truths
from populations.coverage_problem import HEIGHTS, drawn, stroke, velocity
from populations.felupe_impact import AXIAL, RADIAL, Cylinder, Flyer, History, Solid, simulate, slopes, truth
from populations.other_program import thinned
from populations.wrong_inputs import POPULATION

LAWS = read_specification(POPULATION).declared.population.draw["material"].choose
FILE = Path(__file__).parents[1] / "reference" / "M_bonded.csv"
NUMBER, SEED = 0, 61
"""Of the experiment in `FILE`; made by `python -m populations.other_program --csv 0 --out FOLDER`."""
LOWEST = 1.2  # lowest order of the mesh error that was found (docs/validation/coverage.md)


class Push:
    """A flyer that reaches a speed [m/s] within a rise [s], with the slope of a sine squared."""

    start = 0.0

    def __init__(self, speed: float, rise: float):
        self.speed, self.rise = speed, rise

    def velocity(self, t: Any) -> Any:
        s = np.clip(np.asarray(t) / self.rise, 0.0, 1.0)
        return self.speed * np.sin(0.5 * np.pi * s) ** 2

    def displacement(self, t: Any) -> Any:
        t = np.maximum(np.asarray(t), 0.0)
        s = np.minimum(t, self.rise)
        ramp = 0.5 * s - self.rise / (2.0 * np.pi) * np.sin(np.pi * s / self.rise)
        return self.speed * (ramp + np.maximum(t - self.rise, 0.0))


def solid(mu: float, nu: float, damping: float = 0.0) -> Solid:
    material = {
        "law": "neo_hookean", "parameters": {"mu": 1.0}, "shear_modulus": f"{mu} Pa", "poisson": nu,
        "damping": f"{damping} s", "stiffness_factor": 1.0,
    }  # fmt: skip
    return Solid.of(Specification.model_validate({"material": material}))


@pytest.mark.parametrize("table", LAWS, ids=[one["law"] for one in LAWS])
def test_the_laws_are_those_of_the_population(table):
    """U' and U'' of every law that is drawn, against this package's own formula."""
    law = law_of(table["law"], table["parameters"], 1.0)
    I1 = np.linspace(3.0, 12.0, 7)
    first, second = slopes(table["law"], table["parameters"])
    np.testing.assert_allclose(first(I1), law.dW_dI(I1, I1)[0], rtol=1e-12)
    np.testing.assert_allclose(second(I1), law.d2W_dI2(I1, I1)[0], rtol=1e-12, atol=1e-15)


def test_another_law_is_refused():
    with pytest.raises(ValueError, match="no truth of mooney_rivlin"):
        slopes("mooney_rivlin", {"C10": 1.0, "C01": 0.1})


def test_the_stress_of_a_stretch_and_its_rate_by_hand():
    """F = diag(a, b, b), of volume 1, with rate diag(d, 0, 0): mu dev(F F^T) + 2 eta dev D + p."""
    one = solid(30e3, 0.499, damping=20e-6)
    a = 0.7
    b, d = a**-0.5, -400.0
    F, rate = np.diag([a, b, b])[..., None], np.diag([d, 0.0, 0.0])[..., None]
    elastic = 30e3 * (np.array([a**2, b**2, b**2]) - (a**2 + 2.0 * b**2) / 3.0)
    viscous = 2.0 * 20e-6 * 30e3 * d / a * np.array([2.0, -1.0, -1.0]) / 3.0
    P = one.stress(F, rate, np.array([5e3]))[..., 0]
    np.testing.assert_allclose(P @ F[..., 0].T, np.diag(elastic + viscous + 5e3), atol=1e-9 * 30e3)
    assert one.bulk == pytest.approx(2.0 * 30e3 * 1.499 / (3.0 * 0.002))


def test_the_tangent_is_the_difference_of_the_forces():
    """On a sheared body in motion, with the eliminated pressure."""
    body = Cylinder(solid(30e3, 0.499, damping=20e-6), 5e-3, 6e-3, 1000.0, (2, 2))
    rng = np.random.default_rng(5)
    u, rest, way = rng.standard_normal((3, body.nodes.size))
    body.set_rate(1e6, rest)
    u, way = 1e-5 * u, 1e-9 * way
    found = 0.5 * (body.forces(u + way) - body.forces(u - way))
    np.testing.assert_allclose(body.tangent(u) @ way, found, atol=1e-6 * np.abs(found).max())


def test_the_mass_is_that_of_the_body():
    body = Cylinder(solid(30e3, 0.499), 5e-3, 6e-3, 1000.0, (3, 2))
    axial = np.zeros(body.nodes.size)
    axial[AXIAL::2] = 1.0
    assert axial @ body.mass @ axial == pytest.approx(1000.0 * np.pi * 5e-3**2 * 6e-3, rel=1e-12)


def test_a_wave_without_lateral_motion():
    """nu = 0, small strain: the flyer feels rho c A v, the other platen twice that, one passage later.

    The strain v / c is 1e-3, which is also the difference of finite and small strain, relative to the force.
    The two together take up to 3 ‰ here. The reflected force has twice this strain.
    """
    mu, rho, radius, length = 30e3, 1000.0, 2e-3, 10e-3
    c = np.sqrt(2.0 * mu / rho)
    passage = length / c
    push = Push(1e-3 * c, passage)
    body = Cylinder(solid(mu, 0.0), radius, length, rho, (1, 12))
    history = simulate(body, Flyer(push), 1.9 * passage, passage / 50.0)
    t = passage * np.linspace(0.0, 1.9, 96)
    transmitted, incident = history.forces(t)
    unit = rho * c * np.pi * radius**2
    np.testing.assert_allclose(incident, unit * push.velocity(t), atol=2e-3 * unit * push.speed)
    np.testing.assert_allclose(
        transmitted, 2.0 * unit * push.velocity(t - passage), atol=5e-3 * unit * push.speed
    )
    side = history.outline(t)
    np.testing.assert_allclose(side[:, -1, AXIAL], length - push.displacement(t), atol=1e-12)
    np.testing.assert_allclose(side[..., RADIAL], radius, atol=1e-3 * push.displacement(t[-1]))


def test_forces_and_outlines_between_the_steps():
    times = np.array([0.0, 1.0, 2.0])
    side = np.arange(12.0).reshape(3, 2, 2)
    history = History(times, 10.0 * times, times**2, np.array([0.0, 2.0, 4.0]), side, {})
    transmitted, incident = history.forces(np.array([0.5, 2.0]))
    np.testing.assert_allclose(transmitted, [5.0, 20.0])
    np.testing.assert_allclose(incident, [0.5, 4.0])
    np.testing.assert_allclose(
        history.outline(np.array([0.0, 0.5, 2.0, 3.0, 4.0]))[:, 1, 0], [2, 3, 6, 8, 10]
    )


def test_the_side_folds_onto_the_platens():
    """Every node stays between them. Where one has landed, it moves with its platen and does not slip."""
    body = Cylinder(solid(30e3, 0.499, damping=20e-6), 5e-3, 6e-3, 1000.0, (6, 4))
    push = Push(3.0, 60e-6)
    history = simulate(body, Flyer(push), 0.8e-3, 4e-6)
    level = body.length - push.displacement(history.times)
    y, r = np.moveaxis(history.side, -1, 0)
    assert (y > -1e-12).all()
    assert (y < level[:, None] + 1e-12).all()
    landed = 0
    for on in (y[:, 1:-1] < 1e-12, y[:, 1:-1] > level[:, None] - 1e-12):
        assert (on[1:] >= on[:-1]).all()
        both = on[1:] & on[:-1]
        assert np.ptp(np.diff(r[:, 1:-1], axis=0)[both]) == 0.0
        landed += on[-1].sum()
    assert landed == history.count["landed"] > 1


def rms(values):
    return float(np.sqrt(np.mean(values**2)))


@pytest.mark.slow
def test_force_and_outline_are_those_of_this_packages_solver():
    """Its meshes converge to FElupe's result at their order, with 1.2 at the least."""

    def shot(*mesh):
        return Specification.model_validate(
            {
                "truth": {"mesh": mesh, "grading": 5, "element": "middle"},
                "material": {"poisson": 0.495},
                "motion": {"compression": "15 %", "speed": "3 m/s"},
                "frames": {"rate": "60 kHz"},
                "exports": {"outline_sigma": "1e-12 m"},
            }
        )

    shots = shot(16, 22), shot(32, 44)
    expected = truth(shots[0], (16, 11), 1e-6)
    coarse, fine = simulate_truths(shots)
    np.testing.assert_array_equal(coarse.force_time, expected.force_time)
    np.testing.assert_array_equal(coarse.surface.time, expected.surface.time)
    for name in ("displacement", "tilt"):
        np.testing.assert_array_equal(getattr(coarse.surface, name), getattr(expected.surface, name))
    np.testing.assert_array_equal(coarse.flyer_acceleration, expected.flyer_acceleration)
    for part in (
        lambda one: one.transmitted,
        lambda one: one.incident[: -int(30e-6 / KNOT)],  # the flyer of this package stops after the record
        lambda one: measure_outline(shots[0], one, shot=0).Z,
    ):
        assert rms(part(fine) - part(expected)) < 2.0**-LOWEST * rms(part(coarse) - part(expected))


@pytest.mark.long  # more than a minute of one core
def test_force_and_outline_are_those_of_dolfinx():
    """The same elements, steps and landings: the forces differ by the ends of the iterations.

    The reference's radii lie on its elements' quadratic, those here on a spline through the nodes.
    """
    expected = np.loadtxt(FILE, delimiter=",", skiprows=1)
    setup, t = drawn(NUMBER, SEED)
    flyer = SimpleNamespace(
        start=0.0,
        displacement=lambda time: stroke(time, setup, t),
        velocity=lambda time: velocity(time, setup, t),
    )
    first, second = slopes("yeoh", {"C10": 0.5, "C20": t.second / 4.0, "C30": t.third / 6.0})
    mu, nu = t.stiffness_factor * t.shear_modulus, t.poisson
    bulk = 2.0 * mu * (1.0 + nu) / (3.0 * (1.0 - 2.0 * nu))
    one = Solid(lambda I: mu * first(I), lambda I: mu * second(I), bulk, t.damping * mu)
    body = Cylinder(one, 0.5 * setup.diameter, setup.length, setup.density, (24, 16))
    history = simulate(body, Flyer(flyer), setup.end, 0.5e-6)
    frames = setup.frames[setup.frames > 0.0]
    y, r = np.moveaxis(history.outline(frames), -1, 0)
    surface = SurfaceHistory(frames, r, y, np.zeros(len(frames)), np.zeros(len(frames)))
    heights = HEIGHTS * (setup.length - stroke(frames, setup, t))[:, None]
    Z = [np.interp(heights[k], *free_outline(surface, k)) for k in range(len(frames))]
    found = thinned(history.forces(setup.samples)[0], np.array(Z).ravel())
    np.testing.assert_allclose(found[:, 0], expected[:, 0], atol=1e-5)  # 3e-6 N, of 18.7 N
    assert rms(found[:, 1:] - expected[:, 1:]) < 0.2e-6  # 0.10 um


def test_what_felupe_does_not_simulate_is_refused():
    slipping = Specification.model_validate({"imperfections": {"slip_friction": 0.3, "tilt": "1 deg"}})
    with pytest.raises(ValueError, match=r"with imperfections\.slip_friction, imperfections\.tilt"):
        truth(slipping)


def test_the_study_takes_felupes_truths(monkeypatch, tmp_path):
    """One of three simulations fails: the other shots are FElupe's, and no other program makes it."""
    from populations import felupe_impact, wrong_inputs

    asked = []

    def made(quantities):
        asked.append(quantities)
        if len(asked) == 2:
            raise TruthError("no convergence")
        coarse = quantities.model_copy(update={"truth": TruthTable(mesh=(8, 11))})
        return replace(simulate_truths([coarse])[0], flyer_radius=0.0)

    monkeypatch.setattr(felupe_impact, "truth", made)
    args = Namespace(population=POPULATION, seed=77, right=3, shots=0, least=0, workers=1, out=tmp_path)
    args.device, args.threads = "cpu", None
    found = wrong_inputs.made_by_felupe(args)
    assert [one.name for one in found] == ["right-01", "right-03"]
    assert len(asked) == 3
    assert [len(np.load(one / "truth_surface.npz")["r"][0]) for one in found] == [12, 12]
    again = wrong_inputs.made_by_felupe(args)  # only the missing one is tried again
    assert [one.name for one in again] == ["right-01", "right-02", "right-03"]
    assert len(asked) == 4
