"""Stress and tangent at all Gauss points of a model, and their sums over each element.

Gradients and volumes of the points belong to the undeformed mesh. The sums are matrix products (BLAS).
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import warp as wp

from explicit.arrays import FloatArray
from explicit.device import select_device
from kolsky.equilibrium.meshes import Mesh
from kolsky.equilibrium.model import Model
from kolsky.equilibrium.point_kernels import KINEMATICS, point_kernel, stress_kernel, volume_kernel


@dataclass(frozen=True)
class Geometry:
    """Data of the undeformed mesh for the integrals over elements."""

    E: FloatArray
    """dN/dX [1/m], shape [m, g, k, D]. In an axisymmetric model, N / R is the third column."""
    volumes: FloatArray
    """Volume of each Gauss point [m3], shape [m, g]."""
    values: FloatArray
    """Shape functions at the Gauss points [-], shape [g, k]."""
    points: FloatArray
    """The Gauss points in the element's coordinates [-], shape [g, d]."""

    @cached_property
    def T(self) -> FloatArray:
        """The gradients with the points of the element last [1/m], shape [m, g, D, k]."""
        return np.ascontiguousarray(np.swapaxes(self.E, 2, 3))


def geometry(mesh: Mesh, *, kinematics: str, thickness: float, gauss: int | None) -> Geometry:
    """Evaluate the gradients.

    Raises ValueError if an element is inverted, or a Gauss point is on the axis of revolution.
    """
    element = mesh.element
    points, weights = element.rule(element.gauss if gauss is None else gauss)
    local, values = element.gradients(points), element.values(points)
    corners = mesh.points[mesh.cells]
    jacobian = np.einsum("mki,gkj->mgij", corners, local, optimize=True)
    determinant = np.linalg.det(jacobian)
    if (determinant <= 0.0).any():
        worst = int(np.argmin(determinant.min(axis=1)))
        number = worst if mesh.numbers is None else mesh.numbers[worst]
        middle = ", ".join(f"{1e3 * x:.4g}" for x in corners[worst].mean(axis=0))
        raise ValueError(
            f"cell {number} of {mesh.kind}, around ({middle}) mm, is inside out or flat "
            f"(det = {determinant[worst].min():.3g} m^d); check the order of its points"
        )
    E = np.matmul(local[None], np.linalg.inv(jacobian))
    volumes = determinant * weights
    if kinematics == "axisymmetric":
        radius = np.einsum("gk,mk->mg", values, corners[..., 0])
        if (radius <= 0.0).any():
            raise ValueError("a Gauss point lies on the axis of revolution")
        E = np.concatenate([E, (values[None] / radius[..., None])[..., None]], axis=-1)
        volumes = volumes * (2.0 * np.pi * radius)
    elif mesh.dimension == 2:
        volumes = volumes * thickness
    return Geometry(np.ascontiguousarray(E), np.ascontiguousarray(volumes), values, points)


CHUNK = 60_000
"""Number of values in an intermediate array. The array must fit into the cache of a core."""


def element_forces(T: FloatArray, weighted: FloatArray) -> FloatArray:
    """Sum over the points of E and P dV: forces of each element [N], shape [m, k, d].

    ``T``: gradients [1/m] as `kolsky.equilibrium.points.Geometry.T`, shape [m, g, D, k]. ``weighted``: P
    times the point's volume [N m], shape [m, g, d D].
    """
    m, g, columns, k = T.shape
    values = np.swapaxes(weighted.reshape(m, g, -1, columns), 2, 3)  # [m, g, D, d]
    of_points = np.ascontiguousarray(values).reshape(m, g * columns, -1)
    return np.matmul(np.swapaxes(T.reshape(m, g * columns, k), 1, 2), of_points)


