"""The outline of open-02 with regions drawn by hand: the place and the cause of its largest error.

`pytest -s --slow tests/validation/test_dic_outline_limits.py` prints the numbers of
docs/validation/cameras.md.
"""

import numpy as np
import pytest
from shared_data import data

from benchmarks.dic_whole import shot_of
from kolsky.shot.load import load_pictures
from kolsky.shot.optical_data import surfaces

LENGTH, SUBSET = 6.5e-3, 25
PIXEL = 54.6e-6  # on the specimen [m]
TOP, BOTTOM = 2.07, 1.84
"""Rows of pixels between the ends of the specimen at rest and the region drawn, at the flyer and at the
transmission platen."""


@pytest.fixture(scope="module")
def outline(tmp_path_factory):
    """The outline; of each row the place at rest, the error of Z and the misfit of a quadratic [m]."""
    raw = data("shots", "open-02")
    folder = shot_of(tmp_path_factory.mktemp("shot"), raw)
    text = (folder / "shot.toml").read_text()
    for old, new in (
        ("y = [6, 121]", "y = [4, 117]"),
        ("y = [0, 69]", "y = [0, 56]"),
        ("= [60, 122]", "= [61, 119]"),
    ):
        assert text.count(old) == 1
        text = text.replace(old, new)
    (folder / "shot.toml").write_text(text)
    result = surfaces(load_pictures(folder).pictures, tmp_path_factory.mktemp("out")).result
    with np.load(raw / "truth_surface.npz") as truth:
        t, at = truth["t"], {name: truth[name] for name in ("y", "r")}
    line, rest = result.centre, at["y"][0]
    order = np.argsort(rest)
    true = {
        frame: {
            name: np.array([np.interp(result.t[frame], t, column) for column in at[name].T])[order]
            for name in at
        }
        for frame in np.unique(line.frame).tolist()
    }
    place = np.empty(line.y.size)
    error, misfit = np.empty(line.y.size), np.empty(line.y.size)
    for row, frame in enumerate(line.frame.tolist()):
        y, r = true[frame]["y"], true[frame]["r"]
        place[row] = np.interp(line.y[row], y, rest[order])
        error[row] = line.Z[row] - np.interp(line.y[row], y, r)
        misfit[row] = quadratic_misfit(place[row], rest[order], r)
    return line, place, error, misfit


def quadratic_misfit(place, rest, r):
    """What the quadratic through the subset's part inside the region is off in its middle [m]."""
    half = 0.5 * SUBSET * PIXEL
    low, high = max(place - half, BOTTOM * PIXEL), min(place + half, LENGTH - TOP * PIXEL)
    inside = np.linspace(low, high, 41)
    fitted = np.polyfit((inside - place) / half, np.interp(inside, rest, r), 2)[-1]
    return fitted - np.interp(place, rest, r)


@pytest.mark.slow
def test_the_largest_error_is_where_a_quadratic_cannot_follow(outline):
    line, place, error, misfit = outline
    worst = int(np.argmax(np.abs(error)))
    strong = np.abs(misfit) > 3e-6
    ratio = float(misfit[strong] @ error[strong] / (misfit[strong] @ misfit[strong]))
    correlation = float(np.corrcoef(misfit[strong], error[strong])[0, 1])
    beyond = np.abs(error) > 12e-6
    print(
        f"\n  {error.size} rows: rms {1e6 * np.sqrt(np.mean(error**2)):.2f} um, over sigma "
        f"{np.std(error / line.sigma):.2f}; largest {1e6 * error[worst]:.1f} um in frame "
        f"{line.frame[worst]}, {1e3 * (LENGTH - place[worst]):.2f} mm from the flyer at rest, sigma "
        f"{1e6 * line.sigma[worst]:.1f} um, misfit {1e6 * misfit[worst]:.1f} um"
    )
    print(
        f"  {strong.sum()} rows with a misfit above 3 um, all in frames {line.frame[strong].min()} to "
        f"{line.frame[strong].max()}: correlation {correlation:.2f}, error over misfit {ratio:.2f}; "
        f"{beyond.sum()} rows beyond 12 um; {np.sum(np.abs(error) > 15e-6)} beyond 15 um"
    )
    assert np.sqrt(np.mean(error**2)) < 5e-6  # the target for the rms
    assert 0.8 < np.std(error / line.sigma) < 1.25  # and for sigma
    # The target for the largest, 15 um, is missed by one row of some 2500; 18 um leaves it half a sigma.
    assert np.sum(np.abs(error) > 15e-6) <= 1
    assert np.abs(error).max() < 18e-6
    # The rows beyond 12 um, more than three of their sigmas, lie where and when the first bulge forms.
    assert np.all(np.abs(line.frame[beyond] - 22) <= 3)
    # Some dozen rows with a misfit: by chance their errors would correlate with it by 0.3.
    assert strong.sum() >= 8
    assert correlation > 0.8
