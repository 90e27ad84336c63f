"""Specimens as meshes: bonds, the eighth against the whole, slopes of the forces, strains by volume."""

import numpy as np
import pytest

from kolsky.bodies.specimen_constants import Constants
from kolsky.bodies.specimen_model import Shape, SpecimenModel, strains

LAW = Constants(
    "mooney_rivlin", {"C10": 9e3, "C01": 4e3, "C11": 400.0, "poisson": 0.4}, ("C10", "C01", "poisson")
)
STRIP = Shape("strip", (0.08, 0.02, 0.004), 0.01, (16, 4, 2), element="hex8")
CROSS = Shape("cross", (0.08, 0.08, 0.004), 0.01, (8, 8, 2), arm=0.02, element="hex8")


def test_bonds_are_faces_at_the_ends() -> None:
    mesh = STRIP.mesh
    bond = mesh.points[mesh.nodes("bond_x+")]
    assert bond[:, 0].min() == pytest.approx(0.03)
    assert np.unique(np.round(bond[:, 2], 9)).tolist() == [0.002]
    assert STRIP.multiplicity == 4.0
    whole = Shape("strip", (0.08, 0.02, 0.004), 0.01, (16, 4, 2), element="hex8", symmetry=False)
    assert len(whole.mesh.nodes("bond_x-")) == 2 * 5 * 3
    assert whole.multiplicity == 1.0


@pytest.mark.parametrize("shape", [STRIP, CROSS])
def test_an_eighth_pulls_like_the_whole(shape: Shape) -> None:
    d = np.repeat(np.array([[0.01], [0.02]]), shape.ends, axis=1)
    whole = Shape(**{**vars_of(shape), "symmetry": False})
    a, b = (SpecimenModel("one", s).linearised(LAW, LAW.start, d) for s in (shape, whole))
    assert not isinstance(a, str)
    assert not isinstance(b, str)
    assert a.force == pytest.approx(b.force, rel=1e-7)
    assert a.by_constants == pytest.approx(b.by_constants, rel=1e-6)
    assert a.by_displacement == pytest.approx(b.by_displacement, rel=1e-5, abs=1e-6)


def vars_of(shape: Shape) -> dict[str, object]:
    """Fields of a shape."""
    return {name: getattr(shape, name) for name in shape.__dataclass_fields__}


def test_slopes_are_those_of_differences() -> None:
    model, d = SpecimenModel("one", CROSS), np.array([[0.01, 0.015]])
    here = model.linearised(LAW, LAW.start, d)
    assert not isinstance(here, str)
    for j, size in enumerate((10.0, 10.0, 1e-4)):
        moved = [LAW.start + sign * size * (np.arange(3) == j) for sign in (1.0, -1.0)]
        up, down = (model.linearised(LAW, values, d) for values in moved)
        assert here.by_constants[..., j] == pytest.approx((up.force - down.force) / (2.0 * size), rel=1e-4)  # type: ignore[union-attr]
    for end in range(2):
        moved = [d + sign * 1e-6 * (np.arange(2) == end) for sign in (1.0, -1.0)]
        up, down = (model.linearised(LAW, LAW.start, at) for at in moved)
        slope = (up.force - down.force) / 2e-6  # type: ignore[union-attr]
        assert here.by_displacement[..., end] == pytest.approx(slope, rel=1e-4, abs=1e-3)


def test_samples_may_come_in_any_order() -> None:
    model = SpecimenModel("one", STRIP)
    d = np.array([[0.02], [0.005], [0.01]])
    there, sorted_there = (model.linearised(LAW, LAW.start, x) for x in (d, np.sort(d, axis=0)))
    assert there.force[[1, 2, 0]] == pytest.approx(sorted_there.force, rel=1e-8)  # type: ignore[union-attr]


def test_failure_is_said() -> None:
    answer = SpecimenModel("one", STRIP).linearised(LAW, np.array([-9e3, 4e3, 0.4]), np.array([[0.01]]))
    assert isinstance(answer, str)


def test_strains_by_volume() -> None:
    # The whole bonded face is held: volumes add up to the simulated eighth, and the mid-region is stretched
    # by the stroke over the free length or a little more.
    model = SpecimenModel("one", STRIP)
    solution = model.simulate(LAW.solid(LAW.start), np.array([[0.03]]))
    strain, volume = strains(solution, 0)
    assert volume.sum() == pytest.approx(0.08 * 0.02 * 0.004 / 8.0)
    middle = strain[STRIP.mid_region()]
    assert middle[..., 0].mean() == pytest.approx(0.03 / 0.06, rel=0.1)
    # compressible at nu = 0.4, uniform: sides are equal
    assert middle[..., 1].mean() == pytest.approx(middle[..., 2].mean(), abs=0.02)


def test_a_shorter_bond() -> None:
    assert STRIP.shortened().bond == pytest.approx(0.005)
    with pytest.raises(ValueError, match="at least 2"):
        Shape("strip", (0.08, 0.02, 0.004), 0.005, (16, 4, 2)).shortened()
