"""Calibration targets in rendered pictures: numbering, centres and sigma against OpenCV's projection."""

import cv2
import numpy as np
import pytest
from boards import LENS, MATRIX, averaged, cylinder, dots, flat, pixels, pose

from dic import Camera
from dic.calibration import targets
from dic.calibration.bundle import View, centroids, project_points
from dic.calibration.dots import noise_level
from dic.calibration.views import detect

HOLLOW = ((2, 2), (7, 2), (2, 5))
GRID = targets.FiducialDots(columns=10, rows=8, pitch=1.2e-3, diameter=0.6e-3, hollow=HOLLOW, hole=0.28e-3)
PAINT = dots(10, 8, 1.2e-3, 0.6e-3, HOLLOW, 0.28e-3)
MIDDLE = (5.4e-3, 4.2e-3)


def off(target, found, R, t) -> np.ndarray:
    """Detected less projected points [px]."""
    return found.pixels - pixels(target.geometry().points[found.ids], R, t)


@pytest.mark.parametrize("roll", [0.4, *(pytest.param(r, marks=pytest.mark.slow) for r in (1.3, 2.6, -1.9))])
def test_fiducial_dots_are_numbered_and_located_at_any_roll(roll):
    R, t = pose((0.25, 0.3, 0.0), MIDDLE, 0.095)
    R = cv2.Rodrigues(np.array([0.0, 0.0, roll]))[0] @ R
    t = np.array([0.0, 0.0, 0.095]) - R @ [*MIDDLE, 0.0]
    found = detect(averaged(flat(PAINT, R, t), noise=1.0), GRID)
    assert len(found.ids) == 80
    # 4 x 4 rays a pixel place an edge to 0.25 px, its mean round a dot of 9 px to some mpx; noise adds 3 mpx.
    assert np.sqrt(np.mean(off(GRID, found, R, t) ** 2)) < 0.012


def test_white_dots_on_black_are_the_same_target():
    R, t = pose((0.2, -0.3, 0.1), MIDDLE, 0.095)
    picture = averaged(1.0 - flat(PAINT, R, t), noise=1.0)
    white = targets.FiducialDots(columns=10, rows=8, pitch=1.2e-3, diameter=0.6e-3, hollow=HOLLOW, dark=False)
    found = detect(picture, white)
    assert len(found.ids) == 80
    assert np.sqrt(np.mean(off(GRID, found, R, t) ** 2)) < 0.015  # as above, with edges less sharp in B


def test_a_board_partly_in_view_and_larger_than_described_gives_the_dots_it_should():
    R, t = pose((0.1, -0.2, 0.1), (11.5e-3, 4.2e-3), 0.095)
    larger = dots(12, 9, 1.2e-3, 0.6e-3, HOLLOW, 0.28e-3)
    found = detect(averaged(flat(larger, R, t), noise=1.0), GRID)
    there = pixels(GRID.geometry().points, R, t)
    inside = np.all((there > 7) & (there < [312, 232]), axis=1)  # a dot's radius and the blur from the edge
    assert 20 < inside.sum() < 80
    assert set(np.flatnonzero(inside)) <= set(found.ids.tolist())
    assert np.abs(off(GRID, found, R, t)).max() < 0.1  # no dot has another one's number


@pytest.mark.slow
def test_uneven_light_does_not_move_dots():
    R, t = pose((0.0, 0.0, 0.0), MIDDLE, 0.095)
    light = np.linspace(0.4, 1.0, 240)[:, None] * np.linspace(1.0, 0.6, 320)
    picture = np.round(averaged(flat(PAINT, R, t)) * light).astype(np.uint8)
    found = detect(picture, GRID)
    assert len(found.ids) == 80
    assert np.all(np.abs(np.mean(off(GRID, found, R, t), axis=0)) < 0.003)  # mean over 80 of 0.012 px


@pytest.mark.slow
def test_the_sigma_of_a_dot_is_its_scatter():
    R, t = pose((0.2, 0.2, 0.1), MIDDLE, 0.095)
    bright = flat(PAINT, R, t)
    runs = [detect(averaged(bright, noise=3.0, seed=k), GRID) for k in range(6)]
    scatter = np.std([run.pixels for run in runs], axis=0, ddof=1)
    ratio = np.sqrt(np.mean(scatter**2 / np.mean([run.sigma for run in runs], axis=0)[:, None] ** 2))
    # 6 x 160 numbers settle the ratio to 3 %; the noise is estimated from the picture to some per cent.
    assert 0.85 < ratio < 1.15


def test_the_noise_of_a_picture_is_found_under_its_dots():
    R, t = pose((0.2, 0.2, 0.1), MIDDLE, 0.095)
    picture = averaged(flat(PAINT, R, t), noise=3.0)
    # rounding adds 1/12 in square; edges of dots leak into the median
    assert noise_level(picture) == pytest.approx(3.0, rel=0.1)


