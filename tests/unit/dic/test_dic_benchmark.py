"""The benchmark of `dic`: summary of errors, files of another program; no speeds."""

import json
import stat

import numpy as np
import pytest

from benchmarks import dic as benchmark
from benchmarks import dic_large, dic_peers, dic_whole
from benchmarks.dic_problem import PAIRS, Problem, errors, problems
from dic.correlation import Correlation
from dic.correlation.subsets import Shape, identity, overlap_correlation
from dic.tracking.matcher import enlarged, gradient, in_material, inherited_covariance
from kolsky.schema.shot_file import shot_toml
from populations import dic_sigmas

TABLE = """\
"subset_x","subset_y","disp_u","disp_v","disp_mag","converged","cost_zncc","ftol","xtol",
30.0,30.0,0.31,-0.01,0.31,1,0.99,0.000004,0.0001
35.0,30.0,0.27,-0.01,0.27,1,0.99,0.000004,0.0001
40.0,30.0,9.00,-0.01,9.00,0,0.10,0.000004,0.0001
33.0,30.0,7.00,-0.01,7.00,1,0.99,0.000004,0.0001
"""


def small():
    """Three points that move by 0.3 px, in pictures that nobody looks at."""
    points = np.array([[30.0, 30.0], [35.0, 30.0], [40.0, 30.0]])
    warp = np.zeros((3, 12))
    warp[:, 0] = 0.3
    nothing = np.zeros((PAIRS, 60, 60), dtype=np.uint8)
    return Problem("shift by 0.3 px", nothing, nothing, points, warp)


def test_errors_of_a_stretch():
    problem = small()
    problem.warp[:, 0] = 0.3 + 0.02 * problem.points[:, 0]
    problem.warp[:, 2] = 0.02
    found = errors(problem, np.array([[30.0, 30.0], [40.0, 30.0]]), np.array([0.9 + 0.01, 1.1 + 0.03]))
    assert found.bias == pytest.approx(0.02)
    assert found.spread == pytest.approx(0.01)
    assert found.found == pytest.approx(2 / (3 * PAIRS))


def test_a_table_of_pyvale_is_read_by_its_names(tmp_path, monkeypatch):
    """A stand-in for the environment writes what pyvale writes: only points of the problem count."""
    python = tmp_path / "python"
    python.write_text(
        "#!/bin/sh\n"
        + "\n".join(f"cat > $2/pair{k}_0000.csv <<'END'\n{TABLE}END" for k in range(PAIRS))
        + '\necho \'{"cpu": 0.5, "version": "1.2"}\' > $2/spent.json\n'
    )
    python.chmod(python.stat().st_mode | stat.S_IEXEC)
    row = dic_peers.pyvale(python, small(), prefilter=True)
    assert row.program == "pyvale 1.2, its prefilter"
    assert row.rate == 4 * PAIRS / 0.5
    assert row.errors.bias == pytest.approx(-0.01)
    assert row.errors.found == pytest.approx(2 / 3)


def test_a_peer_that_fails_says_so(tmp_path):
    with pytest.raises(dic_peers.PeerError, match="could not be run"):
        dic_peers.pyvale(tmp_path / "none", small(), prefilter=False)
    python = tmp_path / "python"
    python.write_text("#!/bin/sh\necho no module named pyvale >&2\nexit 3\n")
    python.chmod(python.stat().st_mode | stat.S_IEXEC)
    with pytest.raises(dic_peers.PeerError, match="ended with 3: no module named pyvale"):
        dic_peers.pyvale(python, small(), prefilter=False)


def test_rows_of_one_problem():
    problem = problems()[0]
    row, call = benchmark.measure(problem, Correlation(), "cpu", 30, 1)
    assert row.errors.found == 1.0
    assert abs(row.errors.bias) < 1e-3  # 0.2 mpx, known to 0.2
    assert row.errors.spread == pytest.approx(8.2e-3, rel=0.05)
    assert call["points"] == 30
    peer = dic_peers.pyramid_lk(problem, 1)
    assert peer.errors.found > 0.99
    assert peer.errors.spread == pytest.approx(8.2e-3, rel=0.1)  # the same noise in the same subsets
    text = benchmark.as_json("cpu", [row, peer], [call])
    assert [line["program"] for line in text["rows"]] == [row.program, peer.program]
    assert text["rows"][0]["iterations"] == call["iterations"]
    assert "8." in benchmark.line(row)


def test_the_shot_of_the_whole_chain_can_be_read(tmp_path):
    raw, folder = tmp_path / "raw", tmp_path / "shot"
    raw.mkdir()
    folder.mkdir()
    (raw / "cam0.tif").write_bytes(b"nobody looks")
    shot = dic_whole.shot_of(folder, raw)
    assert (shot / "cam0.tif").read_bytes() == b"nobody looks"
    declared = shot_toml(shot / "shot.toml").declared
    assert declared.pictures is not None
    assert declared.flyer is None
    assert declared.dic.subset == 25


def test_the_quickest_run_is_kept_beside_the_table(tmp_path):
    stages = {"calibration": 2.0, "correlation": 5.0}
    found = [dic_whole.Whole(9.0, 14.0, stages), dic_whole.Whole(8.0, 15.0, stages)]
    path = tmp_path / "dic.json"
    path.write_text('{"rows": [1]}')
    dic_whole.put(path, whole=dic_whole.as_json(found))
    kept = json.loads(path.read_text())
    assert kept["rows"] == [1]
    assert (kept["whole"]["wall_seconds"], kept["whole"]["runs"]) == (8.0, 2)
    assert "files and page 1.00" in dic_whole.line(found[1])


