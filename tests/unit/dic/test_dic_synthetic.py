"""Paint, sensor, boards and picture files of the renderer: statistics in closed form, and reading."""

import cv2
import numpy as np
import pytest

from dic.calibration.targets import Charuco, Chessboard, FiducialDots
from dic.camera import Camera
from dic.images import open_pictures
from dic.synthetic.paint import (
    Area,
    Paint,
    Texture,
    board_texture,
    flaked,
    painted,
    plain,
    printed_dots,
    scratched,
    sprayed_drops,
    waves,
)
from dic.synthetic.render import WRITERS, Sensor, board_series
from dic.synthetic.scene import Lens, RevolvedBody

AREA = Area((0.0, 20e-3), (0.0, 15e-3))
PITCH = 2e-5


def dark_share(texture, paint):
    """Share of the area that is dark: rims count by their depth."""
    return float((paint.bright - texture.grey.mean()) / (paint.bright - paint.dark))


@pytest.mark.parametrize("coverage", [0.15, 0.5, 0.75])
def test_sprayed_drops_cover_what_was_asked(coverage):
    """Independent drops: a share exp(-n A/area) stays bare, whatever their sizes."""
    paint = Paint(0.1, 0.9, 0.1)
    rng = np.random.default_rng(4)
    centres, diameters = sprayed_drops(AREA, size=0.3e-3, spread=0.4, coverage=coverage, rng=rng)
    # some 2000 drops: the covered share scatters by about (1 - c) sqrt(n A)/area... 1 %
    assert dark_share(painted(AREA, PITCH, centres, diameters, paint), paint) == pytest.approx(
        coverage, abs=0.025
    )


def test_drops_have_their_mean_and_spread():
    rng = np.random.default_rng(5)
    _, diameters = sprayed_drops(AREA, size=0.1e-3, spread=0.4, coverage=0.6, rng=rng)
    n = len(diameters)
    assert diameters.mean() == pytest.approx(0.1e-3, rel=4 * 0.4 / np.sqrt(n))
    assert diameters.std() / diameters.mean() == pytest.approx(0.4, rel=0.05)


def test_printed_dots_cover_what_was_asked():
    paint = Paint(0.0, 1.0, 0.0)
    centres, diameters = printed_dots(
        AREA, size=0.4e-3, coverage=0.4, jitter=0.0, rng=np.random.default_rng(1)
    )
    assert dark_share(painted(AREA, PITCH, centres, diameters, paint), paint) == pytest.approx(0.4, abs=0.01)
    assert np.all(diameters == 0.4e-3)


def test_a_drop_has_its_diameter_at_half_depth():
    middle = np.array([[10e-3, 7e-3]])
    texture = painted(AREA, PITCH, middle, np.array([2e-3]), Paint(0.0, 1.0, 0.2))
    along = np.linspace(8e-3, 12e-3, 4001)
    dark = texture.at(along, np.full_like(along, 7e-3)) < 0.5
    assert dark.sum() * 1e-6 == pytest.approx(2e-3, abs=2 * PITCH)


def test_damage_bares_what_it_covers():
    ground = plain(AREA, PITCH, level=0.9)
    line = scratched(ground, start=(5e-3, 7e-3), end=(15e-3, 7e-3), width=0.4e-3, level=0.2)
    bare = ((0.9 - line.grey) / 0.7).sum() * PITCH**2
    assert bare == pytest.approx(10e-3 * 0.4e-3 + np.pi * 0.2e-3**2, rel=0.02)  # its ends are round
    patch = flaked(ground, middle=(10e-3, 7e-3), radius=1e-3, level=0.2, rng=np.random.default_rng(0))
    bare = ((0.9 - patch.grey) / 0.7).sum() * PITCH**2
    assert bare == pytest.approx(np.pi * 1e-6, rel=0.25)  # ragged
    assert patch.at(np.array(10e-3), np.array(7e-3)) == pytest.approx(0.2)


def test_waves_are_cosines():
    k = np.array([[200.0, -100.0]])
    texture = waves(AREA, PITCH, vectors=k, phases=np.array([0.4]), level=0.5, height=0.2)
    i, j = 123, 45
    angle = 2 * np.pi * (200.0 * i - 100.0 * j) * PITCH + 0.4
    assert texture.grey[j, i] == pytest.approx(0.5 + 0.2 * np.cos(angle), abs=1e-6)


