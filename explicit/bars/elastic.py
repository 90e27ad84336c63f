"""Elastic platens, transducers and bars as an axisymmetric mesh, and as a linear system by their pulse
response.

The parts are linear elastic: the strain of steel under a soft specimen is 1e-6. They are loaded on one face;
all other faces are free. One step (central differences) is one product with a sparse matrix.

Their response is linear in the force on their face and does not change with time. The force of a simulation
is linear between the steps and thus a sum of triangular pulses over two steps. One run under such a pulse of
one newton therefore gives all responses. A batch needs a convolution instead of a time integration.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.sparse import csr_array

from explicit.arrays import FloatArray, IntArray
from explicit.bars.lines import Section, loaded_line
from explicit.mesh import CORNERS, bilinear


@dataclass(frozen=True)
class ElasticMesh:
    """Rectangles in the half-plane (r, x); x is the distance from the loaded face, into the parts."""

    sections: tuple[Section, ...]
    """The parts, the loaded one first."""
    nodes: FloatArray
    """Positions (r, x) [m], shape [n_nodes, 2]."""
    quads: IntArray
    """Corner nodes of each element, counter-clockwise, shape [n_elements, 4]."""
    part: IntArray
    """Index of each element's section, shape [n_elements]."""

    @property
    def n_nodes(self) -> int:
        """Number of nodes."""
        return len(self.nodes)

    @property
    def face(self) -> IntArray:
        """Nodes of the loaded face, axis first."""
        return self.plane(0.0)

    def plane(self, depth: float) -> IntArray:
        """Nodes of the cross-section nearest to a distance from the loaded face [m], axis first."""
        depths = np.unique(self.nodes[:, 1])
        if not depths[0] <= depth <= depths[-1]:
            raise ValueError(f"depth must be in [0, {depths[-1]:.6g}] m, got {depth}")
        nearest = depths[np.argmin(np.abs(depths - depth))]
        selected = np.flatnonzero(self.nodes[:, 1] == nearest)
        return selected[np.argsort(self.nodes[selected, 0])]


def mesh_of(sections: Sequence[Section], *, size: float) -> ElasticMesh:
    """Mesh sections with rectangles.

    Every radius of a section is a line of the mesh, so a step of the radius is sharp. Neighbours are bonded
    over the smaller of their faces.

    ``sections``: the parts, the loaded one first. ``size``: largest side of an element [m]. A section has an
    even number of elements along its axis, at least two. Its mid-section is then a plane of nodes. Raises
    ValueError if there is no section or `size` is not positive.
    """
    if not sections:
        raise ValueError("a mesh needs at least one section, got none")
    if not size > 0.0:
        raise ValueError(f"size must be > 0 m, got {size}")
    radial = _lines(np.unique([0.0, *(section.radius for section in sections)]), size)
    ends = np.concatenate([[0.0], np.cumsum([section.length for section in sections])])
    axial, layers = [np.zeros(1)], []
    for k, section in enumerate(sections):
        n = 2 * max(1, int(np.ceil(0.5 * section.length / size * (1.0 - 1e-9))))
        axial.append(np.linspace(ends[k], ends[k + 1], n + 1)[1:])
        layers += [k] * n
    x, part = np.concatenate(axial), np.array(layers)
    index = np.arange(len(x) * len(radial)).reshape(len(x), len(radial))
    # (r, x) with x along the parts: counter-clockwise is out, along, in.
    quads = np.stack([index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]], axis=-1)
    outer = np.array([section.radius for section in sections])[part]
    solid = radial[None, 1:] <= outer[:, None] * (1.0 + 1e-12)
    quads, of_element = quads[solid], np.broadcast_to(part[:, None], solid.shape)[solid]
    used, renumbered = np.unique(quads, return_inverse=True)
    places = np.stack(np.broadcast_arrays(radial[None, :], x[:, None]), axis=-1).reshape(-1, 2)
    return ElasticMesh(tuple(sections), places[used], renumbered.reshape(-1, 4), of_element.copy())


def _lines(fixed: FloatArray, size: float) -> FloatArray:
    """Grid lines through fixed positions. Between these they are equally spaced, at most `size` apart."""
    spans = [
        np.linspace(a, b, max(1, int(np.ceil((b - a) / size * (1.0 - 1e-9)))) + 1)[1:]
        for a, b in pairwise(fixed)
    ]
    return np.concatenate([[0.0], *spans])


