"""Cylinder, test frame and flyer's flight from the pictures of a shot whose answer is known.

`python tests/validation/test_dic_flight.py` draws the figure of docs/theory/pictures.md.
"""

from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from shared_data import data
from synthetic_dic import true_rig

from dic import FrameOutcome
from dic.bodies.axial_displacement import from_rest, translations
from dic.bodies.follow import follow_bodies, match_body
from dic.bodies.region import Region
from dic.chain.follow_bodies import flyer_poses
from dic.correlation import Correlation, Shape
from dic.correlation.subsets import overlap_factor
from dic.images import frame_health, grey_noise, open_pictures
from dic.surfaces import cylinder as cylinder_fit
from dic.surfaces import surface_history
from dic.tracking import Tracking
from kolsky.bars.flyer.flight import FlightOfSpecimen
from kolsky.bars.flyer.flight import flight_of as report
from kolsky.bars.flyer.path import fit_flyer
from kolsky.base.records import FlyerMotion

CROP, STATIC, LENGTH, RADIUS = (192, 192), 12, 6.5e-3, 4.75e-3
SUBSET = 21
ROWS = {"open-01": (6.5, 120.5, 67.5, (60.0, 122.18)), "open-02": (3.5, 117.5, 56.5, (61.9, 118.84))}
"""Rows of camera 0 where the specimen begins and ends at rest, the flyer at the end; a pixel on the
transmission platen's face at rest, where the cameras of truth.json put it [px]."""


@cache
def flight_of(folder):
    """Specimen at rest, its frame, the flyer's motion and flight, and the true displacement."""
    rig = true_rig(folder).cropped(CROP, CROP)
    upper, lower, flyer_last, platen = ROWS[folder.name]
    series = tuple(open_pictures(folder / f"cam{k}.tif", bits=12, crop_offset=CROP) for k in (0, 1))
    noise = tuple(grey_noise(pictures, range(STATIC)).sigma for pictures in series)
    health = tuple(frame_health(pictures).outcome for pictures in series)
    t = np.loadtxt(folder / "frames.csv", delimiter=",", skiprows=1)[:, 1]
    stereo = Correlation(shape=Shape.QUADRATIC)

    def follow(frames, rows, frame, correlation, rigid):
        corners = ((-0.4, rows[0]), (127.4, rows[0]), (127.4, rows[1]), (-0.4, rows[1]))
        matched = match_body(
            series,
            rig,
            Region(corners, frame),
            step=5,
            margin=0.0,
            tracking=Tracking(correlation=correlation),
            stereo=stereo,
            noise=noise,
            health=tuple(np.where(frames, outcome, FrameOutcome.LOST) for outcome in health),
            rigid=rigid,
        )
        return follow_bodies([matched], rig, stereo)[0]

    specimen = follow(t <= t[STATIC - 1], (upper, lower), 0, Correlation(subset=SUBSET), False)
    rim = Correlation(subset=SUBSET, shape=Shape.RIGID, least_pixels=0.4)  # as the chain does it
    flyer = follow(np.ones(len(t), dtype=bool), (-0.4, flyer_last), len(t) - 1, rim, True)

    X, C = surface_history.static_mean(specimen.reconstruction, range(STATIC))
    known = np.isfinite(X).all(axis=1)
    overlap = overlap_factor(specimen.points[known], SUBSET)
    free = cylinder_fit.fit_cylinder(X[known], C[known], overlap=overlap)
    held = cylinder_fit.fit_cylinder(X[known], C[known], overlap=overlap, radius=RADIUS)
    zero = cylinder_fit.on_cylinder(rig.cameras[0], platen, held)
    frame = cylinder_fit.test_frame(held, rig, toward_flyer=(0.0, -1.0), zero=zero, zero_sigma=1e-6)
    static = t <= t[STATIC - 1]
    moved = translations(flyer, rig, frame, t, static, subset=SUBSET, pictures=series)
    travel = from_rest(moved, None, rig, frame, t, static, None)
    motion, remarks = flyer_poses(flyer, rig, frame, travel, static, subset=SUBSET, length=LENGTH)
    assert not remarks
    truth = np.load(folder / "truth_surface.npz")
    return SimpleNamespace(
        t=t, free=free, held=held, frame=frame, static=static, axial_displacement=travel, motion=motion,
        displacement=np.interp(t, truth["t"], truth["d"]),
    )  # fmt: skip


@pytest.fixture(scope="module", params=["open-01", pytest.param("open-02", marks=pytest.mark.long)])
def shot(request):
    return flight_of(data("shots", request.param))


