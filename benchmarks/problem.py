"""The benchmarks' problem: a flyer test on a Yeoh-like elastomer, varied over stiffness factor and friction.

Like `runs/open-01`: deviatoric damping, nu = 0.499, 55 % compression in 1.4 ms, variable time steps.
"""

import numpy as np
from numpy.typing import NDArray

import explicit
from explicit.materials import bulk_modulus, marlow_from_curve

FloatArray = NDArray[np.float64]

RADIUS, LENGTH = 4.75e-3, 6.5e-3
"""Undeformed specimen [m]."""
DENSITY = 870.0
"""[kg/m^3]"""
SHEAR_MODULUS = 74e3 / 3.0
"""mu_0 [Pa]"""
SECOND, THIRD = 0.2, 0.06
"""2 U' = mu_0 (1 + SECOND (I1 - 3) + THIRD (I1 - 3)^2) [-]."""
POISSON = 0.499
DAMPING = 2.5e-5
"""beta [s]"""
SPEED, RAMP = 2.6, 50e-6
"""Speed of the flyer [m/s], and the time in which it is reached [s]."""
END = 1.4e-3
"""[s]"""
SAMPLING = explicit.Sampling(
    force_times=np.linspace(0.0, END, 169), surface_times=np.linspace(END / 168, END, 168), ledger_every=16
)
"""Records of the runs: forces and outlines at 168 times, energies at every sixteenth of them."""


def stroke(t: FloatArray) -> FloatArray:
    """Path of the flyer [m] at t [s], same shape as t: a smooth ramp of its speed, then SPEED."""
    s = np.clip(t / RAMP, 0.0, 1.0)
    return SPEED * (RAMP * (2.5 * s**4 - 3.0 * s**5 + s**6) + np.maximum(t - RAMP, 0.0))


def flyer() -> explicit.PlatenMotion:
    """The flyer's motion with its velocity, the derivative of `stroke`."""

    def velocity(t: FloatArray) -> FloatArray:
        s = np.clip(t / RAMP, 0.0, 1.0)
        return SPEED * (10.0 * s**3 - 15.0 * s**4 + 6.0 * s**5)

    return explicit.PlatenMotion.sampled(stroke, velocity, start=0.0, end=END, n_knots=2049)


def yeoh() -> tuple[float, float, float, float]:
    """C10, C20, C30 [Pa] and D1 [1/Pa] of the same energy, C10 (I1 - 3) + ... + (J - 1)^2 / D1."""
    mu = SHEAR_MODULUS
    return mu / 2.0, mu * SECOND / 4.0, mu * THIRD / 6.0, 2.0 / float(bulk_modulus(mu, POISSON))


def model(mesh: tuple[int, int], contact: str) -> explicit.Model:
    """The specimen between two platens, meshed with `mesh` elements across and along."""
    stretch = np.linspace(0.36, 0.999, 65)
    shift = stretch**2 + 2.0 / stretch - 3.0
    stress = (stretch - stretch**-2) * SHEAR_MODULUS * (1.0 + SECOND * shift + THIRD * shift**2)
    return explicit.Model(
        mesh=explicit.cylinder(RADIUS, LENGTH, n_radial=mesh[0], n_axial=mesh[1], grading=2.0),
        density=DENSITY,
        materials=(marlow_from_curve(stretch, stress),),
        motions=(flyer(),),
        faces=contact,
        side=contact,
    )


def samples(n: int) -> explicit.Samples:
    """The first n points, row by row, of a square factorial design over m in [0.75, 1.25] and f in [0, 2]."""
    side = int(np.ceil(np.sqrt(n)))
    m, f = np.meshgrid(np.linspace(0.75, 1.25, side), np.linspace(0.0, 2.0, side))
    if n == 1:
        m, f = np.array([[1.0]]), np.array([[0.5]])
    return explicit.Samples.of(
        stiffness_factor=m.ravel()[:n], friction=f.ravel()[:n], poisson=POISSON, damping=DAMPING
    )
