"""Refinement of the relative pose on synthetic rigs with a known error: the table of
docs/validation/cameras.md.

``python -m populations.dic_refined_rigs [SEED]`` prints it. `dic.calibration.refine.LEAST_GAIN` was chosen on
population 0 and tested on population 1.
"""

import argparse
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from dic.basics import FloatArray
from dic.calibration.refine import refine, turn_rig
from dic.camera import Camera, StereoRig
from dic.stereo.geometry import triangulate

RIGS, POINTS = 20, 150
POSE = {"none": 0.0, "0.05 mrad": 5e-5, "0.2 mrad": 2e-4, "1 mrad": 1e-3}
"""Standard deviations of the errors of the pose's rotations and tilts [rad]."""
LENS = (("right", 0.0), ("wrong", 1.0))
"""True if the intrinsic parameters are wrong: focal lengths by 0.1 %, centres by 2 px, k1 by 0.01."""


def rig(rng: np.random.Generator) -> StereoRig:
    """Two cameras 0.3 m before the specimen, 10 to 30 degrees apart."""
    half = rng.uniform(5.0, 15.0)
    cameras = []
    for pan in (half, -half):
        R = Rotation.from_euler("xyz", [rng.normal(0, 1.0), pan, rng.normal(0, 1.0)], degrees=True)
        cameras.append(
            Camera(
                fx=5400.0,
                fy=5400.0,
                cx=256.0,
                cy=256.0,
                distortion=(rng.normal(0.0, 0.1), 0.0, 0.0, 0.0, 0.0),
                rotation=R.as_matrix() @ np.diag([1.0, -1.0, -1.0]),
                translation=np.array([0.0, 3e-3, 0.3]),
            )
        )
    return StereoRig((cameras[0], cameras[1]))


def specimen(rng: np.random.Generator) -> FloatArray:
    """Points on the visible side of a cylinder of 4 to 8 mm radius, shape [n, 3] [m]."""
    radius = rng.uniform(4e-3, 8e-3)
    angle, y = rng.uniform(-0.9, 0.9, POINTS), rng.uniform(0.0, 7e-3, POINTS)
    return np.column_stack([radius * np.sin(angle), y, radius * np.cos(angle)])


def wrong_lens(camera: Camera, rng: np.random.Generator, size: float) -> Camera:
    """A camera with wrong intrinsic parameters."""
    scale = 1.0 + 1e-3 * size * rng.standard_normal()
    k1 = camera.distortion[0] + 0.01 * size * rng.standard_normal()
    return replace(
        camera,
        fx=camera.fx * scale,
        fy=camera.fy * scale,
        cx=camera.cx + 2.0 * size * rng.standard_normal(),
        cy=camera.cy + 2.0 * size * rng.standard_normal(),
        distortion=(k1, 0.0, 0.0, 0.0, 0.0),
    )


def shape_error(cameras: StereoRig, pixels: list[FloatArray], X: FloatArray) -> float:
    """Root mean square distance of triangulated points from the true ones after a rigid motion [m]."""
    found = triangulate(cameras, pixels[0], pixels[1], np.eye(2), np.eye(2)).position
    a, b = X - X.mean(axis=0), found - found.mean(axis=0)
    turn, _ = Rotation.align_vectors(a, b)
    return float(np.sqrt(np.mean(np.sum((a - turn.apply(b)) ** 2, axis=1))))


def one(rng: np.random.Generator, pose: float, lens: float) -> tuple[bool, float, float, float, float]:
    """One rig: whether the refinement is accepted, shape errors before and after [m], medians [px]."""
    true, X = rig(rng), specimen(rng)
    noise = rng.uniform(0.01, 0.05)
    pixels = [camera.project(X) + noise * rng.standard_normal((POINTS, 2)) for camera in true.cameras]
    wrong = turn_rig(true, pose * rng.standard_normal(5))
    first, second = (wrong_lens(camera, rng, lens) for camera in wrong.cameras)
    given = StereoRig((first, second))
    found = refine(given, pixels[0], pixels[1], np.full(POINTS, noise * np.sqrt(2.0)))
    errors = [shape_error(cameras, pixels, X) for cameras in (given, found.rig)]
    return found.helps, errors[0], errors[1], found.before, found.after


def rows(population: int, rigs: int = RIGS) -> list[str]:
    """Lines of the table."""
    lines = []
    for lens_name, lens in LENS:
        for pose_name, pose in POSE.items():
            rng = np.random.default_rng([population, int(1e6 * pose), int(lens)])
            taken, before, after, d0, d1 = np.array([one(rng, pose, lens) for _ in range(rigs)]).T
            used = taken.astype(bool)
            worse = float(np.mean(after[used] > 1.1 * before[used])) if used.any() else 0.0
            shape = (
                f"{1e6 * np.median(before[used]):.2f} | {1e6 * np.median(after[used]):.2f}"
                if used.any()
                else "– | –"
            )
            lines.append(
                f"| {lens_name} | {pose_name} | {100 * used.mean():.1f} % | {np.median(d0):.3f} | "
                f"{np.median(np.where(used, d1, d0)):.3f} | {shape} | {100 * worse:.1f} % |"
            )
    return lines


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument(
        "population", type=int, nargs="?", default=1, metavar="SEED", help="of the population"
    )
    print("\n".join(rows(parser.parse_args().population)))
