"""Folded edges: areas at corners by hand, and the warning for a sliding face with a folded edge."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from explicit import Outcome, cylinder
from explicit.mesh import corner_areas
from kolsky.base.apparatus import Interface
from kolsky.uncertainty.warnings import FOLDED, folded_warning

MESH = cylinder(4e-3, 6e-3, n_radial=2, n_axial=2)
BONDED = Interface(faces="bonded", side="bonded")
SLIDING = Interface(faces="coulomb", side="coulomb", friction=0.3)
ELEMENT, CORNER = 3, 0
"""An element and the corner of it that is moved."""


def moved(share: float) -> np.ndarray:
    """Positions with one corner on the diagonal through it: 1 at rest, 0 on the line of its neighbours.

    The area at the corner goes with the distance from that line: it is `share` of the undeformed one.
    """
    nodes = np.array(MESH.nodes)
    at, ahead, _, behind = (MESH.quads[ELEMENT][(CORNER + k) % 4] for k in range(4))
    middle = 0.5 * (nodes[ahead] + nodes[behind])
    nodes[at] = middle + share * (nodes[at] - middle)
    return nodes


def response(*shares: float, outcome: Outcome = Outcome.COMPLETED, nodes: bool = True) -> Any:
    return SimpleNamespace(
        nodes=np.array([[moved(share) for share in shares]]) if nodes else None,
        surface_times=1e-4 * np.arange(len(shares)),
        outcomes=(outcome,),
    )


def said(shown: Any, interface: Interface = SLIDING, named: tuple[str, ...] = ()) -> list[str]:
    return list(folded_warning(shown, MESH, interface, named))


@pytest.mark.parametrize("share", [1.0, 0.5, 0.0, -0.6])
def test_the_area_at_a_corner_goes_with_its_distance(share: float) -> None:
    areas = corner_areas(MESH, moved(share))
    assert areas.shape == (4, 4)
    assert areas[ELEMENT, CORNER] == pytest.approx(share)
    # The opposite corner is spanned by sides that did not move.
    assert areas[ELEMENT, (CORNER + 2) % 4] == pytest.approx(1.0)
    np.testing.assert_allclose(corner_areas(MESH, 2.0 * MESH.nodes), 4.0)


def test_a_fold_is_said_with_its_time_and_place() -> None:
    (text,) = said(response(1.0, FOLDED + 0.01, FOLDED - 0.01, -0.9))
    assert "from 200 us on" in text
    centre = 1e3 * MESH.nodes[MESH.quads[ELEMENT]].mean(axis=0)
    assert f"element {ELEMENT} at R = {centre[0]:.2f} mm, Y = {centre[1]:.2f} mm" in text
    assert "--element fbar" in text


def test_folds_of_right_runs_are_not_said() -> None:
    """Corners of the F-bar impacts whose edge stays: pressed flat, 0, and down to -0.19 where it lands."""
    assert said(response(0.0, -0.19)) == []


def test_what_is_no_fold_is_not_said() -> None:
    assert said(response(1.0, FOLDED + 0.01)) == []
    assert said(response(-0.9), BONDED) == []  # an edge that is held cannot jump
    assert len(said(response(-0.9), BONDED, ("friction",))) == 1  # named, it makes the faces slide
    assert said(response(-0.9, nodes=False)) == []
    assert said(response(-0.9, outcome=Outcome.INVERTED)) == []


@pytest.mark.slow
def test_the_impact_of_the_issue_is_caught_and_its_neighbour_is_not() -> None:
    """f = 0.3, 48 x 66: the one-point edge jumps by 0.13 mm, that of F-bar stays where it is."""
    from populations.folding import JUMP, impacts

    (one,), (whole,) = (impacts((48, 66, 1.0), element, (0.3,)) for element in ("one_point", "fbar"))
    assert one.jump > JUMP
    assert one.said
    assert whole.jump < 5e-6
    assert not whole.said
