"""Views of a target: detection in pictures, pairs of views, and the resulting calibration."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from dic.basics import FloatArray, IntArray
from dic.calibration.bundle import Rig, View, project_points
from dic.calibration.targets.base import Detection, Target, TargetNotFound
from dic.camera import StereoRig
from dic.images import PictureError, Pictures
from dic.outcome import Outcome
from dic.processes import background_pool
from dic.views import ResultViews


def detect(picture: NDArray[np.generic], target: Target) -> Detection:
    """Detect the points of a target in a picture.

    Parameters
    ----------
    picture
        Grey values of any depth, shape [rows, columns].
    target
        One of `dic.calibration.targets.TARGETS`.

    Raises
    ------
    TargetNotFound
        If the target is not found, or its points cannot be numbered.
    ValueError
        If the picture is not one grey picture.
    """
    return target.detect(picture)


Views = tuple[list[Detection | TargetNotFound | PictureError], ...]
"""For each camera a list with one entry per picture. The entry is the detection, the reason why there is
none, or the reason why the picture is unusable."""


@contextmanager
def detect_in_background(
    series: Sequence[Pictures], targets: Sequence[Target]
) -> Iterator[Callable[..., Views]]:
    """Detect a target in all pictures of several cameras in the background (`dic.processes.background_pool`).

    ``targets``: the target for each camera. Yields: a function that helps with the work and returns the
    detections for `calibrate`. They do not depend on the number of processes. It takes a `progress`, see
    `dic.processes.run_parallel`.
    """
    jobs = [
        (camera, index)
        for index in range(max(pictures.n_frames for pictures in series))
        for camera, pictures in enumerate(series)
        if index < pictures.n_frames
    ]

    def one(job: tuple[int, int]) -> Detection | TargetNotFound | PictureError:
        camera, index = job
        try:
            return detect(series[camera].frame(index), targets[camera])
        except (TargetNotFound, PictureError) as error:
            return error

    with background_pool([partial(one, job) for job in jobs]) as joined:

        def views(progress: Callable[[int, int], None] | None = None) -> Views:
            by_camera: Views = tuple([] for _ in series)
            for (camera, _), view in zip(jobs, joined(progress), strict=True):
                by_camera[camera].append(view)
            return by_camera

        yield views


class PairOutcome(Outcome):
    """Outcome of one pair of calibration pictures."""

    VALID = 0, "both cameras saw the target where the others put it", "nothing to do"
    NOT_FOUND = (
        1,
        "the target was not recognised in either camera",
        "look at the pictures: all fiducials in view, in focus, free of glare",
    )
    INCONSISTENT = (
        2,
        "what the two cameras saw does not fit the cameras that all other pairs agree on",
        "look for a target that moved between the two exposures, pictures that are no pair, or blur",
    )
    ONE_CAMERA = (
        3,
        "only one camera recognised the target: used for the parameters of that camera",
        "keep the target in both fields of view",
    )

    @property
    def used(self) -> bool:
        """True if the pair was used in the solution."""
        return self in (PairOutcome.VALID, PairOutcome.ONE_CAMERA)


def _rms(residual: FloatArray) -> float:
    return float(np.sqrt(np.mean(np.sum(residual**2, axis=1)))) if len(residual) else float("nan")


@dataclass(frozen=True)
class PairView:
    """One camera's view in a pair of pictures."""

    ids: IntArray
    """Numbers of the recognised points of the target, shape [n]."""
    pixels: FloatArray
    """Observed pixels, as measured [px], shape [n, 2]."""
    sigma: FloatArray
    """Standard deviations from the picture's noise [px], shape [n]."""
    residual: FloatArray
    """Measured minus predicted pixels [px], shape [n, 2]."""
    used: NDArray[np.bool_]
    """Points used in the solution; the others were rejected as outliers, shape [n]."""

    @property
    def rms(self) -> float:
        """Root mean square length of the residuals of the used points, or of all points if none was used
        [px]."""
        return _rms(self.residual[self.used] if self.used.any() else self.residual)


@dataclass(frozen=True)
class Pair:
    """One pair of pictures of the target."""

    name: str
    outcome: PairOutcome
    reason: str
    """Reason why it was left out, with numbers; empty if it was used."""
    views: tuple[PairView | None, PairView | None]
    """Views of camera 0 and 1; None where the target was not recognised."""
    rotation: FloatArray | None
    """Rotation from the target's frame to the rig's, shape [3, 3]; None if the target was not recognised."""
    translation: FloatArray | None
    """Translation from the target's frame to the rig's [m], shape [3]."""
    unusable: bool = False
    """True if one of its pictures could not be read or has another size; `reason` names it."""

    @property
    def rms(self) -> float:
        """Root mean square length of the residuals over both cameras [px]; NaN if neither recognised the
        target."""
        views = [view for view in self.views if view is not None]
        any_used = any(view.used.any() for view in views)
        parts = [view.residual[view.used] if any_used else view.residual for view in views]
        return _rms(np.concatenate([*parts, np.zeros((0, 2))]))


