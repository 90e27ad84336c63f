"""Elastic platens, transducers and bars as an axisymmetric mesh, integrated by central differences.

The parts are linear elastic: steel under a soft specimen strains by 1e-6. They are loaded on one face and
free elsewhere. One product of a sparse matrix is one step.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.sparse import csr_array

from explicit.arrays import FloatArray
from explicit.bars.mesh import ElasticMesh, mesh_of, pressed_share
from explicit.bars.sections import Section
from explicit.bars.stiffness import assemble, element_matrices, largest_frequency, nodal_mass


@dataclass(frozen=True)
class ElasticHistory:
    """Response of the parts, at every one of their own steps."""

    times: FloatArray
    """Times [s], shape [n_times]."""
    force: FloatArray
    """Compressive force on the face [N], shape [n_times]."""
    section_force: FloatArray
    """Compressive force through each cross-section [N], shape [n_times, n_depths]."""
    path: FloatArray
    """Mean displacement of the pressed patch, into the parts [m], shape [n_times]. The mean is the one that
    does the force's work."""
    seen: FloatArray
    """Axial displacement of the outer surface at each mark, into the parts [m], shape [n_times, n_marks]."""
    external: FloatArray
    """Work of the force [J], shape [n_times]."""
    kinetic: FloatArray
    """Kinetic energy [J], shape [n_times]."""
    elastic: FloatArray
    """Strain energy [J], shape [n_times]."""

    @cached_property
    def face_motion(self) -> CubicSpline:
        """The path as a function of time [m]; ``face_motion(t, 1)`` is its velocity [m/s]."""
        return CubicSpline(self.times, self.path)

    def imbalance(self) -> float:
        """Largest |work - kinetic - elastic| over the largest work [-]."""
        residual = self.external - self.kinetic - self.elastic
        return float(np.abs(residual).max() / np.abs(self.external).max())


@dataclass(frozen=True)
class ElasticBar:
    """A mesh of elastic parts that can be integrated in time; made by `elastic_bar`."""

    mesh: ElasticMesh
    """The mesh."""
    stiffness: csr_array = field(repr=False)
    """Stiffness [N/m], shape [2 n_nodes, 2 n_nodes], degrees of freedom (u_r, u_x) node by node."""
    mass: FloatArray = field(repr=False)
    """Lumped mass [kg], shape [n_nodes]."""
    stable_step: float
    """Two over the bound of the largest angular frequency [s]."""
    depths: tuple[float, ...]
    """Distance of the cross-sections whose force is recorded from the face [m]."""
    sections: csr_array = field(repr=False)
    """Force through them over the displacements [N/m], shape [n_depths, 2 n_nodes]."""
    marks: tuple[int, ...] = ()
    """Nodes of the outer surface whose displacement is recorded."""

    def integrate(
        self, times: FloatArray, force: FloatArray, radius: FloatArray | float, *, safety: float = 0.9
    ) -> ElasticHistory:
        """Integrate from rest under a force that presses evenly on a patch of the face.

        Parameters
        ----------
        times : shape [n]
            Times of the force [s], ascending; it is linear between them, and the first is the start.
        force : shape [n]
            Compressive force [N].
        radius : float or shape [n]
            Radius of the patch [m], linear between the times.
        safety : float
            Share of the stable step that is used, in (0, 1].

        Raises
        ------
        ValueError
            If a time, force or radius is outside its range.
        """
        if not 0.0 < safety <= 1.0:
            raise ValueError(f"safety must be in (0, 1], got {safety}")
        if len(times) < 2 or not (np.diff(times) > 0.0).all():
            raise ValueError("times of the force must ascend, with at least two")
        if len(force) != len(times) or not np.isfinite(force).all():
            raise ValueError(f"the force must be finite at each of {len(times)} times")
        n_steps = int(np.ceil((times[-1] - times[0]) / (safety * self.stable_step)))
        grid = np.linspace(times[0], times[-1], n_steps + 1)
        pressing = np.interp(grid, times, force)
        share = pressed_share(self.mesh, np.interp(grid, times, np.broadcast_to(radius, np.shape(times))))
        return self._march(grid, pressing, share)

    def _march(self, grid: FloatArray, pressing: FloatArray, share: FloatArray) -> ElasticHistory:
        step, n = grid[1] - grid[0], len(grid)
        face = 2 * self.mesh.face + 1
        mass = np.repeat(self.mass, 2)
        inverse = 1.0 / mass
        inverse[2 * np.flatnonzero(self.mesh.nodes[:, 0] == 0.0)] = 0.0  # the axis stays on the axis
        u, v = np.zeros(len(mass)), np.zeros(len(mass))
        section_force = np.zeros((n, len(self.depths)))
        path, external, kinetic, elastic = np.zeros((4, n))
        marks = 2 * np.array(self.marks, dtype=int) + 1
        seen = np.zeros((n, len(marks)))
        for i in range(n):
            resisting = self.stiffness @ u
            elastic[i] = 0.5 * (u * resisting).sum()  # `@` would wake a pool of threads
            section_force[i] = self.sections @ u
            seen[i] = u[marks]
            load = -resisting
            load[face] += pressing[i] * share[i]
            # The velocity lives between the positions: the first interval is half a step from rest.
            change = load * inverse * (step if i else 0.5 * step)
            kinetic[i] = 0.5 * (mass * v * (v + change)).sum()
            before = share[i] @ v[face]
            v += change
            after = share[i] @ v[face]
            # Force times the mean of the velocities beside it: half of a step's work belongs to either end.
            external[i] += pressing[i] * 0.5 * step * before
            if i + 1 < n:
                u += step * v
                path[i + 1] = path[i] + step * (0.5 * (share[i] + share[i + 1]) @ v[face])
                external[i + 1] = external[i] + pressing[i] * 0.5 * step * after
        return ElasticHistory(grid, pressing, section_force, path, seen, external, kinetic, elastic)


