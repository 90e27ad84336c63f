"""Synthetic pictures, compared with closed forms, an independent ray cast, and two correlations."""

from functools import cache
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from matplotlib.figure import Figure
from numpy.typing import NDArray

from dic.camera import Camera
from dic.correlation import Correlation, PictureStack, Shape, correlate
from dic.synthetic.paint import Area, Texture, painted, sprayed_drops, waves
from dic.synthetic.render import board_series, picture_series
from dic.synthetic.scene import Instants, Lamp, Lens, RevolvedBody, Scene, closed

FloatArray = NDArray[np.float64]

FIGURE_SIZE = (6.7, 2.7)

PIXEL = 56e-6  # length that a pixel shows [m]
DISTANCE = 0.3
SHAPE = (96, 96)  # rows and columns of a picture [px]
LENS = Lens(spread=0.6, rays=4)
SHIFTS = np.linspace(0.0, 1.0, 11)  # of the board, along x [px]
WINDOW = 21  # side of the windows whose bias is judged on the surface [px]
DENSE = 16  # rays of a pixel along each axis of the independent ray cast
ALLOWED = 0.002  # bias that the laboratory promises [px]


Result = SimpleNamespace


def ahead(distortion: tuple[float, ...] = (0.0,) * 5, side: float = 0.0) -> Camera:
    """A camera at `DISTANCE` that looks at the origin from an angle `side` [rad] beside z."""
    c, s = np.cos(side), np.sin(side)
    rotation = np.array([[c, 0.0, -s], [0.0, -1.0, 0.0], [-s, 0.0, -c]])
    centre = DISTANCE * np.array([s, 0.0, c])
    middle = 0.5 * (SHAPE[1] - 1)
    return Camera(
        fx=DISTANCE / PIXEL, fy=DISTANCE / PIXEL, cx=middle, cy=middle,
        distortion=distortion,  # type: ignore[arg-type]  # five numbers
        rotation=rotation, translation=-rotation @ centre,
    )  # fmt: skip


def board(texture: Texture) -> RevolvedBody:
    """A flat board with a paint."""
    nodes = np.array([[0.0, 1.0]])
    return RevolvedBody(y=nodes, r=nodes, along=nodes[0], radius=1.0, texture=texture)


def shifted(texture: Texture) -> FloatArray:
    """Pictures of a board that moves along the picture's x by `SHIFTS`, shape [n, rows, columns]."""
    turn = np.diag([1.0, -1.0, -1.0])  # board x to the right, y down
    poses = [(turn, np.array([shift * PIXEL, 0.0, 0.0])) for shift in SHIFTS]
    return np.concatenate(
        list(board_series(board(texture), poses, ahead(), SHAPE, lens=LENS, background=0.5))
    ).astype(np.float64)


def bias(found: FloatArray, true: FloatArray, slope: tuple[FloatArray, FloatArray]) -> FloatArray:
    """Least-squares displacement (x, y) by which `found` lies beside `true` [px], whose slopes are given."""
    J = np.stack([part.ravel() for part in slope], axis=1)
    return np.asarray(-np.linalg.lstsq(J, (found - true).ravel(), rcond=None)[0])


def cosines() -> tuple[FloatArray, float]:
    """Bias and error of grey values of waves on a board, with periods of 4 to 14 px."""
    rng = np.random.default_rng(5)
    periods, angles = rng.uniform(4.0, 14.0, 12), rng.uniform(0.0, np.pi, 12)
    vectors = np.stack([np.cos(angles), np.sin(angles)], axis=1) / periods[:, None] / PIXEL
    phases = rng.uniform(0.0, 2.0 * np.pi, 12)
    reach = 60.0 * PIXEL
    pitch, height = PIXEL / 8.0, 0.03
    texture = waves(
        Area((-reach, reach), (-reach, reach)), pitch, vectors=vectors, phases=phases, level=0.5,
        height=height,
    )  # fmt: skip
    pictures = shifted(texture)
    row, column = np.mgrid[: SHAPE[0], : SHAPE[1]] - 0.5 * (SHAPE[0] - 1)
    found, worst = [], 0.0
    for picture, shift in zip(pictures, SHIFTS, strict=True):
        true, along_x, along_y = np.full(SHAPE, 0.5), np.zeros(SHAPE), np.zeros(SHAPE)
        for (kx, ky), phase in zip(vectors * PIXEL, phases, strict=True):
            # a cosine through box, Gaussian and the texels' linear interpolation keeps its phase
            kept = np.sinc(kx) * np.sinc(ky) * np.exp(-2.0 * (np.pi * LENS.spread) ** 2 * (kx**2 + ky**2))
            kept *= (np.sinc(kx * pitch / PIXEL) * np.sinc(ky * pitch / PIXEL)) ** 2
            angle = 2.0 * np.pi * (kx * (column - shift) + ky * row) + phase
            true += height * kept * np.cos(angle)
            along_x -= height * kept * 2.0 * np.pi * kx * np.sin(angle)
            along_y -= height * kept * 2.0 * np.pi * ky * np.sin(angle)
        found.append(bias(picture, true, (along_x, along_y)))
        worst = max(worst, float(np.abs(picture - true).max() / true.std()))
    return np.array(found), worst


