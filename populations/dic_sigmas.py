"""Errors over their stated standard deviations: `python -m populations.dic_sigmas --population judged --out
FOLDER`.

Every scene is rendered: a plane before one camera, or a cylinder before two. Its positions have a closed
form. The noise is estimated from the frames at rest. The
points are tracked and, with two cameras, reconstructed as in `kolsky dic`. The table gives the root mean
square of the error over the stated standard deviation. It is 1 if the standard deviation is correct. The
table has one row for each kind of scene and noise. Its columns are displacement in the pictures' plane,
depth, both at rest and in motion, and outline. The standard deviations were calibrated on the population
"chosen" and are tested on "judged". The folder stores one file per scene, so an interrupted study can be
continued.
"""

from collections.abc import Iterable
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dic.basics import BoolArray, FloatArray
from dic.camera import StereoRig
from dic.correlation import Correlation, Shape
from dic.full_field.measure import FullFieldSettings, measure_plane, noise_at_rest
from dic.images.series import PicturesInMemory
from dic.outcome import FrameOutcome, PointOutcome
from dic.surfaces.cylinder import SpecimenFrame
from dic.surfaces.outline import outline
from dic.surfaces.surface_history import to_surface
from dic.tracking import Tracking
from populations.driver import markdown, picture_study
from populations.outlier_scenes import PIXEL, RADIUS, SHAPE, rig, track_body
from tests.helpers.speckle_pictures import RenderedCylinder, Speckles, render, speckle_pattern

QUANTITIES = ("x", "y", "Z", "outline")
STATES = ("rest", "moved")
LEAST, MOST = 0.8, 1.25
"""Allowed range of a ratio [-]."""
STRIP = 1.2e-3
"""Half width of the strip of an outline [m]."""


WHITE = 255.0
STATIC, MOVED = 4, 4
"""Number of frames at rest, and of frames after them."""
LEVELS = (1.0, 2.0, 5.0)
"""Standard deviations of a grey value [grey]."""
KINDS = ("plane, shift", "plane, strain", "cylinder, shift", "cylinder, strain")
POPULATIONS = {"chosen": 11, "judged": 12}


@dataclass(frozen=True)
class SigmaScene:
    """One scene of a population."""

    kind: str
    """One of `KINDS`."""
    seed: int
    noise: float
    """Standard deviation of a grey value [grey]."""
    speckle: float
    """Size of the speckles [px]."""
    strain: float
    """Strain along the axis in the last frame [-]; 0 for a shift."""
    shifts: FloatArray
    """Shifts of the frames after those at rest [px], shape [MOVED, 3]."""
    angle: float
    """Angle between the cameras [rad]."""
    match: Correlation
    """Settings of the tracking."""
    stereo: Correlation
    """Settings of the match between the cameras."""

    @property
    def n_frames(self) -> int:
        """Number of frames."""
        return STATIC + MOVED

    @property
    def static(self) -> NDArray[np.bool_]:
        """Frames at rest, shape [n_frames]."""
        return np.arange(self.n_frames) < STATIC

    def stretch(self, k: int) -> float:
        """Length along the axis in frame `k` over that at rest [-]."""
        return 1.0 + self.strain * max(k - STATIC + 1, 0) / MOVED

    def shift(self, k: int) -> FloatArray:
        """Rigid shift in frame `k` [px], shape [3]."""
        return np.zeros(3) if k < STATIC or self.strain else self.shifts[k - STATIC]

    def place(self, X: FloatArray, k: int) -> FloatArray:
        """Positions in frame `k` of points that are at X at rest: [px], shape [n, 2] for a plane; [m], shape
        [n, 3] for a cylinder."""
        stretch = self.stretch(k)
        if self.kind.startswith("plane"):
            middle = 0.5 * (SHAPE[0] - 1)
            return (X - middle) * np.array([stretch**-0.5, stretch]) + middle + self.shift(k)[:2]
        return X * np.array([stretch**-0.5, stretch, stretch**-0.5]) + PIXEL * self.shift(k)

    def pictures(self) -> list[NDArray[np.uint8]]:
        """Grey values of one or two cameras, each of shape [n_frames, rows, columns]."""
        rng = np.random.default_rng([self.seed, 3])
        if self.kind.startswith("plane"):
            return [np.array([self._recorded(self._plane(k), rng) for k in range(self.n_frames)])]
        return [
            np.array([self._recorded(self._cylinder(camera, k), rng) for k in range(self.n_frames)])
            for camera in (0, 1)
        ]

    def _recorded(self, grey: FloatArray, rng: np.random.Generator) -> NDArray[np.uint8]:
        noisy = grey + self.noise * rng.standard_normal(grey.shape)
        return np.clip(np.rint(noisy), 0.0, WHITE).astype(np.uint8)

    def _plane(self, k: int) -> FloatArray:
        pattern = speckle_pattern(SHAPE, size=self.speckle, contrast=35.0, seed=self.seed)
        stretch, middle, shift = self.stretch(k), 0.5 * (SHAPE[0] - 1), self.shift(k)[:2]

        def material(x: FloatArray) -> FloatArray:
            return np.asarray((x - middle - shift) / np.array([stretch**-0.5, stretch]) + middle)

        return render(pattern, SHAPE, material=material)

    def _cylinder(self, camera: int, k: int) -> FloatArray:
        stretch = self.stretch(k)
        wider, speckles = stretch**-0.5, Speckles(0.8 * self.speckle * PIXEL, seed=self.seed)

        def pattern(arc: FloatArray, height: FloatArray) -> FloatArray:
            return speckles(arc / wider, height / stretch)

        seen_by = rig(self.angle).cameras[camera]
        moved = replace(seen_by, translation=seen_by.translation + PIXEL * seen_by.rotation @ self.shift(k))
        light = RenderedCylinder(RADIUS * wider).picture(moved, SHAPE, pattern, oversample=4)
        return 0.75 * WHITE * light

    @property
    def rig(self) -> StereoRig:
        """The cameras in front of a cylinder."""
        return rig(self.angle)


