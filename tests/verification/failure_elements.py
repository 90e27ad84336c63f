"""One-point elements and masses of an undeformed mesh of rectangles, in closed form with NumPy alone.

Over the ring of a rectangle a <= R <= b, c <= Y <= d the bilinear shape functions have simple integrals; with
Rm = (a + b) / 2 and the weights w = (2a + b, a + 2b) / (6 Rm) of its two edges, the mean gradients are
dN/dR = -+1 / (2 (b - a)), dN/dY = -+w / (d - c) and N / R = 1 / (4 Rm).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from explicit import Mesh
from explicit.mesh import element_geometry

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Rectangles:
    """What the elements of a mesh are made of."""

    quads: NDArray[np.int64]
    """Corner nodes, shape [n_elements, 4]."""
    volume: FloatArray
    """Volume over a full turn [m^3], shape [n_elements]."""
    gradient_r: FloatArray
    """Mean dN/dR of each corner [1/m], shape [n_elements, 4]."""
    gradient_y: FloatArray
    """Mean dN/dY of each corner [1/m], shape [n_elements, 4]."""
    hoop: FloatArray
    """Mean N / R of each corner [1/m], shape [n_elements, 4]."""
    corner_mass: FloatArray
    """Each corner's share of the mass [kg], shape [n_elements, 4]."""


def rectangles(mesh: Mesh, density: float) -> Rectangles:
    """Integrate the elements of a mesh whose corners run lower left, lower right, upper right, upper left."""
    R, Y = mesh.nodes[mesh.quads, 0], mesh.nodes[mesh.quads, 1]
    a, b, height = R[:, 0], R[:, 1], Y[:, 3] - Y[:, 0]
    mean, width = 0.5 * (a + b), b - a
    left, right = (2.0 * a + b) / (6.0 * mean), (a + 2.0 * b) / (6.0 * mean)
    across = 0.5 / width[:, None] * np.array([-1.0, 1.0, 1.0, -1.0])
    along = np.stack([-left, -right, right, left], axis=1) / height[:, None]
    volume = 2.0 * np.pi * mean * width * height
    share = 0.5 * np.stack([left, right, right, left], axis=1)
    return Rectangles(
        quads=mesh.quads,
        volume=volume,
        gradient_r=across,
        gradient_y=along,
        hoop=np.repeat(0.25 / mean[:, None], 4, axis=1),
        corner_mass=density * volume[:, None] * share,
    )


@dataclass(frozen=True)
class State:
    """The deformation gradient of every element: F = [[f11, h12], [h21, f22]] and f33, shape [n_elements]."""

    f11: FloatArray
    h12: FloatArray
    h21: FloatArray
    f22: FloatArray
    f33: FloatArray

    @property
    def plane(self) -> FloatArray:
        """Planar part of det F [-]."""
        return self.f11 * self.f22 - self.h12 * self.h21

    @property
    def J(self) -> FloatArray:
        """det F [-]."""
        return self.plane * self.f33

    @property
    def upright(self) -> FloatArray:
        """The smaller of det F and its planar part [-]: an element above 0 has not turned inside out."""
        return np.minimum(self.J, self.plane)

    @property
    def s(self) -> FloatArray:
        """sqrt(I1_bar - 3) [-]; NaN where J <= 0."""
        squared = self.f11**2 + self.h12**2 + self.h21**2 + self.f22**2 + self.f33**2
        J = np.where(self.J > 0.0, self.J, np.nan)
        return np.sqrt(np.maximum(squared * J ** (-2.0 / 3.0) - 3.0, 0.0))


def state(elements: Rectangles, displacement: FloatArray) -> State:
    """The deformation of every element from nodal displacements (u_r, u_y) [m], shape [n_nodes, 2]."""
    u_r, u_y = displacement[elements.quads, 0], displacement[elements.quads, 1]
    return State(
        f11=1.0 + (elements.gradient_r * u_r).sum(axis=1),
        h12=(elements.gradient_y * u_r).sum(axis=1),
        h21=(elements.gradient_r * u_y).sum(axis=1),
        f22=1.0 + (elements.gradient_y * u_y).sum(axis=1),
        f33=1.0 + (elements.hoop * u_r).sum(axis=1),
    )


def kinetic_energy(elements: Rectangles, velocity: FloatArray) -> float:
    """Kinetic energy of the lumped masses [J]."""
    squared = (velocity**2).sum(axis=1)[elements.quads]
    return float(0.5 * (elements.corner_mass * squared).sum())


def step_bound(
    mesh: Mesh, elements: Rectangles, F: State, *, shear: float, bulk: float, hourglass: float
) -> FloatArray:
    """omega^2 of every element of an undamped neo-Hookean solid [1/s^2], as docs/theory/solver.md has it.

    The hourglass constants are those of `explicit.mesh`.
    """
    b_r = (F.f22[:, None] * elements.gradient_r - F.h21[:, None] * elements.gradient_y) / F.plane[:, None]
    b_y = (F.f11[:, None] * elements.gradient_y - F.h12[:, None] * elements.gradient_r) / F.plane[:, None]
    c = elements.hoop / F.f33[:, None]
    w_y = 1.0 / elements.corner_mass
    w_r = np.where(mesh.on_axis[elements.quads], 0.0, w_y)
    rank_one = (w_r * (b_r + c) ** 2 + w_y * b_y**2).sum(axis=1)
    gradient = b_r**2 + b_y**2
    trace = (w_r * (gradient + c**2) + w_y * gradient).sum(axis=1)
    iso = F.J ** (-2.0 / 3.0)
    rr, yy = iso * (F.f11**2 + F.h12**2), iso * (F.f22**2 + F.h21**2)
    ry, tt = iso * (F.f11 * F.h21 + F.h12 * F.f22), iso * F.f33**2
    largest = np.maximum(np.maximum(rr, yy) + np.abs(ry), tt)
    volumetric = bulk * F.J * np.maximum(2.0 * F.J - 1.0, 0.5) * rank_one
    g = element_geometry(mesh)
    control = (g.gamma**2 * (w_r * g.hourglass_r[:, None] + w_y * g.hourglass_y[:, None])).sum(axis=1)
    stiff = elements.volume * (volumetric + 2.0 * shear * largest * trace)
    return np.asarray(stiff + hourglass * shear * control)