@dataclass(frozen=True)
class Checks:
    """Checks of the calibration with independent data; NaN if not requested."""

    fit_rms: float
    """Root mean square residual of the points used [px]."""
    held_out_rms: float
    """The same for held-out pairs, with only the target's pose adjusted [px]; NaN with fewer than four
    pairs."""
    folds: int
    """Number of parts of the cross-validation."""
    distance_ratio: float
    """Ratio of triangulated to true distances between points of the target, weighted by length; NaN if no
    target was seen by both cameras."""
    distance_sigma: float
    """Standard error of that ratio, from its scatter between picture pairs."""
    distance_rms: float
    """Root mean square distance of triangulated points from the target's rigid shape [m]."""


@dataclass(frozen=True)
class Calibration(ResultViews):
    """Two calibrated cameras with residuals, checks and rejected pairs."""

    rig: StereoRig
    """The cameras, camera 0 at the origin, with the covariance of their parameters."""
    free: tuple[str, ...]
    """Parameters of each camera that were adjusted."""
    pairs: tuple[Pair, ...]
    """All given pairs, in their order."""
    unit: float
    """Root of the variance of unit weight: residuals over the sigma due to the pictures' noise. The
    covariance is scaled with its square."""
    clustering: float
    """`dic.calibration.bundle.clustering`: 1 if residuals are independent. If it exceeds 1, the covariance is
    scaled with it."""
    freedom: int
    """Degrees of freedom: number of measured coordinates minus adjusted parameters."""
    checks: Checks
    advice: tuple[str, ...]
    """Advice on the choice of parameters and pictures, from the covariance."""

    @property
    def rms(self) -> float:
        """Root mean square length of all used residuals [px]."""
        return self.checks.fit_rms

    @property
    def rejected(self) -> tuple[Pair, ...]:
        """Pairs that were left out."""
        return tuple(pair for pair in self.pairs if not pair.outcome.used)

    @property
    def unusable(self) -> tuple[Pair, ...]:
        """Pairs with only one used picture, because the other one is unusable."""
        return tuple(pair for pair in self.pairs if pair.outcome.used and pair.unusable)

    @property
    def sigma(self) -> dict[str, float]:
        """Standard deviation of every parameter of the rig, by name; zero for a fixed parameter."""
        assert self.rig.covariance is not None  # a calibration always has it
        values = np.sqrt(np.maximum(np.diag(self.rig.covariance), 0.0))
        return dict(zip(self.rig.parameter_names, values.tolist(), strict=True))


def all_views(
    detections: tuple[Sequence[object], Sequence[object]], targets: Sequence[Target]
) -> dict[tuple[int, int], list[View]]:
    """(pair, camera) -> its view, once in each equivalent numbering of the target.

    Camera 0 defines the numbering of a pair. If both cameras saw the target, camera 0's view is therefore
    listed in the first numbering only.
    """
    geometries = {id(target): target.geometry() for target in targets}
    views: dict[tuple[int, int], list[View]] = {}
    for camera, pair_views in enumerate(detections):
        for pair, view in enumerate(pair_views):
            if not isinstance(view, Detection):
                continue
            g = geometries[id(targets[pair])]
            if len(view.ids) and (view.ids.min() < 0 or view.ids.max() >= len(g.points)):
                raise ValueError(
                    f"pair {pair}, camera {camera}: ids must lie in 0 to {len(g.points) - 1} for this target"
                )
            numberings = g.equivalents if camera == 1 else g.equivalents[:1]
            views[pair, camera] = [
                View(
                    pair,
                    camera,
                    ids,
                    g.points[ids],
                    g.normals[ids],
                    g.spread[ids],
                    g.bend[ids],
                    view.pixels,
                    view.sigma,
                )
                for ids in (numbering[view.ids] for numbering in numberings)
            ]
    return views


def finished_view(rig: Rig, view: View, used: NDArray[np.bool_]) -> PairView:
    """The record of one view in a solved rig."""
    R, t = rig.poses[view.pair]
    camera = rig.cameras[view.camera]
    expected = project_points(camera, view, R, t)
    return PairView(view.ids, view.pixels, view.sigma, view.pixels - expected, used)


def only(view: View, rows: NDArray[np.bool_]) -> View:
    """A view with some of its points."""
    return View(
        view.pair,
        view.camera,
        view.ids[rows],
        view.points[rows],
        view.normals[rows],
        view.spread[rows],
        view.bend[rows],
        view.pixels[rows],
        view.sigma[rows],
    )
