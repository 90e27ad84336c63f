"""The renderer against closed forms: projection, integral over pixels, lens, defocus, motion, occlusion."""

import numpy as np
import pytest
from speckle_pictures import SpecklePattern, render, speckle_pattern

from dic.camera import Camera
from dic.synthetic.paint import Area, Texture
from dic.synthetic.render import board_series, picture_series
from dic.synthetic.scene import (
    Instants,
    Lamp,
    Lens,
    RevolvedBody,
    Scene,
    closed,
    cylinder,
    exposures,
    haze,
    reach_of,
    weight_table,
    weights,
)

PIXEL, DISTANCE, N = 50e-6, 0.3, 48
FLAT = Lamp(ambient=1.0)
STILL = Instants(np.array([0, 1]), np.zeros(1), np.ones(1))


def camera(distortion=(0.0,) * 5, side=0.0):
    """A camera that looks at the origin from `side` [rad] beside z, x to the right, y down."""
    c, s = np.cos(side), np.sin(side)
    R = np.array([[c, 0.0, -s], [0.0, -1.0, 0.0], [-s, 0.0, -c]])
    f, middle = DISTANCE / PIXEL, 0.5 * (N - 1)
    return Camera(
        fx=f, fy=f, cx=middle, cy=middle, distortion=distortion, rotation=R,
        translation=-R @ (DISTANCE * np.array([s, 0.0, c])),
    )  # fmt: skip


def spot(area, pitch, places, radius):
    """Black with bright Gaussian spots."""
    u, v = area.grid(pitch)
    grey = np.zeros((len(v), len(u)))
    for x, y in places:
        grey += np.exp(-((u - x) ** 2 + (v[:, None] - y) ** 2) / (2.0 * radius**2))
    return Texture(grey.astype(np.float32), pitch, (float(u[0]), float(v[0])))


def centroid(picture, around, half=7):
    """Centre of the light near a place (x, y) [px]."""
    x, y = np.rint(around).astype(int)
    part = picture[y - half : y + half + 1, x - half : x + half + 1].astype(float)
    rows, columns = np.mgrid[-half : half + 1, -half : half + 1]
    return np.array([x + (columns * part).sum() / part.sum(), y + (rows * part).sum() / part.sum()])


def picture(body, seen_by, instants=STILL, **options):
    scene = Scene(instants, (body,) if isinstance(body, RevolvedBody) else body, lamp=FLAT, background=0.0)
    return np.concatenate(list(picture_series(scene, seen_by, (N, N), **options)))


def test_spots_lie_where_the_camera_projects_them():
    """On a cone whose node heights and material places differ, through a lens with all five coefficients."""
    lens = (-0.2, 0.1, 2e-3, -1e-3, 0.5)
    seen_by = camera(lens, side=0.03)
    radius, places = 5e-3, [(-0.35e-3, 0.9e-3), (0.35e-3, 1.8e-3), (0.0, 3.1e-3)]
    texture = spot(Area((-8e-3, 8e-3), (0.0, 4e-3)), PIXEL / 4, places, 1.2 * PIXEL)
    along = np.array([0.0, 1e-3, 4e-3])
    y, r = np.array([[-0.9e-3, -0.4e-3, 0.8e-3]]), np.array([[5.2e-3, 5.4e-3, 4.6e-3]])
    y, r, nodes = closed(y, r, along)
    found = picture(RevolvedBody(y=y, r=r, along=nodes, radius=radius, texture=texture), seen_by)[0]
    for around, material in places:
        at_y = np.interp(material, along, y[0, 1:-1])
        at_r = np.interp(material, along, r[0, 1:-1])
        angle = around / radius
        true = seen_by.project(np.array([at_r * np.sin(angle), at_y, at_r * np.cos(angle)]))
        # the spot's own shear over its width moves its centre by 0.01 px here
        assert np.abs(centroid(found, true) - true).max() < 0.03


def test_a_ray_finds_the_nearest_body_and_the_far_half():
    """A flyer of larger radius hides the specimen above its rim; below it the face is seen from beneath."""
    white, grey = (Texture(np.full((2, 2), v, dtype=np.float32), 1.0, (-0.5, -0.5)) for v in (1.0, 0.5))
    y, r, along = closed(np.array([[-2e-3, 1e-3]]), np.array([[3e-3, 3e-3]]), np.array([0.0, 3e-3]))
    specimen = RevolvedBody(y=y, r=r, along=along, radius=3e-3, texture=grey)
    flyer = cylinder(6e-3, 5e-3, white, place=np.array([[0.0, 0.5e-3, 0.0]]))
    found = picture((specimen, flyer), camera())[0]
    assert np.array_equal(found, picture((flyer, specimen), camera())[0])
    middle = N // 2
    rim = camera().project(np.array([0.0, 0.5e-3, 6e-3]))[1]
    assert found[int(rim) - 3, middle] == pytest.approx(1.0, abs=1e-5)
    assert found[int(rim) + 4, middle] == pytest.approx(0.5, abs=1e-5)