FLAT = np.full((400, 500), 0.6)


def exposed(sensor, seed=0, light=FLAT, brightness=1.0):
    rng = np.random.default_rng(seed)
    pattern = sensor.pattern(light.shape, rng)
    return sensor.expose(light, pattern, brightness, rng).astype(float)


def test_photon_noise_is_signal_over_electrons_per_grey_value():
    """Variance [grey²] = read noise² + (grey - black) x grey values per electron + 1/12 of the rounding."""
    sensor = Sensor(bits=12, full_well=8000.0, read_noise=20.0, black=0.02, white=0.8)
    grey = exposed(sensor)
    gain = 4095 / 8000.0
    signal = 0.6 * (0.8 - 0.02) * 4095
    assert grey.mean() == pytest.approx(0.02 * 4095 + signal, rel=1e-3)
    expected = (20.0 * gain) ** 2 + signal * gain + 1.0 / 12.0
    assert grey.var() == pytest.approx(expected, rel=4 * np.sqrt(2.0 / FLAT.size))


def test_rounding_leaves_a_twelfth():
    """Light that rises evenly through many steps, without any noise: an error of 1/12 of a step squared."""
    sensor = Sensor(bits=8, full_well=1e12, read_noise=0.0, black=0.0, white=1.0)
    light = np.linspace(0.1, 0.9, 200_000).reshape(400, 500)
    error = exposed(sensor, light=light) - light * 255
    assert error.var() == pytest.approx(1.0 / 12.0, rel=0.01)
    assert abs(error.mean()) < 0.003


def test_grey_values_clip_at_both_ends():
    sensor = Sensor(bits=10, full_well=5000.0, read_noise=100.0, black=0.01, white=0.95)
    assert exposed(sensor, light=np.full((50, 50), 1.4)).max() == 1023
    assert exposed(sensor, light=np.zeros((50, 50))).min() == 0


def test_gains_gradient_and_flicker():
    sensor = Sensor(full_well=1e10, read_noise=0.0, fixed_pattern=0.02, gradient=0.3)
    pattern = sensor.pattern((400, 500), np.random.default_rng(3))
    assert pattern.mean() == pytest.approx(1.0, rel=1e-3)
    across = pattern.mean(axis=0)
    assert across[-5:].mean() / across[:5].mean() == pytest.approx(1.3, rel=0.005)
    assert (pattern / across).std() == pytest.approx(0.02, rel=0.02)
    plain_, brighter = (exposed(Sensor(full_well=1e10, read_noise=0.0), brightness=b) for b in (1.0, 1.1))
    black = 0.02 * 4095
    assert (brighter.mean() - black) / (plain_.mean() - black) == pytest.approx(1.1, rel=1e-3)


def test_nonsense_is_refused():
    with pytest.raises(ValueError, match="black < white"):
        Sensor(black=0.9, white=0.5)
    with pytest.raises(ValueError, match="dark must be 0 to 1"):
        Paint(dark=1.5)
    with pytest.raises(ValueError, match="coverage"):
        sprayed_drops(AREA, size=1e-3, spread=0.1, coverage=1.0, rng=np.random.default_rng(0))
    with pytest.raises(ValueError, match="first and a larger last"):
        Area((1.0, 0.0), (0.0, 1.0))
    with pytest.raises(TypeError, match="cannot be drawn"):
        board_texture(object(), 1e-4)


TARGETS = (
    FiducialDots(columns=9, rows=7, pitch=2e-3, diameter=1e-3, hollow=((1, 1), (6, 1), (1, 5))),
    Chessboard(columns=8, rows=6, pitch=2e-3),
    Charuco(columns=8, rows=6, pitch=2.4e-3, marker=1.7e-3),
)