def pressed_share(mesh: ElasticMesh, radius: FloatArray) -> FloatArray:
    """Share of each node of the face in a force that presses evenly within a radius.

    The consistent loads (2 / a^2) * integral of N_i r dr from 0 to a, integrated exactly.
    """
    lines = mesh.nodes[mesh.face, 0]
    a = np.asarray(radius, dtype=float)
    wrong = ~((a > 0.0) & (a <= lines[-1] * (1.0 + 1e-12)))
    if wrong.any():
        raise ValueError(f"pressed radius must be in (0, {lines[-1]:.6g}] m, got {a[wrong][0]:.6g}")
    share = np.zeros((len(a), len(lines)))
    for i, (inner, outer) in enumerate(pairwise(lines)):
        end = np.clip(a, inner, outer)
        square, cube = 0.5 * (end**2 - inner**2), (end**3 - inner**3) / 3.0
        share[:, i] += (outer * square - cube) / (outer - inner)
        share[:, i + 1] += (cube - inner * square) / (outer - inner)
    return 2.0 * share / a[:, None] ** 2


@dataclass(frozen=True)
class ElementMatrices:
    """Matrices of every element over a full turn; degrees of freedom (u_r, u_x) corner by corner."""

    stiffness: FloatArray
    """Stiffness [N/m], shape [n_elements, 8, 8]."""
    mass: FloatArray
    """Row-sum share of the mass at each corner [kg], shape [n_elements, 4]."""


def _element_matrices(mesh: ElasticMesh) -> ElementMatrices:
    """Stiffness and mass by 2 x 2 Gauss points, none on the axis (Hughes 2000, 2.9 and 3.11); the mass is
    exact, because N r det j is of degree 2 in each local coordinate."""
    corners = mesh.nodes[mesh.quads]
    n = len(corners)
    stiffness, mass = np.zeros((n, 8, 8)), np.zeros((n, 4))
    law = np.array([_elasticity(s.youngs_modulus, s.poisson) for s in mesh.sections])[mesh.part]
    density = np.array([section.density for section in mesh.sections])[mesh.part]
    for xi, eta in CORNERS / np.sqrt(3.0):
        shape, local = bilinear(xi, eta)
        jacobian = np.einsum("ai,eaj->eij", local, corners)
        slope = np.einsum("eij,aj->eai", np.linalg.inv(jacobian), local)
        radius = corners[:, :, 0] @ shape
        dv = 2.0 * np.pi * radius * np.linalg.det(jacobian)
        strain = np.zeros((n, 4, 8))  # rr, xx, hoop, twice rx
        strain[:, 0, 0::2] = strain[:, 3, 1::2] = slope[:, :, 0]
        strain[:, 1, 1::2] = strain[:, 3, 0::2] = slope[:, :, 1]
        strain[:, 2, 0::2] = shape / radius[:, None]
        stiffness += np.einsum("eki,ekl,elj,e->eij", strain, law, strain, dv, optimize=True)
        mass += shape * (density * dv)[:, None]
    return ElementMatrices(stiffness, mass)


def _elasticity(young: float, poisson: float) -> FloatArray:
    """Hooke's law for (rr, xx, hoop, twice rx) [Pa], shape [4, 4]."""
    mu = young / (2.0 * (1.0 + poisson))
    lam = young * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson))
    law = np.diag([2.0 * mu, 2.0 * mu, 2.0 * mu, mu])
    law[:3, :3] += lam
    return law


def assemble(mesh: ElasticMesh, stiffness: FloatArray) -> csr_array:
    """Assembled stiffness [N/m], degrees of freedom (u_r, u_x) node by node, shape [2 n, 2 n]."""
    dofs = np.stack([2 * mesh.quads, 2 * mesh.quads + 1], axis=-1).reshape(-1, 8)
    rows, columns = np.repeat(dofs, 8, axis=1), np.tile(dofs, (1, 8))
    shape = (2 * mesh.n_nodes, 2 * mesh.n_nodes)
    return csr_array((stiffness.ravel(), (rows.ravel(), columns.ravel())), shape=shape)


def nodal_mass(mesh: ElasticMesh, corner_mass: FloatArray) -> FloatArray:
    """Lumped mass of each node [kg], shape [n_nodes]."""
    mass = np.zeros(mesh.n_nodes)
    np.add.at(mass, mesh.quads, corner_mass)
    return mass


def largest_frequency(matrices: ElementMatrices) -> float:
    """Bound of the mesh's largest angular frequency [rad/s]: the largest one of any single element."""
    inverse_root = np.repeat(matrices.mass, 2, axis=1) ** -0.5
    scaled = inverse_root[:, :, None] * matrices.stiffness * inverse_root[:, None, :]
    return float(np.sqrt(np.linalg.eigvalsh(scaled)[:, -1].max()))


