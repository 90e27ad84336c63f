"""Outlier gates on random scenes: `python -m populations.dic_outliers --population judged --out FOLDER`.

Every scene (`populations.outlier_scenes`) is rendered, tracked by two cameras and gated as in `kolsky dic`.
The study counts the VALID points whose position error exceeds six of their standard deviations in any
component. The limits were chosen on the population "tuned" and are tested on "judged". The folder stores one
file per scene, so an interrupted study can be continued.
"""

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np

from dic.bodies.follow import TrackedBody
from dic.chain.outliers import gate_epipolar, gate_residual, gate_surface
from dic.chain.test_frame import RestState
from dic.outcome import PointOutcome
from dic.result import Placement
from dic.surfaces.cylinder import SpecimenFrame
from populations.driver import markdown, picture_study
from populations.outlier_scenes import RADIUS, drawn, followed, rig
from tests.helpers.speckle_pictures import RenderedCylinder

SIGMAS = 6.0
KINDS = ("highlight", "lost paint", "both", "right pictures")
POPULATIONS = ("tuned", "judged")


@dataclass(frozen=True)
class Count:
    """Points of one scene after the gates."""

    seed: int
    kind: str
    tracked: int
    """VALID after the tracking and the stereo match."""
    before: int
    """Points among these with an error of more than six standard deviations."""
    valid: int
    """VALID after all gates."""
    beyond: int
    """Points among these with an error of more than six standard deviations."""
    worst: float
    """Largest error of a VALID point after all gates [m]."""


def counted(population: str, seed: int, device: str = "cpu") -> Count:
    """Render, track and gate one scene."""
    scene = drawn(population, seed)
    body = followed(scene, device=device)
    X = RenderedCylinder(RADIUS).hit(rig(scene.angle).cameras[0], body.points)
    truth = np.array([scene.place(X, k) for k in range(scene.n_frames)])
    frame = SpecimenFrame(np.eye(3), np.zeros(3), np.zeros((6, 6)))
    exact = Placement(frame, RADIUS, radius_sigma=0.0, rms=0.0, chi2_per_dof=0.0, n_points=0)
    rest = RestState(exact, frames=list(range(scene.n_static)), edges=0)
    inputs: Any = SimpleNamespace(rig=rig(scene.angle))
    gated = gate_surface(gate_residual(gate_epipolar(inputs, body, rest)), rest)
    tracked, before, _ = _off(body, truth)
    valid, beyond, worst = _off(gated, truth)
    return Count(seed, KINDS[seed % 4], tracked, before, valid, beyond, worst)


def _off(body: TrackedBody, truth: np.ndarray) -> tuple[int, int, float]:
    """Number of VALID points, number of those beyond `SIGMAS`, and the largest error [m]."""
    r = body.reconstruction
    valid = r.outcome == PointOutcome.VALID
    error = np.abs(r.position[valid] - truth[valid])
    sigma = np.sqrt(np.einsum("nii->ni", r.covariance[valid]))
    off = (error > SIGMAS * sigma).any(axis=1)
    return int(valid.sum()), int(off.sum()), float(error.max(initial=0.0))


def table(counts: Iterable[Count]) -> str:
    """The counts by kind, as Markdown."""
    found = list(counts)
    heads = ("pictures", "scenes", "tracked points", "beyond 6 σ", "after the gates", "beyond 6 σ")
    lines = []
    groups = [(kind, [c for c in found if c.kind == kind]) for kind in KINDS]
    for name, group in [*groups, ("all", found)]:
        if not group:
            continue
        tracked, valid = sum(c.tracked for c in group), sum(c.valid for c in group)
        before, beyond = sum(c.before for c in group), sum(c.beyond for c in group)
        tracks = (len(group), tracked, f"{before / max(tracked, 1):.3%}")
        gates = (f"{valid} ({valid / max(tracked, 1):.1%})", f"{beyond / max(valid, 1):.3%}")
        lines.append((name, *tracks, *gates, f"{1e6 * max(c.worst for c in group):.0f} µm"))
    return markdown((*heads, "largest error"), lines)


def measured(population: str, seed: int, device: str) -> dict[str, Any]:
    """Result of `counted` for a JSON file."""
    return asdict(counted(population, seed, device))


if __name__ == "__main__":
    picture_study(__doc__, POPULATIONS, 24, measured, lambda found: table(Count(**count) for count in found))