@pytest.mark.parametrize(
    ("shape", "spread"), [("disc", 1 / 4), ("ring", (1 + 0.5**2) / 4), ("square", 1 / 3)]
)
def test_centroids_of_patches_against_their_outlines(shape, spread):
    """Eq. (CC.1) against the centroid of the projected outline, for a patch a tenth as wide as it is deep."""
    R, _ = cv2.Rodrigues(np.array([0.7, -0.5, 0.2]))
    X, r = np.array([0.02, -0.03, 0.2]), 0.01
    s = np.linspace(0.0, 1.0, 4001)[:-1]
    circle = np.stack([np.cos(2 * np.pi * s), np.sin(2 * np.pi * s)], axis=1)
    side = 8.0 * (s % 0.25) - 1.0
    turn = [np.linalg.matrix_power(np.array([[0, -1], [1, 0]]), int(4 * x)) for x in s]
    square = np.stack([M @ [1.0, y] for M, y in zip(turn, side, strict=True)])
    parts = {"disc": [(1, circle)], "ring": [(1, circle), (-1, 0.5 * circle)], "square": [(1, square)]}[shape]
    area, moment = 0.0, np.zeros(2)
    for sign, outline in parts:
        Y = X + r * outline @ R[:, :2].T
        p = Y[:, :2] / Y[:, 2:]
        q = np.roll(p, -1, axis=0)
        cross = p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]
        area += sign * 0.5 * cross.sum()
        moment += sign * ((p + q) * cross[:, None]).sum(axis=0) / 6.0
    expected = moment / area
    found = centroids(X[None], R[:, 2][None], np.array([spread * r * r]))[0]
    ideal = X[:2] / X[2]
    shift = np.hypot(*(expected - ideal))
    assert shift > 5e-4  # the test would see nothing otherwise
    # exact for a disc (the polygon has 4000 sides); for the others to the next order, (r/z)² = 2.5e-3
    assert np.hypot(*(found - expected)) < (1e-5 if shape == "disc" else 6e-3) * shift


def squares(X):
    """A board of 10 x 7 squares of 1.2 mm."""
    place = np.floor(X / 1.2e-3).astype(int) + 1
    board = np.all((X > -1.8e-3) & (X < [11.4e-3, 7.8e-3]), axis=1)
    printed = np.all((place >= 0) & (place < [10, 7]), axis=1)
    return board * np.where(printed & (place.sum(axis=1) % 2 == 0), 0.0, 1.0)


def test_a_chessboard_is_located():
    board = targets.Chessboard(columns=9, rows=6, pitch=1.2e-3)
    R, t = pose((0.2, 0.3, 0.3), (4.8e-3, 3.0e-3), 0.1)
    found = detect(averaged(flat(squares, R, t), noise=1.0), board)
    there = pixels(board.geometry().points, R, t)
    errors = [found.pixels - there[numbers] for numbers in board.geometry().equivalents]
    assert min(np.sqrt(np.mean(e**2)) for e in errors) < 0.03  # rays place an edge to 0.25 px, see above


def test_a_board_of_which_squares_were_counted_says_its_inner_corners():
    R, t = pose((0.2, 0.3, 0.3), (4.8e-3, 3.0e-3), 0.1)
    picture = averaged(flat(squares, R, t), noise=1.0)
    with pytest.raises(
        targets.TargetNotFound, match=r"10 x 7 inner corners, but one of 9 x 6: .* squares minus one"
    ):
        detect(picture, targets.Chessboard(columns=10, rows=7, pitch=1.2e-3))


def test_a_charuco_board_is_numbered_by_its_markers():
    board = targets.Charuco(columns=7, rows=5, pitch=4e-3, marker=3e-3, dictionary="DICT_4X4_50")
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    printed = cv2.aruco.CharucoBoard((7, 5), 4e-3, 3e-3, dictionary).generateImage((1400, 1000))
    H = np.array([[0.5, 0.08, 60.0], [-0.06, 0.55, 90.0], [4e-5, 8e-5, 1.0]])
    finer = np.array([[4.0, 0.0, 1.5], [0.0, 4.0, 1.5], [0.0, 0.0, 1.0]])  # 4 x 4 samples a pixel
    large = cv2.warpPerspective(printed, finer @ H, (3600, 2800), borderValue=255)
    small = cv2.resize(large, (900, 700), interpolation=cv2.INTER_AREA)
    picture = cv2.GaussianBlur(small, (0, 0), 1.0)[:, :560]  # a part of it is out of view
    found = detect(picture, board)
    assert 8 <= len(found.ids) < 24
    # a square is 200 px of the print, whose pixel centres are half a pixel off its edges
    ideal = (
        np.concatenate([board.geometry().points[:, :2] / 4e-3 * 200.0 - 0.5, np.ones((24, 1))], axis=1) @ H.T
    )
    error = found.pixels - (ideal[:, :2] / ideal[:, 2:])[found.ids]
    assert np.sqrt(np.mean(error**2)) < 0.03  # samples place an edge to 0.25 px, a corner by 60 of them


