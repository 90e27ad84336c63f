"""The specimen's length conditioned on its pictures, against the conditional normal distribution."""

from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from kolsky.base.apparatus import Specimen
from kolsky.base.records import CentreLine
from kolsky.pictures import specimen_length
from kolsky.shot import load
from tests.helpers.stereo_scene import rig

A, B, Z, R = 6e-6, 4e-6, 3e-6, 5e-6
"""Standard deviations of declared length, heights, place at rest and rim [m]."""
OFF = 9e-6
LENGTH = 6e-3


def found(off: float = OFF, sigma: float = A) -> specimen_length.LengthByPictures:
    rim = specimen_length.RimAtRest(off, float(np.hypot(Z, R)))
    return specimen_length.conditioned_length(rim, declared=LENGTH, sigma=sigma, y_sigma=B)


def test_it_is_the_conditional_distribution() -> None:
    """Mean and covariance of the four errors, once d = b - a + z + r is known, by matrices."""
    prior = np.diag(np.square([A, B, Z, R]))
    H = np.array([-1.0, 1.0, 1.0, 1.0])
    gain = prior @ H / (H @ prior @ H)
    mean, left = gain * OFF, prior - np.outer(gain, H @ prior)
    one = found()
    assert one.conditioned
    assert one.pictures == LENGTH + OFF
    assert one.pictures_sigma == pytest.approx(np.sqrt(B**2 + Z**2 + R**2))
    assert one.used - LENGTH == pytest.approx(-mean[0])
    assert one.y_shift == pytest.approx(-mean[1])
    assert one.used_sigma**2 == pytest.approx(left[0, 0])
    assert one.y_per_length * one.used_sigma**2 == pytest.approx(left[0, 1])
    whole = one.y_sigma**2 + (one.y_per_length * one.used_sigma) ** 2
    assert whole == pytest.approx(left[1, 1])


def test_errors_that_are_drawn_scatter_as_stated() -> None:
    """Both errors that are left, over a hundred thousand draws: five standard errors of a mean square are
    5 sqrt(2 / n) = 2.2 %."""
    n = 100_000
    a, b, z, r = np.random.default_rng(3).normal(size=(4, n)) * np.array([A, B, Z, R])[:, None]
    one = found(1e-6)
    per = 1e6 * (b - a + z + r)
    length = a + (one.used - LENGTH) * per
    heights = b + one.y_shift * per
    assert np.mean(length**2) == pytest.approx(one.used_sigma**2, rel=0.022)
    rest = heights - one.y_per_length * length
    assert np.mean(rest**2) == pytest.approx(one.y_sigma**2, rel=0.022)
    assert abs(np.corrcoef(rest, length)[0, 1]) < 5.0 / np.sqrt(n)


def test_an_exact_length_stays_and_so_do_the_heights() -> None:
    one = found(sigma=0.0)
    assert not one.conditioned
    assert (one.used, one.used_sigma, one.y_shift, one.y_per_length) == (LENGTH, 0.0, 0.0, 0.0)
    assert one.y_sigma == B
    assert "used as declared" in specimen_length.length_words(one)


def test_what_is_apart_is_said_and_beyond_four_sigmas_not_joined() -> None:
    both = float(np.sqrt(A**2 + B**2 + Z**2 + R**2))
    assert specimen_length.length_notes(found(2.99 * both)) == ()
    (said,) = specimen_length.length_notes(found(-3.01 * both))
    assert "specimen.length is 6.0000 mm" in said
    assert f"prefer {1e3 * (LENGTH - 3.01 * both):.4f} mm" in said
    assert "3.0 standard uncertainties" in said
    assert "measure the specimen again" in said
    assert f"{1e3 * found(-3.01 * both).used:.4f} mm was used" in said
    assert found(3.99 * both).conditioned
    assert not found(4.01 * both).conditioned
    assert found(4.01 * both).used == LENGTH
    assert "the declared one was used" in specimen_length.length_notes(found(4.01 * both))[0]


