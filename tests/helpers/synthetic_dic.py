"""A synthetic but realistic `StereoResult`: a barrelling cylinder in front of two cameras, in closed form.

No picture is read. Points of a grid in camera 0's first picture lie on the cylinder and move with the barrel
of `synthetic.outline`. Both cameras see them with known noise. Some points are lost, and one frame is black.
"""

import json
from pathlib import Path

import numpy as np
from synthetic import LENGTH, RADIUS, displacement, outline

from dic import Camera, FrameOutcome, PointOutcome, StereoRig, SurfaceHistory, centre_line
from dic.bodies.axial_displacement import AxialDisplacement
from dic.bodies.body_motion import BodyMotion
from dic.outcome import Remark
from dic.result import Body, Placement, StereoResult, SurfaceStrain
from dic.surfaces.cylinder import SpecimenFrame
from dic.surfaces.surface_history import noise_floor

FRAMES, STATIC, RATE = 40, 8, 30e3
SIGMA_PX = 0.02
BLACK = 20
SIDE = 128


def rig() -> StereoRig:
    """Two cameras 300 mm away, 12.5 degrees apart, 18 px per mm; x right, y up, Z toward them."""
    flip = np.diag([1.0, -1.0, -1.0])
    cameras = []
    for angle in (-0.11, 0.11):
        c, s = np.cos(angle), np.sin(angle)
        turn = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
        cameras.append(
            Camera(
                fx=5400.0, fy=5400.0, cx=63.5, cy=63.5, rotation=flip @ turn,
                translation=flip @ np.array([0.0, -0.5 * LENGTH, -0.305]), sensor=(SIDE, SIDE),
            )
        )  # fmt: skip
    return StereoRig(cameras=(cameras[0], cameras[1]))


def true_rig(folder: Path) -> StereoRig:
    """The cameras of a shot's truth.json, in the true test frame."""
    first, second = (
        Camera(
            fx=c["K"][0][0], fy=c["K"][1][1], cx=c["K"][0][2], cy=c["K"][1][2], skew=c["K"][0][1],
            distortion=tuple(c["dist"]), rotation=np.array(c["R"]), translation=np.array(c["t"]),
        )
        for c in json.loads((folder / "truth.json").read_text())["cameras"]
    )  # fmt: skip
    return StereoRig((first, second))


def synthetic_result(*, flyer: bool = True, seed: int = 1) -> StereoResult:
    """A stereo result of 40 frames."""
    rng = np.random.default_rng(seed)
    time = (np.arange(FRAMES) - STATIC + 1) / RATE
    static = time <= 0.0
    theta, eta = np.meshgrid(np.linspace(-0.7, 0.7, 19), np.linspace(0.04, 0.96, 17))
    column, row = np.meshgrid(np.arange(19), np.arange(17))
    cell = np.column_stack([column.ravel(), row.ravel()])
    truth = np.stack([_place(theta.ravel(), eta.ravel(), max(t, 0.0)) for t in time])
    outcome = np.zeros(truth.shape[:2], dtype=np.int64)
    outcome[BLACK] = int(PointOutcome.OUT_OF_VIEW)
    outcome[25:, :2] = int(PointOutcome.LOW_CORRELATION)
    outcome[30:, -1] = int(PointOutcome.STEREO_MISMATCH)
    specimen = _body(truth, outcome, cell, time, rng)
    health = np.zeros(FRAMES, dtype=np.int64)
    health[BLACK] = int(FrameOutcome.BLACK)
    frames = np.flatnonzero(health == 0)
    moved = np.where(static, 0.0, displacement(np.maximum(time, 0.0)))
    travel = AxialDisplacement(
        t=time[frames],
        frame=frames,
        displacement=moved[frames] + rng.normal(0.0, 1e-6, frames.size),
        sigma=np.full(frames.size, 1e-6),
        n_points=np.full(frames.size, 12),
        rest_sigma=0.8e-6,
    )
    return StereoResult(
        t=time,
        frames=(health, np.zeros(FRAMES, dtype=np.int64)),
        static=static,
        specimen=specimen,
        flyer=_flyer(moved, time, outcome, rng) if flyer else None,
        axial_displacement=travel if flyer else None,
        centre=centre_line(specimen.surface, half_width=0.6e-3),
        placement=Placement(
            frame=SpecimenFrame(np.eye(3), np.zeros(3), 1e-12 * np.eye(6)),
            radius=RADIUS,
            radius_sigma=2e-6,
            rms=3e-6,
            chi2_per_dof=1.1,
            n_points=323,
        ),
        noise=noise_floor(specimen.surface, static),
        strain=_strain(specimen.surface, rng),
        remarks=(Remark("wrong crop offset", "camera 1 lies 3 px off", "declare [195, 192]"),),
        rig=rig(),
        facts={"settings": {"subset": 21, "step": 4}, "made": "up"},
        seconds={"track": 1.25, "match": 0.5},
        motion=_motion(moved, health, rng) if flyer else None,
    )


