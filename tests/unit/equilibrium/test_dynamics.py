"""Motions against closed forms: fall, a bar's vibration in both schemes, relaxation at a held stretch."""

from dataclasses import replace

import numpy as np
import pytest

from explicit.materials import LAWS
from kolsky.equilibrium.dynamics import Prony, element_masses, march
from kolsky.equilibrium.meshes import box, rectangle
from kolsky.equilibrium.model import Coupled, Fixed, Gravity, Model, NodalForce, Prescribed
from kolsky.equilibrium.solid import Isotropic, bulk
from kolsky.equilibrium.solve import solve

MU, K, RHO = 2e5, 1.5e6, 1000.0
RUBBER = Isotropic(LAWS["neo_hookean"].of([MU]), bulk(K))


def bar(*extra, cells=1):
    """A bar that moves along x alone."""
    mesh = box((0.1, 0.02, 0.02), (cells, 1, 1), kind="hex8")
    every = mesh.with_set("every", np.arange(len(mesh.points)))
    return Model(every, RUBBER, (Fixed("left", (0,)), Fixed("every", (1, 2)), *extra))


@pytest.mark.parametrize("kind", ["hex8", "hex27", "tet4", "tet10"])
def test_mass_is_that_of_the_body(kind):
    model = Model(box((0.1, 0.02, 0.03), (2, 1, 1), kind=kind), RUBBER)
    masses = element_masses(model, RHO)
    k = masses.shape[1]
    along = np.tile([1.0, 0.0, 0.0], k // 3)
    assert np.einsum("mij,i,j->", masses, along, along) == pytest.approx(RHO * 0.1 * 0.02 * 0.03)


@pytest.mark.parametrize("scheme", ["backward_euler", "trapezoidal"])
def test_a_body_falls(scheme):
    mesh = box((0.01, 0.01, 0.01), (1, 1, 1), kind="hex8")
    model = Model(mesh, RUBBER, (Gravity(RHO, (0.0, 0.0, -9.81)),))
    dt, n = 0.01, 5
    found = march(model, None, dt, density=RHO, scheme=scheme, steps=n)
    k = np.arange(n + 1)
    # sums of g dt over the steps; the trapezoidal rule is exact for a constant acceleration
    fall = 0.5 * k * (k + 1) if scheme == "backward_euler" else 0.5 * k**2
    assert found.displacements[:, :, 2].mean(axis=1) == pytest.approx(-9.81 * dt**2 * fall, rel=1e-6)


@pytest.mark.parametrize("scheme", ["backward_euler", "trapezoidal"])
def test_vibration_of_a_bar(scheme):
    model = bar(Coupled("right", 0))
    # one linear element: k = M A / L, m = rho A L / 3
    omega = np.sqrt(3.0 * (K + 4.0 / 3.0 * MU) / RHO) / 0.1
    dt, small = 0.2 / omega, 1e-8
    start = np.zeros_like(model.mesh.points)
    start[model.mesh.nodes("right"), 0] = small
    found = march(model, None, dt, density=RHO, scheme=scheme, steps=20, start=start, tolerance=1e-9)
    assert found.outcome.ok
    k = np.arange(21)
    if scheme == "backward_euler":
        exact = np.real((1.0 - 1j * omega * dt) ** (-k.astype(float)))
    else:
        exact = np.cos(2.0 * k * np.arctan(0.5 * omega * dt))
    assert found.mean_displacement("right")[:, 0] / small == pytest.approx(exact, abs=1e-5)


def test_stress_relaxes_as_the_series_says():
    model = bar(Prescribed("right", 0, "pull"), cells=2)
    series, dt, n = Prony((0.3, 0.2), (0.05, 0.4)), 0.02, 6
    pull = {"pull": np.full(n, 0.02)}
    # slow enough for inertia to be nothing: a light body
    slow = march(model, pull, dt, density=1e-6).reaction("right")[1:, 0]
    found = march(model, pull, dt, density=1e-6, prony=series).reaction("right")[1:, 0]
    k = np.arange(n)
    more = sum(
        b * np.exp(-0.5 * dt / t - k * dt / t) for b, t in zip(series.shares, series.times, strict=True)
    )
    assert found / slow == pytest.approx(1.0 + more, rel=1e-9)


def test_a_free_end_creeps_to_where_slow_loading_ends():
    model = bar(Coupled("right", 0, "force"))
    series, dt = Prony((0.5,), (0.02,)), 0.01
    found = march(model, {"force": np.full(60, 20.0)}, dt, density=1e-3, prony=series)
    slow = march(model, {"force": np.full(60, 20.0)}, dt, density=1e-3)
    assert found.outcome.ok
    u, v = found.mean_displacement("right")[:, 0], slow.mean_displacement("right")[:, 0]
    assert u[1] < 0.8 * v[1]
    assert u[-1] == pytest.approx(v[-1], rel=1e-6)


def test_what_cannot_be_is_refused():
    with pytest.raises(ValueError, match="shares"):
        Prony((0.1, 0.2), (1.0,))
    with pytest.raises(ValueError, match="density"):
        march(bar(), None, 1e-3, density=0.0)
    with pytest.raises(ValueError, match="scheme"):
        march(bar(), None, 1e-3, density=1.0, scheme="leapfrog")


def test_a_shallow_arch_snaps_through_and_rests_in_equilibrium():
    span, rise, thick = 1.0, 0.06, 0.02
    flat = rectangle((span, thick), (12, 1), kind="quad9")
    x = flat.points[:, 0]
    points = flat.points + np.column_stack([np.zeros_like(x), rise * np.sin(np.pi * x / span)])
    mesh = replace(flat, points=points)
    top = np.flatnonzero((np.abs(x - 0.5 * span) < 1e-9) & (flat.points[:, 1] > thick - 1e-9))
    mesh = mesh.with_set("apex", top)
    ends = (Fixed("left"), Fixed("right"))
    model = Model(mesh, RUBBER, (*ends, NodalForce("apex", 1, "load")), kinematics="plane_strain")
    # more force than the arch carries upright; backward Euler takes the energy of the snap out
    force = {"load": -20.0 * np.minimum(np.arange(1, 49) / 10.0, 1.0)}
    found = march(model, force, 0.06, density=RHO, tolerance=1e-7)
    assert found.outcome.ok
    apex = found.mean_displacement("apex")[:, 1]
    assert -0.3 * rise < apex[1] < 0.0  # upright under a tenth of it
    assert apex[-1] < -1.5 * rise
    rest = solve(model, {"load": [-20.0]}, guess=found.displacements[-1:])
    assert rest.outcome.ok
    # the slowest motion that is left takes 12 steps, and backward Euler keeps cos(2 pi / 12) of it in each:
    # of the first swing past the rest, 0.28 rises at step 12, 36 steps leave 0.28 * 0.866^36 = 1.6e-3
    assert found.displacements[-1] == pytest.approx(rest.displacements[0], abs=2e-3 * rise)