def test_an_asymmetric_grid_is_numbered():
    grid = targets.AsymmetricDots(columns=4, rows=7, step=1.1e-3, diameter=0.8e-3)
    R, t = pose((0.2, -0.2, 0.1), (3.8e-3, 3.3e-3), 0.1)
    centres = grid.geometry().points[:, :2]

    def paint(X):
        dark = np.zeros(len(X), dtype=bool)
        for centre in centres:
            dark |= np.hypot(*(X - centre).T) < 0.4e-3
        return np.where(dark, 0.0, 1.0)

    found = detect(averaged(flat(paint, R, t), noise=1.0), grid)
    assert np.sqrt(np.mean(off(grid, found, R, t) ** 2)) < 0.012  # as for the symmetric grid


def outline_centroid(p: np.ndarray) -> np.ndarray:
    """Centroid of a polygon [px]."""
    q = np.roll(p, -1, axis=0)
    cross = p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]
    return ((p + q) * cross[:, None]).sum(axis=0) / (3.0 * cross.sum())


def patch(column: int, row: int, a: float) -> np.ndarray:
    """Outline of a square dot on the cylinder of the test below, shape [400, 3]."""
    s = np.linspace(-0.5, 0.5, 101)[:-1] * a
    half = np.full(100, 0.5 * a)
    around = np.concatenate([s, half, -s, -half]) + 2.2e-3 * column
    along = np.concatenate([-half, s, half, -s]) + 2.2e-3 * row
    return np.stack([8e-3 * np.cos(around / 8e-3), 8e-3 * np.sin(around / 8e-3), along], axis=1)