@dataclass(frozen=True)
class ElasticHistory:
    """Response of the parts, at each of their time steps."""

    times: FloatArray
    """Times [s], shape [n_times]."""
    force: FloatArray
    """Compressive force on the face [N], shape [n_times]."""
    section_force: FloatArray
    """Compressive force through each cross-section [N], shape [n_times, n_depths]."""
    path: FloatArray
    """Mean displacement of the loaded patch, into the parts [m], shape [n_times]. Its product with the force
    gives the work."""
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
    """A mesh of elastic parts that can be integrated in time. `elastic_bar` makes it."""

    mesh: ElasticMesh
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

        ``times``: times of the force [s], ascending. The force is linear between them; the first one is the
        start. ``force``: compressive force [N]. ``radius``: radius of the patch [m], linear between the
        times. ``safety``: share of the stable step that is used, in (0, 1]. Raises ValueError if a time,
        force or radius is outside its range.
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
        inverse[2 * np.flatnonzero(self.mesh.nodes[:, 0] == 0.0)] = 0.0  # nodes on the axis stay on the axis
        u, v = np.zeros(len(mass)), np.zeros(len(mass))
        section_force = np.zeros((n, len(self.depths)))
        path, external, kinetic, elastic = np.zeros((4, n))
        marks = 2 * np.array(self.marks, dtype=int) + 1
        displacement = np.zeros((n, len(marks)))
        for i in range(n):
            resisting = self.stiffness @ u
            elastic[i] = 0.5 * (u * resisting).sum()  # `@` would start a pool of threads
            section_force[i] = self.sections @ u
            displacement[i] = u[marks]
            load = -resisting
            load[face] += pressing[i] * share[i]
            # The velocity is defined between the positions, so the first interval is half a step.
            change = load * inverse * (step if i else 0.5 * step)
            kinetic[i] = 0.5 * (mass * v * (v + change)).sum()
            before = share[i] @ v[face]
            v += change
            after = share[i] @ v[face]
            # Force times the mean of the velocities before and after it: each end has half of a step's work.
            external[i] += pressing[i] * 0.5 * step * before
            if i + 1 < n:
                u += step * v
                path[i + 1] = path[i] + step * (0.5 * (share[i] + share[i + 1]) @ v[face])
                external[i + 1] = external[i] + pressing[i] * 0.5 * step * after
        return ElasticHistory(grid, pressing, section_force, path, displacement, external, kinetic, elastic)


def elastic_bar(
    sections: Sequence[Section], *, size: float, depths: Sequence[float] = (), marks: Sequence[float] = ()
) -> ElasticBar:
    """Prepare elastic parts for the time integration.

    Parameters
    ----------
    sections : sequence
        The parts, bonded in series, the loaded one first.
    size : float
        Largest side of an element [m].
    depths : sequence of float
        Distance from the loaded face of the cross-sections whose force is recorded [m]. The nearest plane of
        nodes is used; mid-sections of parts are such planes.
    marks : sequence of float
        Distance from the loaded face of points on the outer surface whose displacement is recorded [m]. The
        nearest node is used.

    Raises
    ------
    ValueError
        If a depth is outside the parts or on either end.
    """
    mesh = mesh_of(sections, size=size)
    matrices = _element_matrices(mesh)
    planes = [mesh.plane(depth) for depth in depths]
    middle = mesh.nodes[mesh.quads, 1].mean(axis=1)
    rows = []
    for depth, plane in zip(depths, planes, strict=True):
        height = mesh.nodes[plane[0], 1]
        near, far = middle < height, middle > height
        if not (near.any() and far.any()):
            raise ValueError(f"a cross-section must lie inside the parts, got depth {depth} m")
        # Mean of the forces on both sides of the plane: its inertia cancels.
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


FINEST = 1e-7
"""Longest time step of the one-dimensional waves under a pulse [s]. The step is chosen between this and a
quarter of it, for the smallest rounding of the travel times."""


