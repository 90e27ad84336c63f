"""Stability of the slowly sliding cylinder, in GetFEM 5.4.2 and SciPy: `python3 G_friction_flutter.py`.

The static state of `G_friction_getfem.py` (displacement elements) is linearised. Pressed nodes keep their
height, and sticking nodes keep their position. The friction of a sliding node follows the change of its
normal force. The stiffness is therefore not symmetric. Complex values of w^2 in K x = w^2 M x mean
oscillations that grow as exp(t |Im w|) in a body without damping. The program writes
`G_friction_flutter.csv`.
"""

from pathlib import Path

import getfem as gf
import numpy as np
from G_friction_getfem import HALF, POISSON, YOUNG, Cylinder
from scipy.linalg import eigvals

DENSITY = 870e-9  # kg/mm^3; forces are in mN = kg mm/s^2
STEP = 0.005
STATES = (0.05, 0.1)
MESHES = (8, 12, 16)


def elastic(body):
    """Internal forces, their tangent and the mass matrix at the body's displacement, contact left out."""
    model = gf.Model("real")
    model.add_fem_variable("u", body.fem)
    model.add_initialized_data("mu", YOUNG / (2 * (1 + POISSON)))
    model.add_initialized_data("K", YOUNG / (3 * (1 - 2 * POISSON)))
    model.set_variable("u", body.md.variable("u"))
    grad, hoop = "(Id(2)+Grad_u)", "(1+u(1)/X(1))"
    jac = f"(Det{grad}*{hoop})"
    energy = f"mu/2*(pow({jac},-2/3)*(Norm_sqr{grad}+sqr{hoop})-3)+K/2*sqr({jac}-1)"
    model.add_nonlinear_term(body.gauss, f"2*pi*X(1)*({energy})")
    model.assembly("build_all")
    mass = gf.asm_generic(body.gauss, 2, f"2*pi*X(1)*{DENSITY}*Test_u.Test2_u", -1, model)
    return -model.rhs(), model.tangent_matrix().full(), mass.full()


def growth(body, compression, friction):
    """Largest rate of growth [1/s], its frequency [Hz], and the numbers of pressed and sliding nodes."""
    force, stiffness, mass = elastic(body)
    u = body.md.variable("u")
    height = HALF * (1 - compression)
    edge = np.unique(np.concatenate([body.face[1:], body.side]))
    pressed = edge[np.abs(body.place[1] + u[1::2] - height)[edge] < 1e-7]
    fixed = {2 * i for i in np.flatnonzero(body.place[0] < 1e-9)}
    fixed |= {2 * i + 1 for i in np.flatnonzero(body.place[1] < 1e-9)}
    fixed |= {2 * body.face[0] + 1} | {2 * i + 1 for i in pressed}
    sliding = 0
    for i in pressed:
        along, across = force[2 * i], -force[2 * i + 1]
        if abs(along) > friction * across * (1 - 1e-6) - 1e-9:
            share = np.sign(along) * friction
            stiffness[2 * i] += share * stiffness[2 * i + 1]
            mass[2 * i] += share * mass[2 * i + 1]
            sliding += 1
        else:
            fixed.add(2 * i)
    free = np.setdiff1d(np.arange(len(force)), np.array(sorted(fixed)))
    omega = np.sqrt(eigvals(stiffness[np.ix_(free, free)], mass[np.ix_(free, free)]).astype(complex))
    worst = np.abs(omega.imag).argmax()
    return abs(omega.imag[worst]), omega.real[worst] / (2 * np.pi), len(pressed), sliding


def main():
    """Every coefficient and mesh."""
    gf.util("trace level", 0)
    rows = []
    for elements in MESHES:
        for friction in (0.0, 0.05, 0.1, 0.2, 0.3, 0.5):
            body = Cylinder(friction, elements, 1.0, True, 400.0)
            state = body.md.from_variables().copy()
            for k in range(1, round(max(STATES) / STEP) + 1):
                ok, state = body.newton(state, k * STEP, 0.0, body.md.variable("u").copy())
                if not ok:
                    raise RuntimeError(f"no static state at {k * STEP}")
                if np.isclose(k * STEP, STATES).any():
                    rows.append([friction, elements, k * STEP, *growth(body, k * STEP, friction)])
                    print(*(f"{v:.4g}" for v in rows[-1]), flush=True)
    np.savetxt(
        Path(__file__).with_suffix(".csv"),
        rows,
        fmt=("%g", "%d", "%g", "%.0f", "%.0f", "%d", "%d"),
        delimiter=",",
        header="friction [-], elements across the radius, compression [-], fastest growth [1/s], "
        "its frequency [Hz], pressed nodes, sliding nodes",
    )


if __name__ == "__main__":
    main()