def test_the_words_have_all_three_lengths() -> None:
    one = specimen_length.conditioned_length(
        specimen_length.RimAtRest(8e-6, 6e-6), declared=LENGTH, sigma=8e-6, y_sigma=0.0
    )
    assert specimen_length.length_words(one) == (
        "declared 6.0000 mm ± 16.0 µm, in the pictures 6.0080 mm ± 12.0 µm, used 6.0051 mm ± 9.6 µm (k = 2)"
    )


def result(*, disagreement: tuple[float, float] | None, cameras: Any = None) -> Any:
    covariance = np.diag([0.0, 0.0, 0.0, 0.0, B**2, 0.0])
    frame = SimpleNamespace(covariance=covariance, rotation=np.eye(3), in_rig=lambda x: x)
    return SimpleNamespace(
        axial_displacement=SimpleNamespace(rim_disagreement=disagreement),
        placement=SimpleNamespace(frame=frame, radius=5e-3),
        rig=cameras or SimpleNamespace(covariance=None),
    )


def test_the_rim_has_neither_the_lengths_sigma_nor_the_lower_ends() -> None:
    whole = float(np.sqrt(A**2 + B**2 + Z**2 + R**2))
    given = result(disagreement=(OFF, whole))
    plain = specimen_length.rim_at_rest(given, length=LENGTH, length_sigma=A)
    assert plain.disagreement == OFF
    assert plain.sigma == pytest.approx(np.hypot(Z, R))
    more = specimen_length.rim_at_rest(given, length=LENGTH, length_sigma=A, unseen=7e-6)
    assert more.sigma == pytest.approx(np.sqrt(Z**2 + R**2 + 49e-12))
    assert specimen_length.rim_at_rest(result(disagreement=None), length=LENGTH, length_sigma=A) is None


def test_a_scale_of_the_calibration_is_in_the_length() -> None:
    """A distance of the cameras that is known to 0.1 % makes every length wrong by as much."""
    cameras = rig()
    n = len(cameras.parameter_names)
    covariance = np.zeros((n, n))
    distance = cameras.relative[1]
    covariance[-3:, -3:] = 1e-6 * np.outer(distance, distance)
    given = result(disagreement=(OFF, 2.0 * A), cameras=replace(cameras, covariance=covariance))
    assert specimen_length.calibration_variance(given, LENGTH) == pytest.approx(
        (1e-3 * LENGTH) ** 2, rel=1e-5
    )
    one = specimen_length.rim_at_rest(given, length=LENGTH, length_sigma=A)
    assert one.sigma == pytest.approx(np.sqrt(3.0 * A**2 - B**2 + (1e-3 * LENGTH) ** 2), rel=1e-5)


@dataclass(frozen=True)
class Loaded:
    """The fields of a shot that its length has to do with."""

    specimen: Specimen
    centre_line: CentreLine
    uncertainty: dict[str, float]
    notes: tuple[str, ...] = ("an odd row",)
    length_by_pictures: specimen_length.LengthByPictures | None = None


def test_a_shot_takes_the_length_and_its_heights() -> None:
    line = CentreLine(np.zeros(2), np.arange(2), np.array([1e-3, 2e-3]), np.full(2, 5e-3), np.full(2, 1e-6))
    declared = {"specimen_length": A / LENGTH, "y_offset": B, "sensitivity": 0.002}
    shot: Any = Loaded(Specimen(diameter=1e-2, length=LENGTH, density=1e3), line, declared)
    one, rim = found(), specimen_length.RimAtRest(OFF, float(np.hypot(Z, R)))
    given: Any = load._with_length(shot, rim)
    assert given.specimen.length == pytest.approx(one.used, rel=1e-12)
    assert given.specimen.diameter == 1e-2
    np.testing.assert_allclose(given.centre_line.y, line.y + one.y_shift, rtol=1e-12)
    assert given.uncertainty["specimen_length"] * one.used == pytest.approx(one.used_sigma)
    assert given.uncertainty["y_offset"] == pytest.approx(one.y_sigma)
    assert given.uncertainty["sensitivity"] == 0.002
    assert given.length_by_pictures == one
    assert given.notes == ("an odd row",)
    exact: Any = load._with_length(replace(shot, uncertainty={"y_offset": B}), rim)
    assert (exact.specimen, exact.centre_line, exact.uncertainty) == (shot.specimen, line, {"y_offset": B})
    assert exact.length_by_pictures is not None
