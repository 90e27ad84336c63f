"""Small models for several tests, with few laws and kinematics: each pair is compiled once."""

import numpy as np

from explicit.materials import LAWS
from kolsky.equilibrium.meshes import box, rectangle
from kolsky.equilibrium.model import Fixed, Model, Prescribed
from kolsky.equilibrium.solid import Isotropic, bulk
from kolsky.equilibrium.solve import Newton

MOONEY = Isotropic(LAWS["mooney_rivlin"].of([9e3, 3.5e3, 400.0]), bulk(2e5))
TIGHT = Newton(tolerance=1e-12)
PULL = {"pull": np.array([0.2, 0.5])}


def clamped(kind: str = "quad9", kinematics: str = "plane_stress", **options) -> Model:
    """A bonded strip, twice as long as wide, pulled at its right end."""
    flat = kinematics != "3d"
    mesh = rectangle((2.0, 1.0), (2, 1), kind=kind) if flat else box((2.0, 1.0, 1.0), (2, 1, 1), kind=kind)
    others = (1,) if flat else (1, 2)
    conditions = (Fixed("left"), Fixed("right", others), Prescribed("right", 0, "pull"))
    return Model(mesh, options.pop("solid", MOONEY), conditions, kinematics=kinematics, **options)


def sliding(kind: str = "quad9", kinematics: str = "plane_stress", extra=(), **options) -> Model:
    """A block of edge 1 between frictionless grips at x = 0 and 1: its stretch is homogeneous."""
    d = 3 if kinematics == "3d" else 2
    mesh = box((1.0,) * d, (1,) * d, kind=kind)
    sides = ("left", "bottom", "back")[:d]
    conditions = tuple(Fixed(side, (axis,)) for axis, side in enumerate(sides))
    return Model(mesh, options.pop("solid", MOONEY), (*conditions, *extra), kinematics=kinematics, **options)
