"""A small actuator that several tests share: two chambers of linear hexahedra."""

from explicit.materials import LAWS
from kolsky.bodies.actuator_model import Actuator, Pneunet
from kolsky.equilibrium.solid import Isotropic, bulk

RUBBER = Isotropic(LAWS["neo_hookean"].of([218e3]), bulk(2.0 / 1.150e-6))
DOWN = (0.0, 0.0, -9.81)
MOST = 60e3


def actuator(**options: object) -> Actuator:
    """Two chambers, hex8, half."""
    shape = Pneunet(**{"chambers": 2, "element": "hex8", **options})  # type: ignore[arg-type]
    return Actuator(shape.mesh, shape.cavities, RUBBER, 1020.0)
