r"""A pressure that stays normal to the deformed surface.

With the tangents t_1, t_2 of the deformed face along its coordinates, n da = t_1 x t_2 ds and

    f_a = -p int N_a (t_1 x t_2) ds,                                                           (P.1)

whose derivative by the displacements is not symmetric. In two dimensions n da is the tangent turned by -90
degrees times the thickness, or times 2 pi r of the deformed radius.
"""

import numpy as np

from explicit.arrays import FloatArray, IntArray
from implicit.loads.surface import Faces, faces_on
from implicit.model import Model

_SKEW = np.zeros((3, 3, 3))
for _i, _j, _k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
    _SKEW[_i, _j, _k], _SKEW[_i, _k, _j] = 1.0, -1.0
_TURN = np.array([[0.0, 1.0], [-1.0, 0.0]])


class FollowerPressure:
    """Forces of a unit pressure on the faces of a set, and their derivative."""

    def __init__(self, model: Model, where: str) -> None:
        self.model = model
        self.faces = faces_on(model.mesh, where, model.gauss)

    def evaluate(self, u: FloatArray) -> tuple[FloatArray, list[tuple[IntArray, FloatArray]]]:
        """Forces per unit of pressure [m2], shape [n d], and of each group of faces its cells and the
        derivative of the cells' forces by their displacements [m], shape [f, k d, k d]."""
        mesh, d = self.model.mesh, self.model.dimension
        x = mesh.points + u.reshape(-1, d)
        total = np.zeros(mesh.points.shape)
        derivatives = []
        for faces in self.faces:
            nodes = mesh.cells[faces.cells]
            force, by = self._of_faces(faces, x[nodes])
            np.add.at(total, nodes, force)
            k = nodes.shape[1]
            derivatives.append((faces.cells, by.reshape(len(nodes), k * d, k * d)))
        return total.reshape(-1), derivatives

    def _of_faces(self, faces: Faces, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Forces [f, k, d] and derivatives [f, k, d, k, d] for a unit pressure."""
        N, w = faces.values, faces.weights
        tangents = np.einsum("gkt,fkd->fgtd", faces.slopes, x)
        if x.shape[2] == 3:
            normal = np.cross(tangents[:, :, 0], tangents[:, :, 1])
            # d(t1 x t2) = [t1 x] dt2 - [t2 x] dt1 with (a x b)_i = e_ijk a_j b_k
            first = np.einsum("ijk,fgj->fgik", _SKEW, tangents[:, :, 0])
            second = np.einsum("ijk,fgj->fgik", _SKEW, tangents[:, :, 1])
            by = np.einsum("fgij,gb->fgibj", first, faces.slopes[:, :, 1])
            by -= np.einsum("fgij,gb->fgibj", second, faces.slopes[:, :, 0])
        else:
            normal = tangents[:, :, 0] @ _TURN.T
            by = np.einsum("ij,gb->gibj", _TURN, faces.slopes[:, :, 0])[None].repeat(len(x), axis=0)
            if self.model.kinematics == "axisymmetric":
                radius = np.einsum("gk,fk->fg", N, x[..., 0])
                by = by * radius[:, :, None, None, None]
                by[..., 0] += np.einsum("fgi,gb->fgib", normal, N)
                normal = normal * radius[..., None]
                scale = 2.0 * np.pi
            else:
                scale = self.model.thickness
            normal, by = scale * normal, scale * by
        force = -np.einsum("g,ga,fgi->fai", w, N, normal)
        return force, -np.einsum("g,ga,fgibj->faibj", w, N, by)
