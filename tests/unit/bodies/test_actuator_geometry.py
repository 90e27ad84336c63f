"""The mesh of an actuator against volumes, areas and forces that follow from its dimensions."""

import numpy as np
import pytest

from explicit.materials import LAWS
from kolsky.bodies.actuator_model import Actuator, Pneunet
from kolsky.equilibrium.loads import FollowerPressure, faces_on
from kolsky.equilibrium.points import geometry
from kolsky.equilibrium.solid import Isotropic, bulk

RUBBER = Isotropic(LAWS["neo_hookean"].of([218e3]), bulk(2.0 / 1.150e-6))
SHAPE = {"chambers": 2, "half": True}


def solid_volume(s: Pneunet) -> float:
    """Outer block less chambers, channel and the open gaps [m3], of the whole."""
    cx, cy, cz = s.chamber
    channel = s.inlet + (2 * s.chambers - 1) * s.wall + (s.chambers - 1) * s.gap
    open_height = s.height - (s.base + s.channel[1] + s.wall)
    return (
        s.length * s.width * s.height
        - s.chambers * cx * cy * cz
        - channel * s.channel[0] * s.channel[1]
        - (s.chambers - 1) * s.gap * s.width * open_height
    )


@pytest.mark.parametrize("element", ["hex27", "hex8", "tet10", "tet4"])
@pytest.mark.parametrize("half", [True, False])
def test_volume_and_net_force_of_the_cavity(element: str, half: bool) -> None:
    s = Pneunet(chambers=2, element=element, half=half)
    mesh = s.mesh
    share = 0.5 if half else 1.0
    volume = geometry(mesh, kinematics="3d", thickness=1.0, gauss=None).volumes.sum()
    assert volume == pytest.approx(share * solid_volume(s), rel=1e-12)
    model = Actuator(mesh, s.cavities, RUBBER, 1020.0).model((0.0, 0.0, -9.81))
    force = FollowerPressure(model, "cavity").evaluate(np.zeros(model.n_dofs))[0].reshape(-1, 3).sum(axis=0)
    # a closed surface has no net force: what the walls feel is what the lids of the openings would not
    bore = share * s.channel[0] * s.channel[1]
    channel = s.inlet + 3 * s.wall + s.gap
    mirror = (2 * s.chamber[0] * s.chamber[2] + channel * s.channel[1]) if half else 0.0
    # three corners of a linear tetrahedron on the mirror may all be corners of the cavity: the force on that
    # face points along the mirror's normal, which holds it
    at = [0, 2] if element == "tet4" and half else [0, 1, 2]
    assert force[at] == pytest.approx(np.array([bore, mirror, 0.0])[at], abs=1e-9 * s.length**2)


def test_parts_follow_one_another() -> None:
    s = Pneunet(chambers=3, wall=2e-3, chamber=(4e-3, 8e-3, 9e-3), gap=1.5e-3, inlet=6e-3, base=3e-3)
    assert s.length == pytest.approx(6e-3 + 3 * (4e-3 + 4e-3) + 2 * 1.5e-3)
    points = s.mesh.points
    assert points.max(axis=0) == pytest.approx([s.length, 6e-3, 14e-3])
    for n, end in ((1, 14e-3), (2, 23.5e-3)):
        left, right = (points[s.mesh.sets[f"gap_{n}_{side}"]] for side in ("left", "right"))
        assert left[:, 0] == pytest.approx(end)
        assert right[:, 0] == pytest.approx(end + 1.5e-3)
        assert left[:, 1:] == pytest.approx(right[:, 1:])
    assert points[s.mesh.sets["tip"]] == pytest.approx(np.array([[s.length, 0.0, 0.0]]))


def test_separate_chambers_have_a_cavity_each_and_no_channel() -> None:
    s = Pneunet(chambers=2, separate=True, element="hex8")
    assert s.cavities == ("cavity_1", "cavity_2")
    for n, low in ((1, 7.5e-3), (2, 17.5e-3)):
        x = s.mesh.points[s.mesh.sets[f"cavity_{n}"], 0]
        assert (x.min(), x.max()) == pytest.approx((low, low + 3e-3))


def test_faces_that_meet_in_an_edge_are_two() -> None:
    s = Pneunet(chambers=1, element="hex27", half=False)
    s8 = Pneunet(chambers=1, element="hex8", half=False)
    assert sum(len(f.cells) for f in faces_on(s.mesh, "cavity")) == sum(
        len(f.cells) for f in faces_on(s8.mesh, "cavity")
    )


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"wall": 0.0}, "wall must be > 0"),
        ({"channel": (12e-3, 2e-3)}, "width"),
        ({"element": "hex20"}, "hex20"),
    ],
)
def test_what_makes_no_actuator_is_refused(wrong: dict[str, object], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        Pneunet(**wrong)  # type: ignore[arg-type]
