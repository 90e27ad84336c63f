"""Stiffness, lumped mass and stable step of the linear elastic axisymmetric quadrilateral."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

from explicit.arrays import FloatArray
from explicit.bars.mesh import ElasticMesh

_CORNERS = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


@dataclass(frozen=True)
class ElementMatrices:
    """Matrices of every element over a full turn; degrees of freedom (u_r, u_x) corner by corner."""

    stiffness: FloatArray
    """Stiffness [N/m], shape [n_elements, 8, 8]."""
    mass: FloatArray
    """Row-sum share of the mass at each corner [kg], shape [n_elements, 4]."""


def element_matrices(mesh: ElasticMesh) -> ElementMatrices:
    """Integrate stiffness with 2 x 2 and mass with the same Gauss points (Hughes 2000, 2.9 and 3.11).

    The mass is exact: N r det j is of degree 2 in each local coordinate. The hoop term N^2 / r is not a
    polynomial; no point lies on the axis.
    """
    corners = mesh.nodes[mesh.quads]
    n = len(corners)
    stiffness, mass = np.zeros((n, 8, 8)), np.zeros((n, 4))
    law = np.array([_elasticity(s.youngs_modulus, s.poisson) for s in mesh.sections])[mesh.part]
    density = np.array([section.density for section in mesh.sections])[mesh.part]
    for xi, eta in _CORNERS / np.sqrt(3.0):
        shape = 0.25 * (1.0 + xi * _CORNERS[:, 0]) * (1.0 + eta * _CORNERS[:, 1])
        local = 0.25 * np.column_stack(
            [_CORNERS[:, 0] * (1.0 + eta * _CORNERS[:, 1]), _CORNERS[:, 1] * (1.0 + xi * _CORNERS[:, 0])]
        )
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
    """Bound of the mesh's largest angular frequency [rad/s]: the largest of a single element's."""
    inverse_root = np.repeat(matrices.mass, 2, axis=1) ** -0.5
    scaled = inverse_root[:, :, None] * matrices.stiffness * inverse_root[:, None, :]
    return float(np.sqrt(np.linalg.eigvalsh(scaled)[:, -1].max()))
