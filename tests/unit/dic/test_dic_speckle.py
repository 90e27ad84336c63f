"""Rendered speckle: against the plain sum, and its statistics against their closed forms."""

import numpy as np
import pytest
from speckle_pictures import SpecklePattern, render, speckle_pattern


def test_grey_values_are_the_plain_sum():
    pattern = speckle_pattern((40, 60), seed=4)
    rng = np.random.default_rng(0)
    places = rng.uniform(-40.0, 90.0, (300, 2))
    away = places[:, None] - pattern.centres
    plain = pattern.level + np.exp(-np.sum(away**2, axis=2) / (2 * pattern.spread**2)) @ pattern.heights
    # what is left out lies beyond five spreads: 4e-6 of a height, of a few speckles
    np.testing.assert_allclose(pattern.grey(places), plain, atol=2e-5 * np.abs(pattern.heights).max())
    assert pattern.grey(np.full((2, 3, 2), 1e7)).tolist() == np.full((2, 3), pattern.level).tolist()


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


@pytest.mark.parametrize(
    ("options", "message"),
    [({"fill": 2.0}, "fill"), ({"noise": -1.0}, "noise"), ({"bits": 0}, "bits"), ({"bits": 24}, "bits")],
)
def test_wrong_options(options, message):
    with pytest.raises(ValueError, match=message):
        render(speckle_pattern((10, 10)), (10, 10), **options)


def test_wrong_pattern():
    with pytest.raises(ValueError, match="contrast must be positive"):
        speckle_pattern((10, 10), contrast=0.0)