@dataclass(frozen=True)
class PulseResponse:
    """Response of elastic parts at rest to a pulse of 1 N on their face.

    The pulse increases from 0 at time 0 to 1 N after one step and decreases to 0 after two steps.
    """

    step: float
    """Distance of the times; the first is 0 [s]."""
    path: FloatArray
    """Displacement of the face, into the parts [m/N], shape [n]."""
    seen: FloatArray
    """Displacement of the point observed by a camera [m/N], shape [n]."""
    section: FloatArray
    """Compressive force through the section of the transducer [1], shape [n]."""

    def histories(self, impulse: FloatArray, kind: str) -> FloatArray:
        """Histories under forces that act from rest, shape of `impulse`.

        ``impulse``: impulse of the force on the face at the steps [N s], shape [n_samples, n]. It is 0 at the
        first step. After a NaN the force is zero. ``kind``: "path", "seen" or "section". Raises ValueError if
        there are more steps than the response has.
        """
        n = impulse.shape[1]
        table = getattr(self, kind)
        if n > len(table):
            raise ValueError(f"{n} steps are requested, the pulse's response has {len(table)}")
        from scipy.signal import fftconvolve  # needed with bars only

        return np.asarray(fftconvolve(mean_about(impulse, self.step), table[None, :], axes=1)[:, 1 : n + 1])


def mean_about(impulse: FloatArray, step: float) -> FloatArray:
    """Mean force over an interval of one step about every step [N], shape of `impulse`. It is 0 at the first
    step.

    The sum of the pulses has the impulse of the force.
    """
    finite = np.isfinite(impulse)
    last = impulse.shape[1] - 1 - np.argmax(finite[:, ::-1], axis=1)
    whole = np.where(finite, impulse, np.take_along_axis(impulse, last[:, None], axis=1))
    halves = 0.5 * (whole[:, 1:] + whole[:, :-1])
    ends = np.concatenate([whole[:, :1], halves, whole[:, -1:]], axis=1)
    force = np.diff(ends, axis=1) / step
    force[:, 1] += force[:, 0]  # the first half step's impulse
    force[:, 0] = 0.0
    force[:, -1] *= 2.0  # the last half step's mean
    return np.asarray(force)


def pulse_on_bars(
    sections: Sequence[Section], *, step: float, n: int, sensor: float = 0.0, observed: float = 0.0
) -> PulseResponse:
    """The response of one-dimensional bars, free at their far end.

    ``sections``: bars bonded in series, the loaded one first. ``step``: distance of the times [s]. ``n``:
    number of times. ``sensor``, ``seen``: distance from the loaded face of the transducer's section and of
    the observed point [m]. Raises ValueError if a distance is outside the bars, or a section is shorter than
    half the travel of a wave in a time step.
    """
    least = max(2, int(np.ceil(step / FINEST)))
    travel = np.array([section.travel_time for section in sections])
    counts = np.arange(least, 4 * least + 1)
    delays = travel * counts[:, None] / step
    parts = int(counts[np.argmin(np.abs(np.round(delays) / delays - 1.0).max(axis=1))])
    fine = step / parts
    force = np.interp(fine * np.arange(parts * n + 1), step * np.arange(3), [0.0, 1.0, 0.0])
    line = loaded_line(sections, force, step=fine)

    def path(depth: float) -> FloatArray:
        velocity = line.velocity(depth)
        summed = np.cumsum(0.5 * fine * (velocity[1:] + velocity[:-1]))
        return np.concatenate([[0.0], summed])[::parts][:n]

    return PulseResponse(step, path(0.0), path(observed), line.force(sensor)[::parts][:n])


def pulse_on_mesh(
    sections: Sequence[Section],
    *,
    step: float,
    n: int,
    size: float,
    radius: float,
    sensor: float = 0.0,
    observed: float = 0.0,
) -> PulseResponse:
    """The response of elastic parts as an axisymmetric mesh.

    ``sections``, ``step``, ``n``, ``sensor``: as in `pulse_on_bars`; `observed` is on the outer surface. A
    sensor at 0 is the face. ``size``: largest side of an element [m]. ``radius``: radius of the uniformly
    loaded part of the face [m]. Raises ValueError if a distance is outside the parts or on their far end, or
    a size is not positive.
    """
    depths = [] if sensor == 0.0 else [sensor]
    parts = elastic_bar(sections, size=size, depths=depths, marks=[observed])
    end = step * max(n, 3)
    # A step of the pulse is a whole number of time steps: its impulse is then exact.
    safety = step / np.ceil(step / (0.9 * parts.stable_step)) / parts.stable_step * (1.0 + 1e-9)
    pulse = np.array([0.0, 1.0, 0.0, 0.0])
    history = parts.integrate(np.array([0.0, step, 2.0 * step, end]), pulse, radius, safety=safety)
    times = step * np.arange(n)

    def at(values: FloatArray) -> FloatArray:
        return np.interp(times, history.times, values)

    section = history.section_force[:, 0] if depths else history.force
    return PulseResponse(step, at(history.path), at(history.seen[:, 0]), at(section))