def drawn(population: str, number: int) -> SigmaScene:
    """Scene of a population: kinds and noises alternate, the other values are random."""
    rng = np.random.default_rng([POPULATIONS[population], number])
    kind = KINDS[number % len(KINDS)]
    level = LEVELS[(number // len(KINDS)) % len(LEVELS)]
    strain = float(rng.uniform(0.1, 0.2) * rng.choice([-1.0, 1.0]))
    subset = int(rng.choice([17, 21, 25]))
    shape = Shape.AFFINE if rng.uniform() < 0.5 else Shape.QUADRATIC
    return SigmaScene(
        kind=kind,
        seed=1000 * POPULATIONS[population] + number,
        noise=level,
        speckle=float(rng.uniform(4.0, 7.0)),
        strain=strain if kind.endswith("strain") else 0.0,
        shifts=rng.uniform(-2.0, 2.0, (MOVED, 3)),
        angle=float(rng.uniform(0.2, 0.5)),
        match=Correlation(subset=subset, shape=shape),
        stereo=Correlation(subset=subset, shape=Shape.QUADRATIC),
    )


@dataclass(frozen=True)
class Scatter:
    """Statistics of the error over the standard deviation of some values of a scene."""

    scene: int
    kind: str
    noise: float
    quantity: str
    state: str
    count: int
    squares: float
    """Sum of the squares of error over standard deviation [-]."""
    beyond: int
    """Number of values with an error of more than three standard deviations."""


def scattered(population: str, number: int, device: str = "cpu") -> list[Scatter]:
    """Render and measure one scene, and compare it with the truth."""
    scene = drawn(population, number)
    off = _plane(scene, device) if scene.kind.startswith("plane") else _cylinder(scene, device)
    found = []
    for (quantity, state), z in off.items():
        if z.size:
            beyond = int(np.sum(np.abs(z) > 3.0))
            squares = float(np.sum(z**2))
            found.append(Scatter(number, scene.kind, scene.noise, quantity, state, z.size, squares, beyond))
    return found


Off = dict[tuple[str, str], FloatArray]


def _plane(scene: SigmaScene, device: str) -> Off:
    settings = FullFieldSettings(
        step=6, margin=scene.match.subset / 2, tracking=Tracking(correlation=scene.match), static=STATIC,
        device=device,
    )  # fmt: skip
    found = measure_plane(list(scene.pictures()[0]), settings)
    X = found.points
    truth = np.array([scene.place(X, k) - X for k in range(scene.n_frames)])
    z = (found.surface.u[..., :2] - truth) / found.surface.sigma[..., :2]
    frames = np.arange(scene.n_frames) != settings.reference  # the points were chosen in that frame
    return _by_state(scene, z, found.surface.valid & frames[:, None])


def _cylinder(scene: SigmaScene, device: str) -> Off:
    series = [PicturesInMemory(list(grey)) for grey in scene.pictures()]
    fine = np.full(scene.n_frames, int(FrameOutcome.VALID), dtype=np.int64)
    first, second = (noise_at_rest(one, fine, STATIC, None) for one in series)
    if first is None or second is None:
        raise ValueError("the frames at rest give no noise")
    pair, noise = (series[0], series[1]), (first[0], second[0])
    body = track_body(pair, scene.rig, scene.match, scene.stereo, noise, step=5, device=device)
    r = body.reconstruction
    cylinder = RenderedCylinder(RADIUS)
    X = cylinder.hit(scene.rig.cameras[0], body.points)
    truth = np.array([scene.place(X, k) for k in range(scene.n_frames)])
    sigma = np.sqrt(np.einsum("fpii->fpi", r.covariance))
    valid = r.outcome == PointOutcome.VALID
    off = _by_state(scene, (r.position - truth) / sigma, valid)
    frame = SpecimenFrame(np.eye(3), np.zeros(3), np.zeros((6, 6)))
    rest, taken = list(range(STATIC)), valid[:STATIC].any(axis=0)
    surface = to_surface(r, frame, np.arange(float(scene.n_frames)), reference=rest, points=taken)
    points = body.points[taken]
    for state, chosen in zip(STATES, (scene.static, ~scene.static), strict=True):
        z = []
        for k in np.flatnonzero(chosen):
            x, _, depth = scene.shift(int(k)) * 56e-6
            found = outline(
                surface, points, half_width=STRIP, subset=scene.match.subset,
                shape=max(scene.match.shape, scene.stereo.shape), axis_x=float(x), axis_Z=float(depth),
            )  # fmt: skip
            here = found.frame == k
            z.append((found.Z[here] - RADIUS * scene.stretch(int(k)) ** -0.5) / found.sigma[here])
        off["outline", state] = np.concatenate(z)
    return off


def _by_state(scene: SigmaScene, z: FloatArray, valid: BoolArray) -> Off:
    off: Off = {}
    for state, chosen in zip(STATES, (scene.static, ~scene.static), strict=True):
        for i, quantity in enumerate(QUANTITIES[: z.shape[2]]):
            off[quantity, state] = z[chosen][valid[chosen]][:, i]
    return off


def table(found: Iterable[Scatter]) -> str:
    """Root mean squares by kind and noise as Markdown; values outside `LEAST` to `MOST` in bold."""
    rows = list(found)
    columns = [(q, s) for s in STATES for q in QUANTITIES]
    lines = []
    for kind in KINDS:
        for level in LEVELS:
            cells = []
            for quantity, state in columns:
                some = [
                    s for s in rows
                    if (s.kind, s.noise, s.quantity, s.state) == (kind, level, quantity, state)
                ]  # fmt: skip
                cells.append(_cell(some))
            lines.append((kind, f"{level:g}", *cells))
    return markdown(("scenes", "noise, grey", *(f"{q}, {s}" for q, s in columns)), lines)


def _cell(some: list[Scatter]) -> str:
    if not some:
        return ""
    ratio = (sum(s.squares for s in some) / sum(s.count for s in some)) ** 0.5
    return f"{ratio:.2f}" if LEAST <= ratio <= MOST else f"**{ratio:.2f}**"


def measured(population: str, number: int, device: str) -> list[dict[str, Any]]:
    """Result of `scattered` for a JSON file."""
    return [asdict(s) for s in scattered(population, number, device)]


if __name__ == "__main__":
    picture_study(
        __doc__,
        POPULATIONS,
        48,
        measured,
        lambda found: table(Scatter(**s) for scene in found for s in scene),
    )