def speckles(area: Area, pitch: float, size: float = 6.0) -> Texture:
    """Sprayed drops."""
    rng = np.random.default_rng(2)
    centres, diameters = sprayed_drops(area, size=size * PIXEL, spread=0.25, coverage=0.5, rng=rng)
    return painted(area, pitch, centres, diameters)


def barrel() -> tuple[FloatArray, FloatArray]:
    """Height and radius of the side surface of a compressed specimen, 41 nodes, waisted at its ends."""
    t = np.linspace(0.0, 1.0, 41)
    return 4.2e-3 * (t - 0.5) + 2e-4 * np.sin(2.0 * np.pi * t), 4.9e-3 + 1.3e-3 * np.sin(np.pi * t) ** 0.7


def cast(camera: Camera, texture: Texture, along: FloatArray, radius: float) -> FloatArray:
    """The picture by an independent ray cast, the box of the pixels alone: bisection along each ray.

    The place between the camera and the ray's nearest place to the axis where its distance from the axis
    falls below that of the surface at its height.
    """
    y, r = barrel()
    part = (np.arange(DENSE) + 0.5) / DENSE - 0.5
    picture = np.zeros(SHAPE)
    column = (np.arange(SHAPE[1])[:, None] + part).ravel()
    for down in part:
        pixels = np.stack(np.meshgrid(column, np.arange(SHAPE[0]) + down), axis=-1)
        ideal = camera.undistort(pixels)
        d = np.concatenate([ideal, np.ones((*ideal.shape[:-1], 1))], axis=-1) @ camera.rotation
        o = camera.centre
        high = -(o[0] * d[..., 0] + o[2] * d[..., 2]) / (d[..., 0] ** 2 + d[..., 2] ** 2)
        low = high - 8e-3
        for _ in range(45):
            s = 0.5 * (low + high)
            X = o + s[..., None] * d
            outside = np.hypot(X[..., 0], X[..., 2]) > np.interp(X[..., 1], y, r)
            low, high = np.where(outside, s, low), np.where(outside, high, s)
        X = o + high[..., None] * d
        grey = texture.at(radius * np.arctan2(X[..., 0], X[..., 2]), np.interp(X[..., 1], y, along))
        picture += grey.reshape(SHAPE[0], SHAPE[1], DENSE).mean(axis=2)
    return picture / DENSE


def on_surface() -> tuple[FloatArray, float]:
    """Bias of windows of a barrelled surface under a distorting, oblique camera without lens blur."""
    radius, length = 4.75e-3, 6.5e-3
    area = Area((-1.8 * radius, 1.8 * radius), (0.0, length))
    texture = speckles(area, PIXEL / 4.0)
    camera = ahead((-0.17, 0.05, 1e-3, -5e-4, 0.0), side=0.11)
    y, r = barrel()
    along = np.linspace(0.0, length, len(y))
    nodes = closed(y[None], r[None], along)
    body = RevolvedBody(y=nodes[0], r=nodes[1], along=nodes[2], radius=radius, texture=texture)
    still = Instants(np.array([0, 1]), np.zeros(1), np.ones(1))
    scene = Scene(still, (body,), lamp=Lamp(ambient=1.0))
    inside = slice(14, SHAPE[0] - 14)  # rows where the surface is; its ends lie beside them
    found = next(iter(picture_series(scene, camera, SHAPE, lens=Lens(spread=0.0, rays=4))))[0].astype(float)
    true = cast(camera, texture, along, radius)
    along_y, along_x = np.gradient(true)
    biases = []
    for top in range(inside.start, inside.stop - WINDOW, 5):
        for left in range(2, SHAPE[1] - WINDOW - 2, 5):
            w = (slice(top, top + WINDOW), slice(left, left + WINDOW))
            biases.append(bias(found[w], true[w], (along_x[w], along_y[w])))
    return np.array(biases), float((found - true)[inside].std() / true[inside].std())