def _motion(moved, health, rng) -> BodyMotion:
    """Motion along y only, with noise of 1 µm and 0.1 mrad. It is lost in the black frame and in the first
    12."""
    n = moved.size
    lost = (health != 0) | (np.arange(n) < 12)
    sigma = np.repeat([1e-4, 1e-6], 3)
    u = rng.normal(0.0, 1e-6, (n, 3)) - moved[:, None] * [0.0, 1.0, 0.0]
    covariance = np.zeros((n, 6, n, 6))
    for k, component in np.ndindex(n, 6):
        covariance[k, component, k, component] = sigma[component] ** 2
    covariance[lost] = np.nan
    covariance[:, :, lost] = np.nan
    return BodyMotion(
        at=np.array([0.0, LENGTH, 0.0]),
        displacement=np.where(lost[:, None], np.nan, u),
        rotation=np.where(lost[:, None], np.nan, rng.normal(0.0, 1e-4, (n, 3))),
        covariance=covariance,
        n_points=np.where(lost, 0, 30),
        outcome=np.where(lost, int(FrameOutcome.LOST), 0),
        chi2_per_dof=1.0,
        noise_scale=1.0,
    )


def _strain(surface: SurfaceHistory, rng) -> SurfaceStrain:
    """Strains of zero with noise of 2e-4."""
    shape = (*surface.outcome.shape, 3)
    lost = ~surface.valid
    value = np.where(lost[..., None], np.nan, rng.normal(0.0, 2e-4, shape))
    return SurfaceStrain(
        value=value,
        sigma=np.where(lost[..., None], np.nan, np.full(shape, 2e-4)),
        outcome=lost.astype(np.int64),
        gauge=37.0,
    )


def _place(theta, eta, time: float):
    r = outline(eta, time)
    left = LENGTH - displacement(np.array(time))
    return np.column_stack([r * np.sin(theta), eta * left, r * np.cos(theta)])


def _flyer(moved, time, outcome, rng) -> Body:
    x, y = np.meshgrid(np.linspace(-2e-3, 2e-3, 9), LENGTH + np.linspace(0.4e-3, 1.6e-3, 4))
    rest = np.column_stack([x.ravel(), y.ravel(), np.sqrt((7.5e-3) ** 2 - x.ravel() ** 2)])
    truth = rest[None] - moved[:, None, None] * np.array([0.0, 1.0, 0.0])
    lost = np.where(outcome[:, :1] == int(PointOutcome.OUT_OF_VIEW), int(PointOutcome.OUT_OF_VIEW), 0)
    column, row = np.meshgrid(np.arange(9), np.arange(4))
    cell = np.column_stack([column.ravel(), row.ravel()])
    return _body(truth, np.broadcast_to(lost, truth.shape[:2]).copy(), cell, time, rng)


def _body(truth, outcome, cell, time, rng) -> Body:
    """Points that both cameras see with noise of `SIGMA_PX`, and the effect of this noise in space."""
    lost = outcome != 0
    cameras = rig().cameras
    pixels = [np.where(lost[..., None], np.nan, camera.project(truth)) for camera in cameras]
    pixels = [seen + rng.normal(0.0, SIGMA_PX, seen.shape) for seen in pixels]
    sigma = np.broadcast_to(SIGMA_PX / 17.7e3 * np.array([0.71, 0.71, 6.5]), truth.shape)
    measured = truth + rng.normal(0.0, 1.0, truth.shape) * sigma
    return Body(
        surface=SurfaceHistory(
            t=time, X=truth[0], u=np.where(lost[..., None], np.nan, measured - truth[0]),
            sigma=np.where(lost[..., None], np.nan, sigma), outcome=outcome,
        ),
        pixels=(pixels[0], pixels[1]),
        match_sigma=(np.where(lost, np.nan, SIGMA_PX), np.where(lost, np.nan, SIGMA_PX)),
        zncc=(np.where(lost, 0.4, 0.99), np.where(lost, 0.4, 0.98)),
        epipolar=np.where(lost, np.nan, rng.normal(0.0, 1.4 * SIGMA_PX, lost.shape)),
        points=np.round(cameras[0].project(truth[0])),
        cell=cell,
    )  # fmt: skip