def test_a_result_of_large_pictures_takes_the_place_of_its_like(tmp_path):
    path = tmp_path / "large.json"
    size = {"picture": [8, 8], "points": 3, "device": "cpu"}
    for frames, seconds in ((2, 1.0), (4, 2.0), (2, 3.0)):
        dic_large.put(path, {**size, "frames": frames, "seconds": seconds})
    kept = json.loads(path.read_text())
    assert [(one["frames"], one["seconds"]) for one in kept] == [(4, 2.0), (2, 3.0)]


SIDE = 21


def weights(shape: Shape) -> np.ndarray:
    """Weights of a subset's pixels in the place of its middle, by least squares, shape [SIDE²]."""
    t = np.linspace(-1.0, 1.0, SIDE)
    x, y = (a.ravel() for a in np.meshgrid(t, t))
    monomials = [np.ones_like(x), x, y, x * x, x * y, y * y][: {Shape.AFFINE: 3, Shape.QUADRATIC: 6}[shape]]
    return np.linalg.pinv(np.stack(monomials, axis=1))[0]


@pytest.mark.parametrize("shape", [Shape.AFFINE, Shape.QUADRATIC])
@pytest.mark.parametrize("shift", [(0, 0), (4, 0), (0, 9), (7, 5), (15, 3), (19, 19), (25, 0)])
def test_points_are_alike_as_the_weights_of_their_common_pixels(shape: Shape, shift: tuple[int, int]) -> None:
    w = weights(shape).reshape(SIDE, SIDE)
    dx, dy = shift
    common = w[dy:, dx:] * w[: SIDE - dy, : SIDE - dx] if max(shift) < SIDE else np.zeros(1)
    found = overlap_correlation(np.zeros((1, 2)), np.array([shift], float), float(SIDE), shape)[0, 0]
    # 21 pixels stand for an integral: the corners' weights are off by a tenth of a pixel's share
    assert found == pytest.approx(common.sum() / np.sum(w * w), abs=0.04)


def test_the_sum_over_all_neighbours_is_that_of_the_area() -> None:
    """The weights of any shape function add up to one, so that what a dense mean takes over is the same."""
    grid = np.stack(np.meshgrid(np.arange(-30.0, 31.0), np.arange(-30.0, 31.0)), -1).reshape(-1, 2)
    for shape, variance in ((Shape.AFFINE, 1.0), (Shape.QUADRATIC, 3.5)):
        total = overlap_correlation(np.zeros((1, 2)), grid, 20.0, shape).sum()
        assert total * variance == pytest.approx(20.0**2, rel=0.02)


@pytest.mark.parametrize(
    ("matched", "tracked"), [(Shape.QUADRATIC, Shape.AFFINE), (Shape.AFFINE, Shape.QUADRATIC)]
)
def test_a_track_takes_back_what_its_shape_function_makes_of_the_noise(
    matched: Shape, tracked: Shape
) -> None:
    """A match ends at L_m (n_B - n_A), the track from there on takes L_t n_B away."""
    m, t = weights(matched), weights(tracked)
    start = np.eye(2)[None] * 2.0 * (m @ m)
    left = np.eye(2)[None] * (m @ m + (m - t) @ (m - t))
    found = inherited_covariance(start, np.eye(2)[None] * (t @ t), identity(1))
    np.testing.assert_allclose(found, left, rtol=1e-9, atol=1e-15)


def test_a_track_of_the_same_shape_function_takes_all_of_it_back() -> None:
    C = np.array([[[2.0, 0.5], [0.5, 1.0]]])
    np.testing.assert_allclose(inherited_covariance(C, 0.5 * C, identity(1)), 0.5 * C, atol=1e-14)


def test_covariances_go_back_to_the_material_by_the_gradient() -> None:
    warp = identity(1)
    warp[0, 2:6] = 1.0, 0.0, 0.0, -0.5  # stretched to 2 along x, to 1/2 along y
    np.testing.assert_allclose(gradient(warp)[0], np.diag([2.0, 0.5]))
    np.testing.assert_allclose(in_material(np.eye(2)[None], warp)[0], np.diag([0.25, 4.0]))


@pytest.mark.parametrize(("stretch", "share"), [(1.3, 0.0), (1.0, 0.0), (0.8, 0.25), (0.5, 1.0), (0.3, 1.0)])
def test_a_residual_counts_more_along_a_flattening_only(stretch: float, share: float) -> None:
    F = np.diag([1.4, stretch])[None]
    found = enlarged(np.eye(2)[None], F, np.array([3.0]))[0]
    across, along = (0.5 + share * (most - 0.5) for most in (1.0, 6.0))
    np.testing.assert_allclose(found, np.diag([(1 + 3 * across) / 4, (1 + 3 * along) / 4]), atol=1e-12)


def test_the_table_marks_what_is_out_of_bounds() -> None:
    def row(quantity: str, squares: float) -> dic_sigmas.Scatter:
        return dic_sigmas.Scatter(0, "plane, shift", 1.0, quantity, "rest", 4, squares, 0)

    text = dic_sigmas.table([row("x", 4.0), row("x", 4.0), row("y", 9.0)]).splitlines()[2]
    assert text.startswith("| plane, shift | 1 | 1.00 | **1.50** |")


@pytest.mark.slow
@pytest.mark.parametrize("number", [0, 3, 6, 11])
def test_drawn_scenes_scatter_by_what_is_stated(number: int) -> None:
    """One scene is a single draw of lens and pattern: wider than what a population is held to."""
    for s in dic_sigmas.scattered("chosen", number):
        assert 0.65 < (s.squares / s.count) ** 0.5 < 1.35, s
