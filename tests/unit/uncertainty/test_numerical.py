"""The numerics' part of an answer, and folded edges, in closed form."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from doe import Box
from explicit import Outcome, Response, cylinder
from explicit.mesh import corner_areas
from kolsky.base.apparatus import Interface
from kolsky.identification import identify
from kolsky.inverse.forward import GRADING
from kolsky.inverse.path_noise import FrontPath
from kolsky.inverse.problem import Freed, InverseProblem
from kolsky.inverse.run_table import RunTable
from kolsky.inverse.runner import Runner
from kolsky.inverse.settings import Numerics, Settings
from kolsky.inverse.work import Launch, Work, run_side_by_side
from kolsky.results.tables import to_json
from kolsky.shot.load import load_shot
from kolsky.uncertainty import mesh_error
from kolsky.uncertainty.mesh_error import GradedChange, MeshChange, mesh_change, numerical_parts, windows_of
from kolsky.uncertainty.warnings import FOLDED, folded_warning

# The numerics' part of an answer in closed form.

TRUTH = np.array([1.1, 3.0])
JACOBIAN = np.array([[2.0, 0.0], [0.0, 1.0], [1.0, -1.0]])
GAIN = np.linalg.pinv(JACOBIAN)


def planted(ratio: float, order: float, element: Any = None) -> tuple[MeshChange, np.ndarray, np.ndarray]:
    """A linear model whose data on a mesh of size h are J x + e h^order; the optimum on the finer mesh, of
    size 1, and the exact one."""
    error = np.array([0.03, -0.05, 0.02])
    data = JACOBIAN @ TRUTH
    fine, coarse = (data + error * h**order for h in (1.0, ratio))
    on_fine = TRUTH - GAIN @ (fine - data)  # the parameters make up for what the prediction has too much
    return MeshChange(coarse - fine, element, ratio), on_fine, TRUTH


def test_an_error_of_the_fitted_order_is_corrected_whole() -> None:
    change, on_fine, truth = planted(64 / 24, 3.2)
    np.testing.assert_allclose(on_fine + change.correction(GAIN), truth, rtol=1e-13)  # round-off
    assert np.abs(on_fine - truth).min() > 1e-3  # there was something to correct


@pytest.mark.parametrize("order", [2.1, 4.0])
def test_an_error_of_another_order_is_within_what_is_said_without_the_other_element(order: float) -> None:
    # (q^p - 1) / (q^3.2 - 1) of the error is corrected: 6.85 and 49.57 of 22.07 for a ratio of 8 / 3.
    change, on_fine, truth = planted(8 / 3, order)
    left = on_fine + change.correction(GAIN) - truth
    share = ((8 / 3) ** order - 1.0) / ((8 / 3) ** 3.2 - 1.0)
    np.testing.assert_allclose(left, (1.0 - share) * (on_fine - truth), rtol=1e-12)
    assert (np.abs(left) < change.sigma(GAIN)).all()


def test_the_shift_is_the_refined_mesh_less_the_coarser_one() -> None:
    change, on_fine, truth = planted(2.0, 3.2)
    error = on_fine - truth  # 2^3.2 of it on the coarser mesh
    np.testing.assert_allclose(change.shift(GAIN), error - 2.0**3.2 * error, rtol=1e-12)


def test_what_is_left_is_what_a_lower_order_corrects_and_the_distance_of_the_elements() -> None:
    gain = np.array([[1.0, 0.0], [0.0, 1.0]])
    coarser, element = np.array([0.0106, 0.0]), np.array([0.0, -0.0480])
    change = MeshChange(coarser, element, 8 / 3)
    # (8/3)^3.2 - 1 = 22.072; (8/3)^1.5 = 4.3546 for the gap on the refined mesh.
    np.testing.assert_allclose(change.correction(gain), [0.0106 / 22.0724, 0.0], rtol=1e-4)
    # What the order 2.1 would correct more: 1 / 6.8439 - 1 / 22.0724 of the shift, (8/3)^2.1 - 1 = 6.8439.
    more = 0.0106 * (1.0 / 6.8439 - 1.0 / 22.0724)
    np.testing.assert_allclose(change.sigma(gain), [more, 0.048 / 4.3546], rtol=1e-4)
    both = MeshChange(coarser, np.array([0.0480, 0.0]), 8 / 3)
    expected = np.hypot(more, 0.048 / 4.3546)
    assert both.sigma(gain)[0] == pytest.approx(expected, rel=1e-4)
    # Without the other element three and a half times the whole correction counts.
    assert MeshChange(coarser, None, 8 / 3).sigma(gain)[0] == pytest.approx(3.5 * 0.0106 / 22.0724, rel=1e-4)


def test_an_error_that_graded_meshes_tell_is_corrected_whole() -> None:
    """Data J x + e on the refined mesh, J x + g h^2 on graded ones of sizes 1 and 1.6."""
    e, g = np.array([0.03, -0.05, 0.02]), np.array([0.004, 0.001, -0.006])
    data = JACOBIAN @ TRUTH
    refined, graded, coarser = data + e, data + g, data + g * 1.6**2
    found = MeshChange(
        np.full(3, 9.0), None, 2.0, graded=GradedChange(coarser - graded, 1.6, graded - refined)
    )
    on_fine = TRUTH - GAIN @ (refined - data)
    np.testing.assert_allclose(found.error, e, rtol=1e-13)
    np.testing.assert_allclose(on_fine + found.correction(GAIN), TRUTH, rtol=1e-13)  # round-off
    np.testing.assert_allclose(found.graded.left, g, rtol=1e-13)
    # Where the refined mesh is the finer graded one, its error is what that one's is.
    np.testing.assert_allclose(GradedChange(coarser - graded, 1.6).error, g, rtol=1e-13)


def test_what_graded_meshes_leave_is_their_own_error_and_a_share_of_the_elements_distance() -> None:
    gain, windows = np.eye(2), np.array([0, 1])
    graded = GradedChange(np.array([0.0156, 0.0]), 1.6)  # 1.6^2 - 1 = 1.56
    both = MeshChange(np.zeros(2), np.array([0.0480, 0.0480]), 8 / 3, windows, graded)
    apart = 0.5 * 0.048 / 4.3546  # (8/3)^1.5 = 4.3546
    np.testing.assert_allclose(both.sigma(gain), [np.hypot(0.01, apart), apart], rtol=1e-4)
    whole = replace(both, element_share=1.0).sigma(gain)
    np.testing.assert_allclose(whole, [np.hypot(0.01, 2.0 * apart), 2.0 * apart], rtol=1e-4)
    np.testing.assert_allclose(
        MeshChange(np.zeros(2), None, 8 / 3, windows, graded).sigma(gain), [0.016, 0.0], rtol=1e-12
    )
    # Windows err to sides of their own: 0.01 and -0.01 are not nothing.
    wide, opposite = np.ones((1, 2)), replace(graded, coarser=np.array([0.0156, -0.0156]))
    assert MeshChange(np.zeros(2), None, 2.0, windows, opposite).sigma(wide)[0] == pytest.approx(
        1.6 * 0.01 * 2.0**0.5
    )


def test_windows_err_to_sides_of_their_own() -> None:
    gain, element = np.ones((1, 4)), np.array([3.0, 1.0, -3.0, -1.0])

    def said(windows: Any) -> float:
        return float(MeshChange(np.zeros(4), element, 4.0, windows).sigma(gain)[0])

    # The elements come together as 4^-1.5 = 1/8. In one window the four cancel; two windows have 4 and -4,
    # with the four entries each by itself the sum of squares is 20; the numbers of windows may have gaps.
    assert said(None) == said(np.zeros(4, int)) == 0.0
    assert said(np.array([0, 0, 1, 1])) == pytest.approx(32.0**0.5 / 8.0)
    assert said(np.array([1, 0, 7, 3])) == pytest.approx(20.0**0.5 / 8.0)


def test_a_test_has_twelve_windows_of_equal_length() -> None:
    times = 5e-4 + 1e-6 * np.array([0.0, 99.0, 101.0, 601.0, 1199.0, 1200.0, 250.0])
    np.testing.assert_array_equal(windows_of(times), [0, 0, 1, 6, 11, 11, 2])
    np.testing.assert_array_equal(windows_of(np.array([2.0, 2.0])), [0, 0])
    assert windows_of(np.zeros(0)).shape == (0,)


def test_a_mesh_no_finer_than_the_other_is_refused() -> None:
    with pytest.raises(ValueError, match=r"1 times the elements.*more than 1"):
        MeshChange(np.zeros(2), None, 1.0)


def test_roughness_is_a_part_of_its_own() -> None:
    rough, change = np.array([0.2]), MeshChange(np.array([0.0]), None, 2.0)
    found = numerical_parts(change, np.eye(1), roughness=rough)
    assert list(found) == ["mesh", "roughness"]
    assert found["roughness"] is rough
    assert found["mesh"] == 0.0
    assert list(numerical_parts(change, np.eye(1))) == ["mesh"]


def staged(
    monkeypatch: pytest.MonkeyPatch, lost: str = "", *, numerics: Numerics | None = None, **offset: float
) -> tuple[Any, Any]:
    """Simulations whose data vectors on the surrogate's mesh are known, and an answer."""
    vectors = {"one_point": np.array([7.0, np.nan]), "fbar": np.array([8.5, 2.0])}
    graded = {(30, 40): np.array([9.0, 2.5])}
    shifts = {mesh: np.array(list(offset.values())) for mesh in [(20, 27), *graded] if offset}
    side = "coulomb" if lost == "smoothness" else "bonded"
    shot = SimpleNamespace(interface=SimpleNamespace(faces="bonded", side=side))

    def side_by_side(launches: list[Launch]) -> list[Any]:
        found = []
        for launch in launches:
            numerics = launch.numerics
            # A graded mesh is run at the answer itself, the surrogate's where it resembles the refined one.
            shift = shifts.get(numerics.mesh, np.zeros(1))[0] if numerics.grading == 2.0 else 0.0
            assert launch.points == {"poisson": 0.49, "stiffness_factor": 1.0 + shift}
            what = str(numerics.mesh) if numerics.grading == 5.0 else numerics.element
            seen = graded[numerics.mesh] if numerics.grading == 5.0 else vectors[numerics.element]
            ended = SimpleNamespace(ok=what not in lost)
            found.append(
                SimpleNamespace(outcomes=[ended], seen=seen, describe=lambda row, what=what: f"{what} over")
            )
        return found

    monkeypatch.setattr(mesh_error, "run_side_by_side", side_by_side)
    monkeypatch.setattr(mesh_error, "predict", lambda response, observations: response.seen[None])
    problem: Any = InverseProblem(
        SimpleNamespace(forward=SimpleNamespace(paths=[None], shot=shot), observations=None),  # type: ignore[arg-type]
        Freed(
            Settings(
                free={"stiffness_factor": None}, numerics=numerics or Numerics(), held={"poisson": 0.49}
            ),
            by_default=False,
            reasons={},
        ),
        Box.of({"stiffness_factor": (0.5, 2.0)}),
        None,
    )
    rng = np.random.default_rng(1)
    runner = Runner(problem, FrontPath(None), RunTable(("stiffness_factor",)), Work(), rng, shifts)  # type: ignore[arg-type]
    fine = SimpleNamespace(
        x=np.array([1.0]),
        jacobian=np.array([[3.0], [0.5]]),
        model=lambda x: np.array([[6.0, 2.0]]),
        objective=SimpleNamespace(vectors=lambda prediction: prediction, times=np.array([0.0, 1.0])),
    )
    return runner, fine


