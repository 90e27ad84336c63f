"""Cylinder, test frame and flyer's flight from the pictures of a shot whose answer is known.

`python tests/validation/test_dic_flight.py` draws the figure of docs/theory/surfaces.md.
"""

import json
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import dic.surfaces as surfaces
from dic import Camera, FrameOutcome, PointOutcome, StereoRig
from dic.bodies import Region, follow_body
from dic.body_motion import body_motion
from dic.correlation import Correlation, Shape
from dic.images import frame_health, grey_noise, open_pictures
from dic.tracking import Tracking
from kolsky.flight import fit_flight, flyer_motion, symmetry_end
from kolsky.flyer import fit_flyer

CROP, STATIC, LENGTH, RADIUS = (192, 192), 12, 6.5e-3, 4.75e-3
SUBSET = 21
ROWS = {"open-01": (6.5, 120.5, 68.5, (60.0, 122.18)), "open-02": (3.5, 117.5, 57.5, (61.9, 118.84))}
"""Rows of camera 0 where the specimen begins and ends at rest, the flyer at the end; a pixel on the
transmission platen's face at rest, where the cameras of truth.json put it [px]."""
IN_VIEW = {"open-01": range(STATIC), "open-02": range(24, 28)}
"""Frames that give the zero of the displacement: open-02 shows less than two rows of its flyer at rest."""


def known_rig(folder):
    """The cameras of truth.json, in the true test frame."""
    cameras = [
        Camera(
            fx=c["K"][0][0],
            fy=c["K"][1][1],
            cx=c["K"][0][2],
            cy=c["K"][1][2],
            skew=c["K"][0][1],
            distortion=tuple(c["dist"]),
            rotation=np.array(c["R"]),
            translation=np.array(c["t"]),
        )
        for c in json.loads((folder / "truth.json").read_text())["cameras"]
    ]
    return StereoRig((cameras[0], cameras[1])).cropped(CROP, CROP)