def element_stiffness(T: FloatArray, weighted: FloatArray) -> FloatArray:
    """Sum over the points of E A dV E: stiffness of each element [N/m], shape [m, k d, k d]. `weighted` is A
    dV, shape [m, g, d D, d D]. A is symmetric: blocks (i, j) with i > j are transposes. The result has the
    precision of T, shape [m, g, D, k]."""
    m, g, columns, k = T.shape
    d = weighted.shape[-1] // columns
    K = np.empty((m, k, d, k, d), dtype=T.dtype)
    size = max(1, CHUNK // (g * k * columns))
    for start in range(0, m, size):
        part = slice(start, start + size)
        of_points = T[part]
        n = len(of_points)
        left = np.swapaxes(of_points.reshape(n, g * columns, k), 1, 2)
        A = weighted[part].astype(T.dtype, copy=False).reshape(n, g, d * columns, d, columns)
        for j in range(d):
            right = np.matmul(A[:, :, : (j + 1) * columns, j], of_points)  # [., g, (i, J), k]
            for i in range(j + 1):
                of_pair = np.ascontiguousarray(right[:, :, i * columns : (i + 1) * columns])
                block = np.matmul(left, of_pair.reshape(n, g * columns, k))
                K[part, :, i, :, j] = block
                if i != j:
                    K[part, :, j, :, i] = np.swapaxes(block, 1, 2)
    return K.reshape(m, k * d, k * d)


@dataclass(frozen=True)
class PointState:
    """State of the Gauss points."""

    P: FloatArray
    """First Piola-Kirchhoff stress with the pairs (i, J) in rows [Pa], shape [m, g, d D]."""
    forces: FloatArray
    """Forces of each element [N], shape [m, k d]; [0, 0] if not requested."""
    stiffness: FloatArray | None
    """Its stiffness at fixed pressures [N/m], shape [m, k d, k d]; None if not requested."""
    H: FloatArray
    """Mixed: dJ/dF [-]. Plane stress: A_iJ33 / A_3333 [-]. Shape [m, g, d D], otherwise [0, 0, 0]."""
    J: FloatArray
    """Volume ratio [-], shape [m, g]."""
    energy: FloatArray
    """Strain energy density without the volumetric part of a mixed model [Pa], shape [m, g]."""
    thickness: FloatArray
    """Thickness stretch in plane stress [-], otherwise 1, shape [m, g]."""


class Points:
    """The Gauss points of a model: arrays on its device, kernels, and their evaluation."""

    def __init__(self, model: Model) -> None:
        self.model = model
        self.geometry: Geometry = geometry(
            model.mesh, kinematics=model.kinematics, thickness=model.thickness, gauss=model.gauss
        )
        self.d, self.columns = KINEMATICS[model.kinematics]
        self.device: Any = select_device(model.device)
        self.E: Any = wp.array(self.geometry.E, dtype=wp.float64, device=self.device)
        self.cells: Any = wp.array(model.mesh.cells.astype(np.int32), dtype=wp.int32, device=self.device)
        self.mixed = model.volumetric == "mixed"
        self.functions = model.solid.isochoric_functions() if self.mixed else model.solid.functions()

    @property
    def shape(self) -> tuple[int, int]:
        """Cells and Gauss points in each."""
        return self.geometry.volumes.shape  # type: ignore[return-value]

    @cached_property
    def _volumes(self) -> Any:
        return self._put(self.geometry.volumes)

    @cached_property
    def _none(self) -> tuple[Any, ...]:
        return tuple(self._zeros((0,) * n) for n in (2, 3))

    def _zeros(self, shape: tuple[int, ...]) -> Any:
        return wp.zeros(shape, dtype=wp.float64, device=self.device)

    def _put(self, values: FloatArray) -> Any:
        return wp.array(np.ascontiguousarray(values), dtype=wp.float64, device=self.device)

    def rows(self, parameters: FloatArray) -> FloatArray:
        """The kernels' row of each cell, shape [m, n_row]. The constants have shape [n_regions, n]."""
        of_region = np.array([self.model.solid.with_parameters(p).row() for p in parameters])
        return of_region[self.model.cell_regions]

    def volume_ratios(self, u: FloatArray) -> FloatArray:
        """J of displacements [m] of shape [n, d], shape [m, g]."""
        J = self._zeros(self.shape)
        kernel = volume_kernel(self.model.kinematics)
        wp.launch(
            kernel, self.shape, inputs=[self._put(u), self.cells, self.E], outputs=[J], device=self.device
        )
        return np.asarray(J.numpy())

    def evaluate(
        self,
        u: FloatArray,
        rows: FloatArray,
        *,
        tangent: bool,
        forces: bool = True,
        single: bool = False,
        pressure: FloatArray | None = None,
        thickness: FloatArray | None = None,
    ) -> PointState:
        """Evaluate the stress and, on request, the tangent, with the elements' forces and stiffness.

        ``u``: displacements [m]. ``rows``: the result of `rows`. ``tangent``, ``forces``: True to compute
        stiffness and forces. ``single``: True to sum the stiffness in single precision. ``pressure``:
        pressure of a mixed model [Pa]. ``thickness``: initial thickness stretch in plane stress [-].
        """
        (m, g), n = self.shape, self.d * self.columns
        kernel = point_kernel(self.functions, self.model.kinematics, mixed=self.mixed, single=single)
        two, three = self._none
        stretch = self._put(np.ones((m, g)) if thickness is None else thickness)
        P, J, W = self._zeros((m, g, n)), self._zeros((m, g)), self._zeros((m, g))
        kind = wp.float32 if single else wp.float64
        A: Any = wp.empty((m, g, n, n) if tangent else (0,) * 4, dtype=kind, device=self.device)
        H = self._zeros((m, g, n)) if self.mixed or self.model.kinematics == "plane_stress" else three
        p = self._put(pressure) if pressure is not None else two
        given = [self._put(u), self.cells, self.E]
        wp.launch(
            kernel,
            (m, g),
            inputs=[*given, self._put(rows), p, self._volumes, stretch, int(tangent)],
            outputs=[P, A, H, J, W],
            device=self.device,
        )
        T, summed, stiffness = self.geometry.T, np.zeros((0, 0)), None
        if forces:
            summed = element_forces(T, P.numpy() * self.geometry.volumes[..., None]).reshape(m, -1)
        if tangent:
            stiffness = element_stiffness(self._single if single else T, A.numpy())
        return PointState(P.numpy(), summed, stiffness, H.numpy(), J.numpy(), W.numpy(), stretch.numpy())

    @cached_property
    def _single(self) -> FloatArray:
        return self.geometry.T.astype(np.float32)

    def stress_by_row(self, u: FloatArray, rows: FloatArray, thickness: FloatArray) -> FloatArray:
        """Derivatives of the full 3 x 3 P by the kernels' row at fixed deformation, shape [m, g, 9, n_row].
        They are computed by reverse-mode differentiation of the law's function."""
        (m, g), n_row = self.shape, rows.shape[1]
        deformations, stresses = stress_kernel(self.functions[1], self.model.kinematics)
        F = wp.zeros((m, g), dtype=wp.mat33d, device=self.device)
        wp.launch(
            deformations,
            (m, g),
            inputs=[self._put(u), self.cells, self.E, self._put(thickness)],
            outputs=[F],
            device=self.device,
        )
        F = F.flatten()
        each: Any = wp.array(
            np.repeat(rows, g, axis=0), dtype=wp.float64, device=self.device, requires_grad=True
        )
        P = wp.zeros((m * g, 9), dtype=wp.float64, device=self.device, requires_grad=True)
        found = np.empty((m, g, 9, n_row))
        for component in range(9):
            seed = np.zeros((m * g, 9))
            seed[:, component] = 1.0
            each.grad.zero_()
            wp.launch(
                stresses, m * g, inputs=[F, each], outputs=[P], adj_inputs=[None, each.grad],
                adj_outputs=[self._put(seed)], adjoint=True, device=self.device,
            )  # fmt: skip
            found[:, :, component] = each.grad.numpy().reshape(m, g, n_row)
        return found
