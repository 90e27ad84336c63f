"""Checks of the printed tables of the paper on the healing actuator, and the bend with both readings of D1.

Usage: python runs/actuator/paper.py OUT [--bend SPEC]

OUT/tables.csv compares printed entries of the tables with values that follow from their other entries. With
--bend, OUT/readings.csv contains the bend of SPEC's actuator at its pressures with D1 read as 1/MPa and as
MPa.
"""

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.optimize import brentq

from kolsky.base.files import write_table
from kolsky.bodies.actuator_reading import read_actuator, volume_reading
from kolsky.equilibrium.solid import bulk

C10, D1, POISSON = 0.109, 1.150, 0.44
"""Printed values [MPa, as printed, -]."""


def poisson(shear: float, modulus: float) -> float:
    """Poisson's ratio of shear and bulk modulus [-]."""
    return (3.0 * modulus - 2.0 * shear) / (2.0 * (3.0 * modulus + shear))


def young(shear: float, modulus: float) -> float:
    """Young's modulus of shear and bulk modulus."""
    return 9.0 * modulus * shear / (3.0 * modulus + shear)


def cauchy(stretch: float, across: float) -> tuple[float, float]:
    """Stress along and across a homogeneous tension by the paper's Eq. (7) [MPa]."""
    J = stretch * across**2
    mean = (stretch**2 + 2.0 * across**2) / 3.0
    volume = 2.0 / D1 * (J - 1.0)
    return tuple(2.0 * C10 * J ** (-5.0 / 3.0) * (x**2 - mean) + volume for x in (stretch, across))


def checks() -> list[tuple[str, float, float]]:
    """The checked entry, its printed value, and the value that follows."""
    shear, inverse, direct = 2.0 * C10, 2.0 / D1, 2.0 * D1
    stretch = 2.3
    linear = 1.0 - POISSON * (stretch - 1.0)
    free = brentq(lambda across: cauchy(stretch, across)[1], 0.5, 1.0)
    nominal = [cauchy(stretch, across)[0] * across**2 for across in (linear, free)]
    return [
        ("Poisson's ratio, D1 in 1/MPa", POISSON, poisson(shear, inverse)),
        ("Poisson's ratio, D1 in MPa (Table 3)", POISSON, poisson(shear, direct)),
        ("Young's modulus of the undamaged (MPa)", 0.68, young(shear, inverse)),
        ("Young's modulus of the healed (MPa)", 0.70, young(2.0 * 0.107, 2.0 / 1.153)),
        ("efficiency of the fracture stress (%)", 96.3, 100.0 * 304.0 / 316.0),
        ("efficiency of the fracture strain (%)", 91.3, 100.0 * 117.0 / 128.0),
        ("efficiency of Young's modulus (%)", 103.4, 100.0 * 0.70 / 0.68),
        ("shear modulus of Ogden's law as printed, mu alpha / 2 (MPa)", shear, 0.218 * 1.972 / 2.0),
        ("shear modulus of Ogden's law with 2 mu / alpha^2 (MPa)", shear, 0.218),
        ("nominal stress at 130 %, strain across -nu strain (MPa)", 0.316, nominal[0]),
        ("nominal stress at 130 %, no stress across (MPa)", 0.316, nominal[1]),
        ("volume ratio at 130 %, strain across -nu strain", 1.0, stretch * linear**2),
        ("volume ratio at 130 %, no stress across", 1.0, stretch * free**2),
    ]


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--bend", type=Path)
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    rows = checks()
    for what, printed, follows in rows:
        print(f"{what}: printed {printed:g}, follows {follows:.4g}")
    names = ("what", "printed or expected", "follows")
    write_table(given.out / "tables.csv", dict(zip(names, map(list, zip(*rows, strict=True)), strict=True)))
    if given.bend is None:
        return
    read = read_actuator(given.bend)
    columns: dict[str, list] = {"gravity": [], "pressure (Pa)": [], "reading": [], "angle (deg)": []}
    for text in (f"{D1} 1/MPa", f"{D1} MPa"):
        solid = replace(read.actuator.solid, volumetric=bulk(volume_reading(text)))
        for name, g in read.gravities.items():
            constants = read.actuator.constants(body=solid)
            run = read.actuator.simulate(g, read.pressures, constants=constants)
            for pressure, angle in zip(read.pressures, np.degrees(run.angle), strict=True):
                print(f"D1 = {text}, {name}, {1e-5 * pressure:.3g} bar: {angle:.2f} deg")
                row = (name, float(pressure), text, float(angle))
                for column, value in zip(columns.values(), row, strict=True):
                    column.append(value)
    write_table(given.out / "readings.csv", columns)


if __name__ == "__main__":
    main()