@cache
def flight_of(folder):
    """Specimen at rest, its frame, the flyer's motion and flight, and the true displacement."""
    rig = known_rig(folder)
    upper, lower, flyer_last, platen = ROWS[folder.name]
    series = tuple(open_pictures(folder / f"cam{k}.tif", bits=12, crop_offset=CROP) for k in (0, 1))
    noise = tuple(grey_noise(pictures, range(STATIC)).sigma for pictures in series)
    health = tuple(frame_health(pictures).outcome for pictures in series)
    t = np.loadtxt(folder / "frames.csv", delimiter=",", skiprows=1)[:, 1]
    stereo = Correlation(shape=Shape.QUADRATIC)

    def follow(frames, rows, frame, correlation, rigid):
        corners = ((-0.4, rows[0]), (127.4, rows[0]), (127.4, rows[1]), (-0.4, rows[1]))
        return follow_body(
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

    specimen = follow(t <= t[STATIC - 1], (upper, lower), 0, Correlation(subset=SUBSET), False)
    # At rest the picture shows four rows of the flyer: a tenth of a subset must do.
    rim = Correlation(subset=SUBSET, shape=Shape.RIGID, least_pixels=0.06, least_zncc=0.6)
    flyer = follow(np.ones(len(t), dtype=bool), (-0.4, flyer_last), len(t) - 1, rim, True)

    X, C = surfaces.static_mean(specimen.reconstruction, range(STATIC))
    known = np.isfinite(X).all(axis=1)
    overlap = surfaces.overlap_factor(specimen.points[known], SUBSET)
    free = surfaces.fit_cylinder(X[known], C[known], overlap=overlap)
    held = surfaces.fit_cylinder(X[known], C[known], overlap=overlap, radius=RADIUS)
    zero = surfaces.on_cylinder(rig.cameras[0], platen, held)
    frame = surfaces.test_frame(held, rig, toward_flyer=(0.0, -1.0), zero=zero, zero_sigma=1e-6)
    seen = np.logical_or(*(track.outcome == PointOutcome.VALID for track in flyer.tracks))
    motion = body_motion(
        [flyer.reconstruction],
        frame,
        at=[0.0, LENGTH, 0.0],
        rest=IN_VIEW[folder.name],
        overlaps=[surfaces.overlap_factor(flyer.points, SUBSET, seen)],
        rig=rig,
        tracks=[flyer.tracks],
        turn=1e-5,
        sway=1e-6,
    )
    truth = np.load(folder / "truth_surface.npz")
    return SimpleNamespace(
        t=t,
        free=free,
        held=held,
        frame=frame,
        motion=motion,
        zero=list(IN_VIEW[folder.name]),
        displacement=np.interp(t, truth["t"], truth["d"]),
    )


@pytest.fixture(scope="module", params=["open-01", "open-02"])
def shot(request, shared):
    folder = shared / "data" / "shots" / request.param
    if not folder.is_dir():
        pytest.skip(f"no shot {request.param} in the shared folder")
    return flight_of(folder)


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
    known = shot.motion.outcome == FrameOutcome.VALID
    assert known[shot.zero[0] :].all()
    true = shot.displacement - shot.displacement[shot.zero].mean()
    error = (-shot.motion.displacement[:, 1] - true)[known]
    assert np.sqrt(np.mean(error**2)) < 3e-6  # the target of the chain
    ratio = error / shot.motion.displacement_sigma[known, 1]
    # One history whose errors hang together through the points: some ten independent values.
    assert 0.4 < np.sqrt(np.mean(ratio**2)) < 1.8


@pytest.fixture(scope="module")
def flight(shared):
    folder = shared / "data" / "shots" / "open-01"
    if not folder.is_dir():
        pytest.skip("no shot open-01 in the shared folder")
    found = flight_of(folder)
    return found, fit_flight(found.motion, found.t, start=float(found.t[STATIC - 1]))


@pytest.mark.slow
def test_position_and_velocity_from_rest_are_the_true_ones(flight):
    found, fitted = flight
    path = fit_flyer(flyer_motion(found.motion, found.t), start=float(found.t[STATIC - 1]))
    moving = found.t[STATIC + 8 :]
    np.testing.assert_array_equal(path.velocity(moving), fitted.toward.velocity(moving))
    assert np.abs(path.position(moving) - found.displacement[STATIC + 8 :]).max() < 4e-6  # σ is 1 µm
    inner = moving[1:-1]
    speed = np.gradient(found.displacement, found.t)[STATIC + 9 : -1]
    # Differences of the true path over 17 µs at a jerk of up to 2.6 m/s in (50 µs)²: 0.02 m/s.
    assert np.abs(path.velocity(inner) - speed).max() < 0.04


@pytest.mark.slow
def test_a_flyer_without_tilt_keeps_its_direction(flight):
    found, fitted = flight
    # The flyer moves along the axis: an angle of noise, and of the frame's 0.2° at most.
    angle, sigma = fitted.orientation(found.t[STATIC + 12 :])
    assert (angle < np.radians(0.3) + 4.0 * sigma).all()
    end = symmetry_end(fitted, found.t[STATIC:], separation=float(found.t[24]), over=1e-4, share=0.05)
    assert end.row is None


if __name__ == "__main__":
    from kolsky.flightreport import FlightOfSpecimen
    from kolsky.report.canvas import build
    from kolsky.report.figures.flight import KIND

    root = Path(__file__).resolve().parents[2]
    found = flight_of(root.parent / "shared" / "data" / "shots" / "open-01")
    fitted = fit_flight(found.motion, found.t, start=float(found.t[STATIC - 1]))
    figure = build(KIND, FlightOfSpecimen(fitted, found.t[STATIC - 1 :], LENGTH))
    figure.savefig(root / "docs" / "images" / "flight.png", dpi=200)
    error = -found.motion.displacement[:, 1] - found.displacement
    print(f"radius {1e3 * found.free.radius:.4f} mm, sigma {1e3 * found.free.sigma[4]:.4f} mm")
    rms, most = 1e6 * np.sqrt(np.mean(error**2)), 1e6 * np.abs(error).max()
    print(f"displacement: root mean square error {rms:.2f} µm, most {most:.2f} µm")