@pytest.mark.slow
def test_the_frame_of_the_pictures_is_the_true_one(shot):
    # Radius: what 120 px of a 171 px circle and 12 pictures know, within 4 sigmas and 0.1 mm.
    assert abs(shot.free.radius - RADIUS) < 4.0 * shot.free.sigma[4]
    assert shot.free.sigma[4] < 50e-6
    # The axis lies along the true y within 3 mrad, some sigmas of a patch 5.5 mm high; 3 mrad are 10 µm
    # at its ends.
    assert np.degrees(np.arccos(shot.frame.rotation[1, 1])) < 0.2
    on_line = shot.frame.positions(np.array([[0.0, 0.5e-3, RADIUS], [0.0, 6e-3, RADIUS]]))
    # The centre line's places, the target of the chain: 5 µm.
    assert np.abs(on_line[:, 2] - RADIUS).max() < 5e-6
    assert np.abs(on_line[:, 1] - [0.5e-3, 6e-3]).max() < 5e-6


@pytest.mark.slow
def test_the_flyers_displacement_is_the_true_one(shot):
    assert shot.axial_displacement.frame.tolist() == list(
        range(len(shot.t))
    )  # the rim is seen in every frame
    error = shot.axial_displacement.displacement - shot.displacement
    assert np.sqrt(np.mean(error**2)) < 1.5e-6  # half of the target of the chain
    # Errors of all frames hang together by the zero, and its error is one draw, which may be small.
    ratio = error / np.hypot(shot.axial_displacement.sigma, shot.axial_displacement.rest_sigma)
    assert 0.05 < np.sqrt(np.mean(ratio**2)) < 1.8


@pytest.mark.slow
def test_the_poses_are_those_of_a_flyer_that_goes_straight(shot):
    known = shot.motion.outcome == FrameOutcome.VALID
    assert known[60:].all()
    u, sigma = shot.motion.displacement[known], shot.motion.displacement_sigma[known]
    u[:, 1] += shot.displacement[known]
    u -= u[:6].mean(axis=0)  # about the frames that give the zero
    # Attitudes, and with them the face's middle a lever away, have slow errors common to all frames.
    assert np.abs(u / np.hypot(sigma, 1e-6)).max() < 5.0
    turn = shot.motion.rotation[known] / np.hypot(shot.motion.rotation_sigma[known], 1e-4)
    assert np.abs(turn).max() < 5.0


@pytest.fixture(scope="module")
def flight():
    found = flight_of(data("shots", "open-01"))
    said = report(found, LENGTH)
    assert isinstance(said, FlightOfSpecimen), said
    return found, said


@pytest.mark.slow
def test_position_and_velocity_from_rest_are_the_true_ones(flight):
    found, said = flight
    travel, path = found.axial_displacement, said.flight.toward
    alone = fit_flyer(
        FlyerMotion(travel.t, travel.displacement, travel.sigma), start=float(found.t[STATIC - 1])
    )
    moving = found.t[STATIC + 8 :]
    np.testing.assert_array_equal(alone.velocity(moving), path.velocity(moving))
    assert np.abs(path.position(moving) - found.displacement[STATIC + 8 :]).max() < 2e-6
    inner = moving[1:-1]
    speed = np.gradient(found.displacement, found.t)[STATIC + 9 : -1]
    # Differences of the true path over 17 µs at a jerk of up to 2.6 m/s in (50 µs)²: 0.02 m/s.
    assert np.abs(path.velocity(inner) - speed).max() < 0.04


@pytest.mark.slow
def test_a_flyer_without_tilt_keeps_its_direction(flight):
    _, said = flight
    # The flyer moves along the axis: an angle of noise, and of the frame's 0.2° at most.
    angle, sigma = said.flight.orientation(said.time[said.known])
    assert (angle < np.radians(0.3) + 4.0 * sigma).all()
    assert said.symmetry is not None
    assert said.end is None
    tilt, _ = said.flight.tilt(said.time[said.known])
    # What the border of the picture does to the flyer's rows turns it by some mrad (howto/from_pictures.md).
    assert np.abs(tilt).max() < 5e-3


if __name__ == "__main__":
    from kolsky.report.canvas import build
    from kolsky.report.figures import SURFACES

    root = Path(__file__).resolve().parents[2]
    found = flight_of(data("shots", "open-01"))
    figure = build(SURFACES["flight"], SimpleNamespace(flight=report(found, LENGTH)))
    figure.savefig(root / "docs" / "images" / "flight.png", dpi=200)
    error = found.axial_displacement.displacement - found.displacement
    print(f"radius {1e3 * found.free.radius:.4f} mm, sigma {1e3 * found.free.sigma[4]:.4f} mm")
    rms, most = 1e6 * np.sqrt(np.mean(error**2)), 1e6 * np.abs(error).max()
    print(f"displacement: root mean square error {rms:.2f} µm, most {most:.2f} µm")
