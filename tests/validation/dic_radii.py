"""The table of docs/validation/curved_subsets.md: radii with and without correction of the curvature."""

import numpy as np
from scipy.spatial.transform import Rotation
from speckle_pictures import RenderedCylinder, Speckles

from dic import Camera, Correlation, FullFieldSettings, StereoRig, Tracking, measure_cylinder
from dic.correlation import Shape
from dic.result import FittedCylinder

RADIUS, DISTANCE, ROWS, ARC, HALF_ANGLE, NOISE = 6e-3, 0.3, 90, 0.6, 12.0, 1.0
SIZES, SUBSETS = (50.0, 100.0), (21, 31, 41)


def cylinder(size: float, subset: int, shape: Shape, *, seed: int = 3) -> FittedCylinder:
    """What two cameras say of a cylinder whose radius is `size` px in their pictures."""
    focal = size * DISTANCE / RADIUS
    columns = int(2.5 * size)
    cameras = [
        Camera(
            fx=focal,
            fy=focal,
            cx=columns / 2,
            cy=ROWS / 2,
            rotation=Rotation.from_euler("y", pan, degrees=True).as_matrix() @ np.diag([1.0, -1.0, -1.0]),
            translation=np.array([0.0, 0.0, DISTANCE]),
        )
        for pan in (HALF_ANGLE, -HALF_ANGLE)
    ]
    pattern, rng = Speckles(pitch=4.0 * DISTANCE / focal, seed=seed), np.random.default_rng(seed)
    series = []
    for camera in cameras:
        truth = 20.0 + 200.0 * RenderedCylinder(RADIUS).picture(
            camera, (ROWS, columns), pattern, oversample=3
        )
        noisy = truth + NOISE * rng.standard_normal((2, ROWS, columns))
        series.append(list(np.clip(np.round(noisy), 0, 255).astype(np.uint8)))
    mask = np.zeros((ROWS, columns), dtype=bool)
    mask[3:-3, int(columns / 2 - ARC * size) : int(columns / 2 + ARC * size)] = True
    settings = FullFieldSettings(
        static=2, stereo_shape=shape, tracking=Tracking(correlation=Correlation(subset=subset))
    )
    found = measure_cylinder(
        (series[0], series[1]), StereoRig((cameras[0], cameras[1])), settings, mask=mask
    ).cylinder
    assert found is not None
    return found


def rows() -> list[str]:
    """Lines of the table."""
    lines = []
    for size in SIZES:
        for subset in SUBSETS:
            cells = []
            for shape in (Shape.AFFINE, Shape.QUADRATIC):
                found = cylinder(size, subset, shape)
                cells += [
                    f"{1e3 * found.uncorrected:.3f}",
                    f"{1e3 * found.radius[0]:.3f} ± {2e3 * found.sigma[0]:.3f}",
                ]
            lines.append(f"| {size:g} | {subset} | {' | '.join(cells)} |")
    return lines


if __name__ == "__main__":
    print("\n".join(rows()))