def test_a_dotted_cylinder_is_numbered_from_three_anchors():
    a = 0.9e-3
    body = targets.DottedCylinder(
        columns=12, rows=7, radius=8e-3, pitch=2.2e-3, arc=2.2e-3, size=a, square=True
    )

    def paint(X):
        place = X / [2.2e-3 / 8e-3, 2.2e-3]
        nearest = np.round(place)
        on = np.all((nearest >= 0) & (nearest < [12, 7]), axis=1)
        return np.where(on & np.all(np.abs((place - nearest) * 2.2e-3) < 0.5 * a, axis=1), 0.0, 1.0)

    # Upright, seen against column 5: x of the camera along increasing angle, its y against the rows.
    phi = 5 * 2.2e-3 / 8e-3
    R = np.array([[-np.sin(phi), np.cos(phi), 0.0], [0.0, 0.0, -1.0], [-np.cos(phi), -np.sin(phi), 0.0]])
    R = cv2.Rodrigues(np.array([0.1, 0.05, 0.02]))[0] @ R
    t = np.array([0.0, 0.0, 0.1]) - R @ [0.0, 0.0, 6.6e-3]
    picture = averaged(cylinder(paint, 8e-3, R, t), noise=1.0)
    there = pixels(body.geometry().points, R, t)
    anchors = tuple((c, r, *np.round(there[r * 12 + c] + [3, -3])) for c, r in ((5, 3), (6, 3), (5, 4)))
    found = detect(picture, targets.DottedCylinder(**{**vars(body), "anchors": anchors}))
    assert len(set(found.ids % 12)) >= 5
    # The centroid of each patch's outline as OpenCV projects it, curved as it is; rays and noise as above.
    expected = np.array([outline_centroid(pixels(patch(n % 12, n // 12, a), R, t)) for n in found.ids])
    assert np.abs(found.pixels - there[found.ids]).max() > 0.1  # what the curvature does is to be seen
    assert np.sqrt(np.mean((found.pixels - expected) ** 2)) < 0.03  # straight edges in line with the rays
    g, ids = body.geometry(), found.ids
    camera = Camera(
        fx=MATRIX[0, 0], fy=MATRIX[1, 1], cx=MATRIX[0, 2], cy=MATRIX[1, 2], distortion=tuple(LENS)
    )
    n = len(ids)
    sight = View(
        0, 0, ids, g.points[ids], g.normals[ids], g.spread[ids], g.bend[ids], found.pixels, np.ones(n)
    )
    # Eq. (CC.2) keeps the first order in patch size over radius, 0.11 here; 10 % of shifts of 0.2 px remain
    np.testing.assert_allclose(project_points(camera, sight, R, t), expected, atol=0.02)
    with pytest.raises(targets.TargetNotFound, match="no dot at the anchor"):
        detect(picture, targets.DottedCylinder(**{**vars(body), "anchors": ((5, 3, 5.0, 5.0), *anchors[1:])}))
    with pytest.raises(targets.TargetNotFound, match="anchors"):
        detect(picture, body)


def test_pictures_without_the_target_say_so():
    rng = np.random.default_rng(3)
    R, t = pose((0.1, 0.1, 0.0), MIDDLE, 0.095)
    two = averaged(flat(dots(10, 8, 1.2e-3, 0.6e-3, HOLLOW[:2], 0.28e-3), R, t))
    for picture in (np.zeros((200, 300), np.uint8), rng.integers(0, 255, (200, 300)).astype(np.uint8), two):
        with pytest.raises(targets.TargetNotFound, match="hollow"):
            detect(picture, GRID)
    plain = two.astype(np.uint16) * 16
    for target, said in (
        (targets.Chessboard(columns=9, rows=6, pitch=1e-3), "no chessboard"),
        (targets.Charuco(columns=7, rows=5, pitch=4e-3, marker=3e-3), "ChArUco"),
        (targets.AsymmetricDots(columns=4, rows=11, step=1e-3, diameter=0.8e-3), "asymmetric"),
    ):
        with pytest.raises(targets.TargetNotFound, match=said):
            detect(plain, target)
    with pytest.raises(ValueError, match="must be grey"):
        detect(np.zeros((10, 10, 3)), GRID)


@pytest.mark.parametrize(
    ("kind", "options", "said"),
    [
        ("fiducial_dots", {"diameter": 2e-3}, "below the pitch"),
        ("fiducial_dots", {"hollow": ((2, 2), (7, 2), (2, 7))}, "arms of the L must differ"),
        ("fiducial_dots", {"hollow": ((2, 2), (7, 3), (2, 5))}, "must form an L"),
        ("fiducial_dots", {"hollow": ((2, 2), (12, 2), (2, 5))}, "columns 0 to 9"),
        ("fiducial_dots", {"hole": 1e-3}, "hole"),
        ("chessboard", {"columns": 2, "rows": 6, "pitch": 1e-3}, "from 3 to 1000"),
        ("chessboard", {"columns": 9, "rows": 6, "pitch": float("nan")}, "positive length"),
        ("charuco", {"columns": 7, "rows": 5, "pitch": 1e-3, "marker": 2e-3}, "below the square"),
        (
            "charuco",
            {"columns": 7, "rows": 5, "pitch": 2e-3, "marker": 1e-3, "dictionary": "__doc__"},
            "DICT_",
        ),
        (
            "charuco",
            {"columns": 20, "rows": 20, "pitch": 2e-3, "marker": 1e-3, "dictionary": "DICT_4X4_50"},
            "50 markers",
        ),
        ("asymmetric_dots", {"columns": 4, "rows": 11, "step": 1e-3, "diameter": 2e-3}, "below"),
        ("dotted_cylinder", {"arc": 20e-3}, "do not fit"),
        ("dotted_cylinder", {"anchors": ((1, 1, 0.0, 0.0), (2, 2, 1.0, 1.0), (3, 3, 2.0, 2.0))}, "on a line"),
        ("dotted_cylinder", {"anchors": ((1, 99, 0.0, 0.0),)}, "rows 0 to 6"),
    ],
)
def test_impossible_targets_are_refused(kind, options, said):
    base = {
        "fiducial_dots": {k: getattr(GRID, k) for k in ("columns", "rows", "pitch", "diameter", "hollow")},
        "dotted_cylinder": {
            "columns": 12, "rows": 7, "radius": 8e-3, "pitch": 2e-3, "arc": 2e-3, "size": 1e-3,
        },
    }.get(kind, {})  # fmt: skip
    with pytest.raises(ValueError, match=said):
        targets.TARGETS[kind](**(base | options))


def test_the_renderer_and_opencv_agree_on_the_lens():
    """A ray through a pixel, projected again, hits that pixel: else the renderer were no second opinion."""
    from boards import FINE, SHAPE, rays

    d = rays().reshape(SHAPE[0], FINE, SHAPE[1], FINE, 3)[7, 2, 300, 1]
    back = cv2.projectPoints(d[None], np.zeros(3), np.zeros(3), MATRIX, LENS)[0].ravel()
    # ray (column 1, row 2) of 4 x 4 in pixel (300, 7); directions are linear between pixel centres
    np.testing.assert_allclose(back, [300.0 - 0.125, 7.0 + 0.125], atol=1e-5)
