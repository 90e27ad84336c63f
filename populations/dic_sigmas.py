"""Errors over their stated standard deviations: `python -m populations.dic_sigmas --population judged --out
FOLDER`.

Every scene (`populations.sigma_scenes`) is rendered. The noise is estimated from the frames at rest. The
points are tracked and, with two cameras, reconstructed as in `kolsky dic`. The table gives the root mean
square of the error over the stated standard deviation. It is 1 if the standard deviation is correct. The
table has one row for each kind of scene and noise. Its columns are displacement in the pictures' plane,
depth, both at rest and in motion, and outline. The standard deviations were calibrated on the population
"chosen" and are tested on "judged". The folder stores one file per scene, so an interrupted study can be
continued.
"""

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from dic.basics import BoolArray, FloatArray
from dic.bodies.follow import follow_bodies, match_body
from dic.bodies.region import Region
from dic.full_field.measure import FullFieldSettings, measure_plane, noise_at_rest
from dic.images.series import PicturesInMemory
from dic.outcome import FrameOutcome, PointOutcome
from dic.surfaces.cylinder import SpecimenFrame
from dic.surfaces.outline import outline
from dic.surfaces.surface_history import to_surface
from dic.tracking import Tracking
from populations.driver import markdown, picture_study
from populations.sigma_scenes import KINDS, LEVELS, POPULATIONS, RADIUS, STATIC, SigmaScene, drawn
from tests.helpers.speckle_pictures import RenderedCylinder

QUANTITIES = ("x", "y", "Z", "outline")
STATES = ("rest", "moved")
LEAST, MOST = 0.8, 1.25
"""Allowed range of a ratio [-]."""
RIM = 8.0
STRIP = 1.2e-3
"""Half width of the strip of an outline [m]."""


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
    corners = ((RIM, RIM), (111 - RIM, RIM), (111 - RIM, 111 - RIM), (RIM, 111 - RIM))
    matched = match_body(
        (series[0], series[1]),
        scene.rig,
        Region(corners, 0),
        step=5,
        margin=2.0,
        tracking=Tracking(correlation=scene.match),
        stereo=scene.stereo,
        noise=(first[0], second[0]),
        health=(fine, fine),
        device=device,
    )
    body = follow_bodies([matched], scene.rig, scene.stereo)[0]
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