def by_correlation() -> tuple[FloatArray, FloatArray]:
    """Shifts of a speckled board found by subset matching and by OpenCV's ECC, less the true ones."""
    reach = 60.0 * PIXEL
    pictures = shifted(speckles(Area((-reach, reach), (-reach, reach)), PIXEL / 4.0)) * 200.0
    x, y = np.meshgrid(np.arange(20.0, 76.0, 8.0), np.arange(20.0, 76.0, 8.0))
    points = np.stack([x.ravel(), y.ravel()], axis=-1)
    settings = Correlation(subset=21, shape=Shape.AFFINE)
    first = PictureStack.prepare(pictures[0], noise=0.1)
    own, peer = [], []
    for shift, picture in zip(SHIFTS, pictures, strict=True):
        guess = np.zeros((len(points), 12))
        guess[:, 0] = round(shift)
        found = correlate(first, PictureStack.prepare(picture, noise=0.1), points, guess, settings)
        own.append(float(np.mean(found.warp[:, 0])) - shift)
        start = np.eye(2, 3, dtype=np.float32)
        start[0, 2] = round(shift)
        a, b = (p[8:-8, 8:-8].astype(np.float32) for p in (pictures[0], picture))
        ends = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 200, 1e-9)
        warp = cv2.findTransformECC(a, b, start, cv2.MOTION_TRANSLATION, ends, None, 1)[1]
        peer.append(float(warp[0, 2]) - shift)
    return np.array(own), np.array(peer)


@cache
def case() -> Result:
    """Run everything."""
    biases, grey = cosines()
    surface, surface_grey = on_surface()
    own, peer = by_correlation()
    return Result(
        waves=biases,  # bias along x and y of cosines on a board against closed form, shape [n_shifts, 2]
        grey=grey,  # largest error of a grey value there, over the pattern's standard deviation [-]
        # Bias along x and y of windows on a barrelled surface against the independent ray cast, shape [n, 2].
        surface=surface,
        # standard deviation of the grey values' difference there, over the pattern's [-]
        surface_grey=surface_grey,
        subsets=own,  # Shift found by subset matching less the true one, mean over subsets, shape [n_shifts].
        peer=peer,  # the same by OpenCV's ECC over the whole picture, shape [n_shifts]
    )


def draw(result: Result, figure: Figure) -> None:
    """Draw the figure of the page."""
    left, middle, right = figure.subplots(1, 3)
    for axes in (left, right):
        axes.axhspan(-1e3 * ALLOWED, 1e3 * ALLOWED, color="0.9", zorder=0)
        axes.set_xlabel("shift, px")
    left.plot(SHIFTS, 1e3 * result.waves[:, 0], "o-", label="along the shift")
    left.plot(SHIFTS, 1e3 * result.waves[:, 1], "s--", label="across it")
    left.set_ylabel("bias, mpx")
    left.set_ylim(-2.5, 2.5)
    left.legend()
    edges = np.linspace(-2.5, 2.5, 26)
    middle.axvspan(-1e3 * ALLOWED, 1e3 * ALLOWED, color="0.9", zorder=0)
    for k, (name, style) in enumerate((("x", "-"), ("y", "--"))):
        middle.hist(
            1e3 * result.surface[:, k], edges, histtype="step", linestyle=style, label=f"along {name}"
        )
    middle.set_xlabel("bias of a window, mpx")
    middle.set_ylabel("windows")
    middle.legend()
    right.plot(SHIFTS, 1e3 * result.subsets, "o-", label="subsets")
    right.plot(SHIFTS, 1e3 * result.peer, "s--", label="OpenCV's ECC")
    right.set_ylabel("found less true shift, mpx")
    right.legend()


def shown(result: Result) -> dict[str, object]:
    """What the page and the index show beside the fields of the result."""
    mpx = 1e3
    surface = result.surface
    return locals()


pytestmark = pytest.mark.slow  # 12 s


def test_waves_on_a_board_are_their_integral_over_the_pixels() -> None:
    result = case()
    assert np.abs(result.waves).max() < ALLOWED
    assert result.grey < 0.01  # 4 rays a pixel


def test_a_surface_is_where_an_independent_ray_cast_has_it() -> None:
    result = case()
    assert len(result.surface) > 100
    assert np.abs(result.surface).max() < ALLOWED
    assert np.abs(result.surface.mean(axis=0)).max() < ALLOWED / 10.0


def test_two_correlations_find_the_shift() -> None:
    result = case()
    assert np.abs(result.subsets).max() < ALLOWED
    # linear interpolation: right at whole pixels, symmetric between them, up to 0.02 px off at quarters
    assert np.abs(result.peer[[0, 5, 10]]).max() < ALLOWED
    assert np.abs(result.peer).max() < 0.02
