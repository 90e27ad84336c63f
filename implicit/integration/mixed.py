r"""The mixed formulation: volume ratio and pressure as fields of their own, eliminated in each element.

With monomials phi_m of degree n in the element's coordinates (1, or 1 and the coordinates), the functional
int W(F) + U(theta) + p (J - theta) dV is stationary where theta is the projection of J and p that of
U'(theta) (Simo, Taylor and Pister 1985):

    theta = phi . M^-1 int phi J dV,   p = phi . M^-1 int phi U'(theta) dV,   M = int phi phi dV.     (M.1)

Its stiffness beside that of P and p d2J/dF2 is C^T M^-1 (int U'' phi phi dV) M^-1 C with
C = int phi dJ/dF : grad N dV. With one constant phi this is the mean dilatation of the 8-node hexahedron; the
27-node one with four is Q2/P1, the 9-node quadrilateral with three likewise, both inf-sup stable.
"""

import numpy as np

from explicit.arrays import FloatArray
from implicit.elements.reference import complete
from implicit.integration.contraction import element_forces
from implicit.integration.points import Points, PointState
from implicit.laws.volumetric import Volumetric


class MixedField:
    """Volume ratio and pressure of all elements."""

    def __init__(self, points: Points, parameters: FloatArray) -> None:
        model = points.model
        form = model.solid.volumetric
        degree = model.mesh.element.pressure_degree
        assert form is not None  # the model was checked
        assert degree is not None
        self.geometry, self.regions = points.geometry, model.cell_regions
        exponents = complete(degree, model.mesh.element.dimension)
        self.phi = (self.geometry.points[:, None, :] ** exponents[None]).prod(axis=-1)  # [g, n]
        weighted = self.geometry.volumes[..., None] * self.phi  # [m, g, n]
        self.weighted = weighted
        self.inverse = np.linalg.inv(np.matmul(np.swapaxes(weighted, 1, 2), self.phi))
        count = len(form.values)
        self.n_law = parameters.shape[1] - count
        self.forms: list[Volumetric] = [form.of(row[-count:]) for row in parameters]

    def _projected(self, values: FloatArray) -> FloatArray:
        """Projection of point values [m, g] onto phi, at the points."""
        integral = np.matmul(np.swapaxes(self.weighted, 1, 2), values[..., None])
        return np.matmul(np.matmul(self.inverse, integral)[..., 0], self.phi.T)

    def _by_region(self, name: str, theta: FloatArray) -> FloatArray:
        found = np.empty_like(theta)
        for r, form in enumerate(self.forms):
            inside = self.regions == r
            found[inside] = getattr(form, name)(theta[inside])
        return found

    def pressures(self, J: FloatArray) -> tuple[FloatArray, FloatArray]:
        """p and U''(theta) at the points [Pa], each of shape [m, g]."""
        theta = self._projected(J)
        return self._projected(self._by_region("slope", theta)), self._by_region("curvature", theta)

    def energy(self, J: FloatArray) -> float:
        """int U(theta) dV [J]."""
        theta = self._projected(J)
        return float((self._by_region("energy", theta) * self.geometry.volumes).sum())

    def stiffness(self, H: FloatArray, curvature: FloatArray) -> FloatArray:
        """The part of the element stiffness that the volume ratio adds [N/m], shape [m, k d, k d]."""
        T, m = self.geometry.T, len(H)
        C = np.stack(
            [
                element_forces(T, H * self.weighted[..., n, None]).reshape(m, -1)
                for n in range(self.phi.shape[1])
            ],
            axis=1,
        )
        middle = np.matmul(np.swapaxes(self.weighted * curvature[..., None], 1, 2), self.phi)
        solved = np.matmul(self.inverse, C)
        return np.asarray(np.matmul(np.swapaxes(solved, 1, 2), np.matmul(middle, solved)))

    def stress_by_parameters(self, points: PointState) -> FloatArray:
        """dP/d(constants) through the pressure, shape [m, g, d D, n_parameters]; 0 for those of the law."""
        theta = self._projected(points.J)
        count = len(self.forms[0].values)
        slopes = np.zeros((*theta.shape, self.n_law + count))
        for r, form in enumerate(self.forms):
            inside = self.regions == r
            for j, by in enumerate(form.slope_by_constants(theta[inside])):
                slopes[inside, :, self.n_law + j] = by
        p = np.stack([self._projected(slopes[..., j]) for j in range(slopes.shape[-1])], axis=-1)
        return np.asarray(points.H[..., None] * p[:, :, None, :])