def test_changes_are_taken_at_the_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    found = mesh_change(*staged(monkeypatch))
    np.testing.assert_array_equal(found.coarser, [1.0, 0.0])  # a point that is not reached adds nothing
    np.testing.assert_array_equal(found.element, [1.5, 0.0])
    assert found.ratio == 2.4
    np.testing.assert_array_equal(found.windows, [0, 11])
    assert found.lost == ()
    # A mesh that is run 0.2 higher, in step with the data: 0.2 of the slopes (3, 0.5) is taken back.
    np.testing.assert_allclose(
        mesh_change(*staged(monkeypatch, m=0.2)).coarser, [0.4, -0.1], rtol=0, atol=1e-15
    )
    graded = found.graded
    np.testing.assert_array_equal(graded.coarser, [3.0, 0.5])  # 9 where the refined mesh has 6
    assert graded.graded == 0.0
    assert graded.ratio == 1.6
    with pytest.raises(ValueError, match="20 x 27 elements did not complete"):
        mesh_change(*staged(monkeypatch, lost="one_point"))


def test_lost_runs_are_told_from_those_left_out_on_purpose(monkeypatch: pytest.MonkeyPatch) -> None:
    found = mesh_change(*staged(monkeypatch, lost="(30, 40)"))
    assert found.graded is None
    (lost,) = found.lost
    assert lost.is_graded
    assert lost.numerics.mesh == (30, 40)
    assert lost.why == "(30, 40) over"
    other = mesh_change(*staged(monkeypatch, lost="fbar"))
    assert other.element is None
    assert other.graded is not None
    assert [(run.is_graded, run.numerics.element) for run in other.lost] == [(False, "fbar")]
    runner, fine = staged(monkeypatch, lost="smoothness")  # of a sliding surface single runs jump
    assert (mesh_change(runner, fine).graded, mesh_change(runner, fine).lost) == (None, ())
    runner, fine = staged(monkeypatch, numerics=Numerics(compressible=0.49))
    assert (mesh_change(runner, fine).graded, mesh_change(runner, fine).lost) == (None, ())