@pytest.mark.parametrize("target", TARGETS, ids=lambda target: type(target).__name__)
def test_boards_are_found_where_they_are(target):
    """Every target is detected, its points within a fiftieth of a pixel of the camera's projection."""
    seen_by = Camera(
        fx=4000.0, fy=4000.0, cx=255.5, cy=200.0, distortion=(-0.2, 0.0, 1e-3, 0.0, 0.0),
        translation=np.array([0.0, 0.0, 0.25]),
    )  # fmt: skip
    texture, corners = board_texture(target, 2e-5)
    nodes = np.array([[0.0, 1.0]])
    body = RevolvedBody(y=nodes, r=nodes, along=nodes[0], radius=1.0, texture=texture)
    R = cv2.Rodrigues(np.array([0.25, -0.2, 0.3]))[0]
    t = -R @ np.append(corners.mean(axis=0), 0.0)
    light = next(
        iter(board_series(body, [(R, t)], seen_by, (400, 512), lens=Lens(spread=0.7), background=0.04))
    )
    found = target.detect(Sensor(bits=8, full_well=1e9, read_noise=0.0).expose(
        light[0], np.ones((400, 512)), 1.0, np.random.default_rng(0)
    ).astype(np.uint8))  # fmt: skip
    geometry = target.geometry()
    assert len(found.ids) == len(geometry.points)
    true = seen_by.project(geometry.points[found.ids] @ R.T + t)
    off = found.pixels - true
    for numbering in geometry.equivalents:  # a chessboard turned by half looks the same
        other = seen_by.project(geometry.points[numbering[found.ids]] @ R.T + t)
        off = min(off, found.pixels - other, key=lambda d: np.abs(d).sum())
    if isinstance(target, FiducialDots):  # a disc's centroid lies beside its centre: by up to 0.02 px here
        assert np.abs(off).max() < 0.05
    else:  # `cv2.cornerSubPix` ends within some hundredths
        assert np.sqrt((off**2).mean()) < 0.05


@pytest.mark.parametrize("name", sorted(WRITERS))
def test_series_are_read_back(name, tmp_path):
    rng = np.random.default_rng(2)
    pictures = rng.integers(0, 4096, (5, 24, 40), dtype=np.uint16)
    times = (np.arange(5) - 2) / 120e3
    suffix, write = WRITERS[name]
    path = tmp_path / f"cam0{suffix}"
    write(path, pictures, bits=12, times=times, rate=120e3)
    found = open_pictures(path)
    stack = np.stack([found.frame(k) for k in range(found.n_frames)])
    assert np.array_equal(stack, pictures >> 4 if name == "png" else pictures)
    if name in ("cine", "mraw"):
        assert found.bits == 12
        assert found.times == pytest.approx(times, abs=1e-9)


def test_cine_is_what_pycine_reads(tmp_path):
    """The manufacturer's format by another reader, where it is installed."""
    raw = pytest.importorskip("pycine.raw", exc_type=ImportError)
    rng = np.random.default_rng(2)
    pictures = rng.integers(0, 4096, (3, 24, 40), dtype=np.uint16)
    WRITERS["cine"][1](tmp_path / "a.cine", pictures, bits=12, times=np.arange(3) / 1e5, rate=1e5)
    images, setup, bits = raw.read_frames(str(tmp_path / "a.cine"), start_frame=1, count=3)
    assert np.array_equal(np.stack(list(images)), pictures)
    assert (setup.RealBPP, bits) == (12, 12)


def test_mraw_is_what_pymraw_reads(tmp_path):
    """The same with Photron's."""
    module = pytest.importorskip("pyMRAW", exc_type=ImportError)
    rng = np.random.default_rng(2)
    pictures = rng.integers(0, 4096, (3, 24, 40), dtype=np.uint16)
    WRITERS["mraw"][1](tmp_path / "a.mraw", pictures, bits=12, times=np.arange(3) / 1e5, rate=1e5)
    images, info = module.load_video(str(tmp_path / "a.cihx"))
    assert np.array_equal(np.asarray(images), pictures)
    assert info["Record Rate(fps)"] == 1e5


def test_a_texture_is_bilinear():
    texture = Texture(np.array([[0.0, 1.0], [2.0, 3.0]], dtype=np.float32), 0.5, (1.0, -1.0))
    assert texture.at(np.array([1.125, 9.0]), np.array([-0.75, -9.0])) == pytest.approx([1.25, 1.0], abs=2e-3)