def test_a_pixel_is_the_integral_over_its_square():
    """An edge at 0.3 of a pixel leaves 0.3 of the light in it, to the width of a texel over 4 rays."""
    pitch = PIXEL / 64
    columns = 64 * 8
    u = (np.arange(columns) - columns // 2) * pitch
    grey = np.repeat((u < 0.3 * PIXEL)[None].astype(np.float32), 2, axis=0)
    texture = Texture(np.repeat(grey, 256, axis=0), pitch, (u[0], -256 * pitch))
    nodes = np.array([[0.0, 1.0]])
    body = RevolvedBody(y=nodes, r=nodes, along=nodes[0], radius=1.0, texture=texture)
    turn = np.diag([1.0, -1.0, -1.0])
    pose = [(turn, np.array([-0.5 * PIXEL, 0.0, 0.0]))]  # the edge at -0.2 px of the picture's middle 23.5
    found = next(
        iter(board_series(body, pose, camera(), (N, N), lens=Lens(spread=0.0, rays=16), background=0.0))
    )[0]
    # x = 23.3: pixel 23, from 22.5 to 23.5, is lit from its left edge to 0.8 of it
    assert found[24, 23] == pytest.approx(0.8, abs=1.0 / 16)
    assert found[24, 22] == pytest.approx(1.0, abs=1e-5)
    assert found[24, 24] == pytest.approx(0.0, abs=1e-5)


@pytest.mark.parametrize("spread", [0.5, 0.9, 1.7])
def test_the_lens_has_its_width(spread):
    """Weights of a pixel: a variance of the Gaussian's and 1/12 of the box; sum 1."""
    reach = reach_of(spread) + 2
    w = weights(spread, reach, 32)
    x = (np.arange(len(w)) + 0.5) / 32 - 0.5 - reach
    assert w.sum() == pytest.approx(1.0, rel=1e-12)
    assert (w * x).sum() == pytest.approx(0.0, abs=1e-12)
    assert (w * x**2).sum() == pytest.approx(spread**2 + 1.0 / 12.0, rel=1e-3)  # 32 rays: (1/32)²/12


def test_the_table_of_lenses_steps_evenly():
    table, step, reach = weight_table(0.5, 2.1, 4)
    assert reach == reach_of(2.1)
    assert step == pytest.approx(1.6 / (len(table) - 1))
    assert table[-1] == pytest.approx(weights(2.1, reach, 4), abs=1e-7)


def width(found):
    """Variance of the light of one spot [px²], mean of both axes."""
    rows, columns = np.mgrid[:N, :N]
    total = found.sum()
    x, y = (columns * found).sum() / total, (rows * found).sum() / total
    return float((((columns - x) ** 2 + (rows - y) ** 2) * found).sum() / total / 2.0)


def one_spot(z=0.0):
    texture = spot(Area((-1e-3, 1e-3), (-1e-3, 1e-3)), PIXEL / 8, [(0.0, 0.0)], 1.5 * PIXEL)
    nodes = np.array([[0.0, 1.0]])
    body = RevolvedBody(y=nodes, r=nodes, along=nodes[0], radius=1.0, texture=texture)
    return body, [(np.diag([1.0, -1.0, -1.0]), np.array([0.0, 0.0, z]))]


def test_spot_lens_and_defocus_add_their_variances():
    body, pose = one_spot()
    found = next(
        iter(board_series(body, pose, camera(), (N, N), lens=Lens(spread=1.1, rays=4), background=0.0))
    )[0].astype(float)
    assert width(found) == pytest.approx(1.5**2 + 1.1**2 + 1.0 / 12.0, rel=0.01)
    # Thin lens: a disc of diameter f D |1/focus - 1/z|, whose variance along an axis is d²/16.
    lens = Lens(spread=0.6, aperture=0.02, focus=0.31, rays=4)
    focal = DISTANCE / PIXEL
    disc = focal * 0.02 * abs(1.0 / 0.31 - 1.0 / 0.30)
    assert lens.disc(focal, 0.3) == pytest.approx(disc)
    assert disc > 10.0  # px: much more than the lens in focus
    body, pose = one_spot()
    found = next(iter(board_series(body, pose, camera(), (N, N), lens=lens, background=0.0)))[0].astype(float)
    assert width(found) == pytest.approx(
        1.5**2 + 0.6**2 + 1.0 / 12.0 + disc**2 / 16.0, rel=0.03
    )  # 3.9 % of 4 s


def test_motion_blur_is_a_box():
    """A flyer that moves by w during the exposure: a variance of w²/12 along its way, none across."""
    blur = 2.4  # px
    texture = spot(Area((-8e-3, 8e-3), (0.0, 4e-3)), PIXEL / 4, [(0.0, 2e-3)], 1.5 * PIXEL)
    instants = exposures(np.array([0.0]), 1e-6, 6)
    place = np.zeros((6, 3))
    place[:, 1] = -2e-3 - instants.time / 1e-6 * blur * PIXEL
    moving = cylinder(5e-3, 4e-3, texture, place=place)
    still = cylinder(5e-3, 4e-3, texture, place=np.array([[0.0, -2e-3, 0.0]]))
    found = picture(moving, camera(), instants)[0].astype(float)
    rest = picture(still, camera())[0].astype(float)
    rows, columns = np.mgrid[:N, :N]

    def variance(p, q):
        mean = (p * q).sum() / p.sum()
        return ((q - mean) ** 2 * p).sum() / p.sum()

    scale = (DISTANCE / (DISTANCE - 5e-3)) ** 2  # the flyer's side is nearer than the axis
    assert variance(found, rows) - variance(rest, rows) == pytest.approx(blur**2 / 12.0 * scale, rel=0.02)
    assert variance(found, columns) == pytest.approx(variance(rest, columns), rel=1e-3)


def test_exposures_are_gauss_points_about_the_frames():
    found = exposures(np.array([0.0, 1.0]), 0.2, np.array([1, 2]))
    assert found.begin.tolist() == [0, 1, 3]
    assert found.weight == pytest.approx([1.0, 0.5, 0.5])
    assert found.time == pytest.approx([0.0, 1.0 - 0.1 / np.sqrt(3.0), 1.0 + 0.1 / np.sqrt(3.0)])


def test_the_highlight_is_where_the_normal_halves_the_angle():
    """Lamp at an angle a beside the camera: the brightest place of a cylinder lies at a/2 around."""
    angle, radius = 0.3, 6e-3
    white = Texture(np.full((2, 2), 0.2, dtype=np.float32), 1.0, (-0.5, -0.5))
    y, r, along = closed(np.array([[-3e-3, 3e-3]]), np.array([[radius, radius]]), np.array([0.0, 6e-3]))
    body = RevolvedBody(y=y, r=r, along=along, radius=radius, texture=white, shine=1.0)
    scene = Scene(STILL, (body,), lamp=Lamp((np.sin(angle), 0.0, np.cos(angle)), 1.0, 400.0), background=0.0)
    found = next(iter(picture_series(scene, camera(), (N, N))))[0]
    brightest = np.argmax(found[N // 2])
    half = 0.5 * angle
    true = camera().project(np.array([radius * np.sin(half), 0.0, radius * np.cos(half)]))[0]
    assert abs(brightest - true) < 1.5  # the camera is near: the view turns by 0.01 rad over the surface


def test_loose_paint_is_read_where_it_came_from():
    places = [(0.0, 2e-3)]
    texture = spot(Area((-8e-3, 8e-3), (0.0, 4e-3)), PIXEL / 4, places, 1.2 * PIXEL)
    y, r, along = closed(np.array([[-2e-3, 2e-3]]), np.array([[5e-3, 5e-3]]), np.array([0.0, 4e-3]))
    slip = 0.1e-3
    fixed, loose = (
        RevolvedBody(
            y=y, r=r, along=along, radius=5e-3, texture=texture,
            patch=(0.0, 2e-3, radius), slip=np.array([[0.0, slip]]),
        )
        for radius in (0.0, 5e-3)
    )  # fmt: skip
    a, b = (picture(body, camera())[0] for body in (fixed, loose))
    middle = np.array([0.5 * (N - 1)] * 2)
    # up in the picture by the slip at the patch's middle, magnified; 0.2 % off it at the spot's own place
    moved = centroid(a, middle) - centroid(b, middle - [0.0, slip / PIXEL])
    assert moved[1] == pytest.approx(slip / PIXEL * DISTANCE / (DISTANCE - 5e-3), rel=0.02)


def test_haze_has_its_size_and_memory():
    field = haze(4000, (30, 30), size=0.4, length=15.0, memory=5.0, rng=np.random.default_rng(1))
    assert field.std() == pytest.approx(0.4, rel=0.05)
    after = (field[5:] * field[:-5]).mean() / (field**2).mean()
    assert after == pytest.approx(np.exp(-1.0), abs=0.05)


def test_haze_moves_the_picture():
    texture = spot(Area((-8e-3, 8e-3), (0.0, 4e-3)), PIXEL / 4, [(0.0, 2e-3)], 1.5 * PIXEL)
    still = cylinder(5e-3, 4e-3, texture, place=np.array([[0.0, -2e-3, 0.0]]))
    air = np.zeros((1, 9, 9, 2), dtype=np.float32)
    air[..., 0], air[..., 1] = 0.7, -0.3
    middle = np.array([0.5 * (N - 1)] * 2)
    a = centroid(picture(still, camera())[0], middle)
    b = centroid(picture(still, camera(), haze=air, haze_pitch=12.0)[0], middle)
    assert a - b == pytest.approx([0.7, -0.3], abs=0.02)


def test_folded_generators_and_threads_change_nothing():
    """A body whose nodes overlap near a platen: the outermost place is seen; threads give the same bits."""
    white = Texture(np.full((2, 2), 0.5, dtype=np.float32), 1.0, (-0.5, -0.5))
    y = np.array([[-1e-3, -1.05e-3, -0.9e-3, 1e-3]])
    r = np.array([[4e-3, 4.6e-3, 5e-3, 4e-3]])
    y, r, along = closed(y, r, np.array([0.0, 1e-3, 2e-3, 4e-3]))
    body = RevolvedBody(y=y, r=r, along=along, radius=5e-3, texture=white)
    two = Instants(np.array([0, 1, 2]), np.zeros(2), np.ones(2))
    one = picture(body, camera(), two)
    many = picture(body, camera(), two, threads=2)
    assert np.array_equal(one, many)
    inside = camera().project(np.array([0.0, -0.9e-3, 5e-3]))
    assert one[0, int(inside[1]) - 1, N // 2] == pytest.approx(0.5, abs=1e-5)  # no ray slips through


def test_a_lens_that_smears_everything_is_refused():
    body, pose = one_spot()
    with pytest.raises(ValueError, match="allowed is up to 10 px"):
        next(iter(board_series(body, pose, camera(), (N, N), lens=Lens(aperture=0.2, focus=0.5))))


def test_contrast_and_gradient_are_as_stated():
    pattern = speckle_pattern((400, 400), size=6.0, contrast=30.0, seed=1)
    picture = render(pattern, (400, 400))
    h = 1e-3
    ahead, behind = (
        render(pattern, (400, 400), material=lambda x, s=s: x + np.array([s, 0.0])) for s in (h, -h)
    )
    spread = 6.0 / (4.0 * np.sqrt(np.log(2.0)))
    # (400 / 6)² independent speckles: 2 % of a standard deviation
    assert picture.std() == pytest.approx(30.0, rel=0.06)
    assert ((ahead - behind) / (2 * h)).std() == pytest.approx(30.0 / (np.sqrt(2.0) * spread), rel=0.06)
    half = np.mean((picture[:, :-3] - picture.mean()) * (picture[:, 3:] - picture.mean())) / picture.var()
    assert half == pytest.approx(0.5, abs=0.06)  # the autocorrelation at half the size


def test_a_picture_shows_the_moved_pattern():
    pattern = SpecklePattern(np.array([[10.0, 12.0]]), np.array([50.0]), 2.0, 100.0)
    picture = render(pattern, (30, 40), material=lambda x: x - np.array([3.25, -1.5]), gain=2.0, offset=-40.0)
    y, x = np.mgrid[0:30, 0:40]
    expected = 160.0 + 100.0 * np.exp(-((x - 13.25) ** 2 + (y - 10.5) ** 2) / 8.0)
    np.testing.assert_allclose(picture, expected, atol=1e-3)  # 4e-6 of 100 beyond five spreads


def test_a_pixel_gathers_light_on_its_square():
    from scipy.special import erf

    pattern = SpecklePattern(np.array([[10.3, 9.8]]), np.array([50.0]), 1.6, 100.0)
    picture = render(pattern, (20, 22), fill=0.9)

    def mean(place, centre):  # of a Gaussian over 0.9 px
        a, b = ((place + side * 0.45 - centre) / (1.6 * np.sqrt(2.0)) for side in (-1, 1))
        return 1.6 * np.sqrt(np.pi / 2.0) * (erf(b) - erf(a)) / 0.9

    expected = 100.0 + 50.0 * mean(np.arange(20.0), 9.8)[:, None] * mean(np.arange(22.0), 10.3)
    np.testing.assert_allclose(picture, expected, atol=1e-3)  # three Gauss points: 1e-5 of 50


def test_noise_and_depth():
    pattern = SpecklePattern(np.array([[5.0, 5.0]]), np.array([400.0]), 2.0, 100.0)
    noisy = render(pattern, (200, 200), noise=3.0, seed=1)[20:]
    assert noisy.std() == pytest.approx(3.0, rel=0.02)  # 36 000 pixels: 0.4 %
    np.testing.assert_array_equal(noisy, render(pattern, (200, 200), noise=3.0, seed=1)[20:])
    bits = render(pattern, (20, 20), bits=8)
    assert bits.max() == 255.0
    np.testing.assert_array_equal(bits, np.round(bits))