OPEN_01 = Path(__file__).parents[3] / "runs" / "open-01"
SETTINGS = Settings(
    free={"stiffness_factor": None}, numerics=Numerics(mesh=(6, 8)), refined_mesh=(12, 16), replicates=2
)


def test_an_identification_says_which_graded_run_it_has_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    def losing(launches: list[Launch]) -> list[Response]:
        return [
            replace(response, outcomes=(Outcome.INVERTED,))
            if launch.numerics.grading == GRADING
            else response
            for launch, response in zip(launches, run_side_by_side(launches), strict=True)
        ]

    shot = load_shot(OPEN_01)
    first, last = shot.window
    short = replace(shot, window=(first, first + 0.4 * (last - first)))
    whole = identify(short, SETTINGS)
    assert "lost_mesh_runs" not in whole.surrogate
    assert "graded mesh" not in " ".join(whole.warnings)
    monkeypatch.setattr(mesh_error, "run_side_by_side", losing)
    found = identify(short, SETTINGS)
    (said,) = [text for text in found.warnings if "graded mesh" in text]
    assert said.startswith("the run at the answer on the graded mesh of 8 x 10 elements failed (INVERTED at ")
    assert "come from the coarser mesh of 6 x 8 elements" in said
    assert said in to_json(found)["warnings"]
    assert found.surrogate["lost_mesh_runs"] == 1.0
    # The run on the refined mesh is the same, what the mesh is said to do is not.
    e, was = found.estimates["stiffness_factor"], whole.estimates["stiffness_factor"]
    assert e.on_mesh == was.on_mesh
    assert e.mesh_correction != was.mesh_correction
    assert e.numerical_parts["mesh"] != was.numerical_parts["mesh"]


# Folded edges: areas at corners by hand, and the warning for a sliding face with a folded edge.

MESH = cylinder(4e-3, 6e-3, n_radial=2, n_axial=2)
BONDED = Interface(faces="bonded", side="bonded")
SLIDING = Interface(faces="coulomb", side="coulomb", friction=0.3)
ELEMENT, CORNER = 3, 0  # an element and the corner of it that is moved


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
