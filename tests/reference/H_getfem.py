"""Static compression of Yeoh, Ogden and Mooney-Rivlin cylinders by GetFEM 5.4.2: one run, one file.

    python3 H_getfem.py yeoh 0.3 16 4 runs/yeoh_0.3_n16_g4.npz

The model is that of `G_friction_getfem.py`: Q2 displacement, continuous Q1 pressure, Coulomb's law exact at
each node of face and side (a coefficient of 1000 for ends that do not slide). The energies are written in
GetFEM's language. The program uses no code of the package. `H_tables.py` makes the tables.
"""

import sys

import G_friction_getfem as g
import getfem as gf
import numpy as np
from H_specimens import POISSON, SPECIMENS, strains

ENERGIES = {
    "reduced_polynomial": "1.4049*(I1-3)+0.6994*pow(I1-3,2)",
    "yeoh": "14*(I1-3)+2*pow(I1-3,2)+0.5*pow(I1-3,3)",
    "mooney_rivlin": "9*(I1-3)+5*(I2-3)",
    "ogden2": "2*18/sqr(3.5)*(pow(B1,1.75)+pow(B2,1.75)+pow(B3,1.75)-3)+2*8/sqr(2)*(1/B1+1/B2+1/B3-3)",
}
"""The same constants as in `H_specimens.py` [kPa]."""


def main():
    """Compress and save every recorded strain's force, radii and outline."""
    law, friction, elements, grading, out = sys.argv[1:]
    recorded = strains(law)
    diameter, length, shear, _ = SPECIMENS[law]
    g.RADIUS, g.HALF = 0.5 * diameter, 0.5 * length
    g.YOUNG, g.POISSON = 2.0 * shear * (1.0 + POISSON), POISSON
    g.ISOCHORIC = ENERGIES[law]
    gf.util("trace level", 0)
    gf.util("warning level", 0)
    body = g.Cylinder(float(friction), int(elements), float(grading), False, 400.0)
    state = body.md.from_variables().copy()
    before = body.md.variable("u").copy()
    done, size, slope, k = 0.0, 0.0025, None, 0
    history, sides, snaps = [], [], 0
    while done < recorded[-1] - 1e-9:
        size = min(size, recorded[k] - done)
        to, ok = done + size, False
        if slope is not None:
            ok, x = body.newton(state + size * slope, to, 0.0, before)
        if not ok:
            ok, x = body.newton(state.copy(), to, 0.0, before)
        if not ok and size > 5e-5:
            size /= 2
            continue
        if not ok:
            x, snaps = body.creep(state.copy(), before, to), snaps + 1
        body.md.to_variables(x)
        slope = (x - state) / size if ok else None
        state, done, before = x, to, body.md.variable("u").copy()
        size = min(0.0025, 1.5 * size)
        if abs(done - recorded[k]) < 1e-9:
            history.append([done, *body.observe()])
            sides.append(body.boundary()[1])
            print(f"{done:.4f}", *(f"{v:.6g}" for v in history[-1][1:]), snaps, flush=True)
            k += 1
            np.savez(out, history=np.array(history), side=np.array(sides), snaps=snaps)


if __name__ == "__main__":
    main()