def elastic_bar(
    sections: Sequence[Section],
    *,
    size: float,
    depths: Sequence[float] = (),
    marks: Sequence[float] = (),
) -> ElasticBar:
    """Make elastic parts ready to be integrated.

    Parameters
    ----------
    sections : sequence
        The parts, bonded one behind the other, the loaded one first.
    size : float
        Largest side of an element [m].
    depths : sequence of float
        Distance from the loaded face of the cross-sections whose force is wanted [m]; the nearest plane of
        nodes is taken, and mid-sections of parts are such planes.
    marks : sequence of float
        Distance from it of places on the outer surface whose displacement is wanted [m]; the nearest node.

    Raises
    ------
    ValueError
        If a depth is outside the parts or on either end.
    """
    mesh = mesh_of(sections, size=size)
    matrices = element_matrices(mesh)
    planes = [mesh.plane(depth) for depth in depths]
    middle = mesh.nodes[mesh.quads, 1].mean(axis=1)
    rows = []
    for depth, plane in zip(depths, planes, strict=True):
        here = mesh.nodes[plane[0], 1]
        near, far = middle < here, middle > here
        if not (near.any() and far.any()):
            raise ValueError(f"a cross-section must lie inside the parts, got depth {depth} m")
        # Mean of what the near side pushes and the far side resists: the inertia of the plane cancels.
        weight = np.zeros(2 * mesh.n_nodes)
        weight[2 * plane + 1] = 0.5
        signed = np.where(far, 1.0, -1.0)[:, None, None] * matrices.stiffness
        rows.append(assemble(mesh, signed).T @ weight)
    return ElasticBar(
        mesh=mesh,
        stiffness=assemble(mesh, matrices.stiffness),
        mass=nodal_mass(mesh, matrices.mass),
        stable_step=2.0 / largest_frequency(matrices),
        depths=tuple(float(mesh.nodes[plane[0], 1]) for plane in planes),
        sections=csr_array(np.reshape(rows, (len(rows), 2 * mesh.n_nodes))),
        marks=tuple(int(mesh.plane(depth)[-1]) for depth in marks),
    )
