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
UPPER, LOWER, FLYER_LAST = 6.5, 120.5, 68.5
"""Rows of camera 0 where the specimen begins and ends at rest, and the flyer at the end [px]."""
ZERO = (60.0, 122.18)
"""Pixel of camera 0 on the transmission platen's face at rest; the cameras of truth.json put it there."""


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

    specimen = follow(t <= t[STATIC - 1], (UPPER, LOWER), 0, Correlation(subset=SUBSET), False)
    # At rest the picture shows four rows of the flyer: a tenth of a subset must do.
    rim = Correlation(subset=SUBSET, shape=Shape.RIGID, least_pixels=0.06, least_zncc=0.6)
    flyer = follow(np.ones(len(t), dtype=bool), (-0.4, FLYER_LAST), len(t) - 1, rim, True)

    X, C = surfaces.static_mean(specimen.reconstruction, range(STATIC))
    known = np.isfinite(X).all(axis=1)
    overlap = surfaces.overlap_factor(specimen.points[known], SUBSET)
    free = surfaces.fit_cylinder(X[known], C[known], overlap=overlap)
    held = surfaces.fit_cylinder(X[known], C[known], overlap=overlap, radius=RADIUS)
    zero = surfaces.on_cylinder(rig.cameras[0], ZERO, held)
    frame = surfaces.test_frame(held, rig, toward_flyer=(0.0, -1.0), zero=zero, zero_sigma=1e-6)
    seen = np.logical_or(*(track.outcome == PointOutcome.VALID for track in flyer.tracks))
    motion = body_motion(
        [flyer.reconstruction],
        frame,
        at=[0.0, LENGTH, 0.0],
        rest=range(STATIC),
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
        flight=fit_flight(motion, t, start=float(t[STATIC - 1])),
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
    error = -shot.motion.displacement[:, 1] - shot.displacement
    assert (shot.motion.outcome == 0).all()
    assert np.sqrt(np.mean(error**2)) < 3e-6  # the target of the chain
    # What a path from it, smooth and from rest, leaves: velocity within 1 %.
    path = fit_flyer(flyer_motion(shot.motion, shot.t), start=float(shot.t[STATIC - 1]))
    moving = shot.t[STATIC + 8 : -2]
    speed = np.gradient(shot.displacement, shot.t)[STATIC + 8 : -2]
    assert np.abs(path.velocity(moving) - speed).max() < 0.03


@pytest.mark.slow
def test_a_flyer_without_tilt_keeps_its_direction(shot):
    # The shots' flyers move along the axis: an angle of noise, and of the frame's 0.2° at most.
    moving = shot.t[STATIC + 12 :]
    angle, sigma = shot.flight.orientation(moving)
    assert (angle < np.radians(0.5) + 4.0 * sigma).all()
    end = symmetry_end(shot.flight, shot.t[STATIC:], separation=float(shot.t[24]), over=1e-4, share=0.05)
    assert end.row is None


if __name__ == "__main__":
    from kolsky.report.canvas import build
    from kolsky.report.figures.flight import KIND, FlightOfSpecimen

    root = Path(__file__).resolve().parents[2]
    found = flight_of(root.parent / "shared" / "data" / "shots" / "open-01")
    figure = build(KIND, FlightOfSpecimen(found.flight, found.t[STATIC - 1 :], LENGTH))
    figure.savefig(root / "docs" / "images" / "flight.png", dpi=200)
