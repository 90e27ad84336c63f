"""Error of the flyer's zero over its stated sigma, on random rigs: `python -m populations.flyer_zero --out
FOLDER`.

Each experiment draws a shot of the population of `runs/virtual/forty.toml` with a separate seed. It simulates
the shot on a coarse mesh and renders both series with the true cameras. Then it finds the regions, tracks the
flyer, and compares its displacement with the truth. There is no identification. The folder stores the
pictures and the answer of each experiment. A missing answer is measured from the stored pictures.
"""

import json
import time
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dic.bodies.region import find_regions
from dic.camera import StereoRig
from dic.chain.follow_bodies import (
    clear_of_rim,
    displacement_of,
    follow,
    follow_before_rim,
    match_flyer,
    match_specimen,
    rim_in,
    translations_of,
)
from dic.chain.inputs import ChainSettings, inspect_pictures
from dic.chain.test_frame import fit_test_frame
from dic.correlation import Correlation, Shape
from dic.images import frame_health
from dic.images.series import PicturesInMemory
from dic.outcome import FrameOutcome
from dic.result import Placement
from dic.tracking import Tracking
from kolsky.cli.texts import whole_numbers
from kolsky.pictures.specimen_length import conditioned_length, rim_of
from kolsky.virtual.pictures import expose_series, rig_of, scene_of
from kolsky.virtual.schema import Specification
from kolsky.virtual.specification import Series
from kolsky.virtual.truth import SurfaceHistory, simulate_truths
from populations.driver import answers, command, population

SPEC = Path(__file__).parents[1] / "runs" / "virtual" / "forty.toml"
STRIP = 0.6e-3
LATE = 10
"""Number of frames over which the error of the zero is averaged. They are the frames with the most points."""


@dataclass(frozen=True)
class Study:
    """Settings of all experiments."""

    out: str
    seed: int
    mesh: tuple[int, int] = (16, 22)
    rate: float = 40e3
    changes: str = ""
    """Further tables of the specification, as JSON."""


@dataclass(frozen=True)
class Experiment:
    """One experiment; lengths in metres."""

    number: int
    share: float
    """Share of the flyer that is visible at rest."""
    pixel: float
    """Length of a pixel."""
    why: str = ""
    """Reason why there is no zero, or how the regions were found."""
    error: float | None = None
    """Error of the displacement in the frames with the most points."""
    sigma: float | None = None
    """Stated standard deviation of the zero."""
    from_rim: bool = False
    lower_error: float | None = None
    """Error of the position of the specimen's lower end along the axis."""
    lower_sigma: float | None = None
    length_error: float = 0.0
    """Declared minus true length."""
    length_seen: tuple[float, float] | None = None
    """Length in the pictures minus the true length, and its stated standard deviation."""
    length_used: tuple[float, float] | None = None
    """The same two numbers for the used length."""
    seconds: float = 0.0


def series_of(study: Study) -> Series:
    """The population with the study's seed, mesh and rate."""
    tables = {
        "truth": {"mesh": list(study.mesh)},
        "frames": {"rate": f"{study.rate:g} Hz", "static": 6},
        "optics": {"rays": 3},
        "scope": {"interval": "2 us"},
        **(json.loads(study.changes) if study.changes else {}),
    }
    if draw := tables.pop("population.draw", None):
        tables["population"] = {"draw": {**population(SPEC).file.content["population"]["draw"], **draw}}
    return population(SPEC, seed=study.seed, **tables)


def pictures_of(q: Specification, number: int, surface: SurfaceHistory) -> list[NDArray[np.uint16]]:
    """Both series."""
    rig, scene = rig_of(q, shot=number), scene_of(q, surface, shot=number)
    series = [np.stack(list(expose_series(q, scene, rig.camera(k), k, number, "cpu", 1))) for k in (0, 1)]
    if q.cameras.format == "png":
        return [(pictures >> (q.optics.bits - 8)).astype(np.uint16) for pictures in series]
    return series


def in_rig_frame(rig: StereoRig) -> StereoRig:
    """The rig with poses in the frame of camera 0, as in a calibration."""
    R, t = rig.relative
    first, second = rig.cameras
    first = replace(first, rotation=np.eye(3), translation=np.zeros(3))
    return replace(rig, cameras=(first, replace(second, rotation=R, translation=t)))


def prepared(study: Study, number: int) -> tuple[Specification, SurfaceHistory, list[NDArray[np.uint16]]]:
    """Specification, true surface and pictures of an experiment; the pictures are stored."""
    shot = series_of(study).shot(number)
    q = shot.quantities
    kept = Path(study.out) / f"{number:03d}.npz"
    if kept.exists():
        stored = np.load(kept)
        surface = SurfaceHistory(*(stored[name] for name in ("time", "r", "y", "displacement", "tilt")))
        return q, surface, [stored["cam0"], stored["cam1"]]
    surface = simulate_truths([q], folder=shot.folder, threads=1)[0].surface
    pictures = pictures_of(q, number, surface)
    np.savez(kept, **vars(surface), cam0=pictures[0], cam1=pictures[1])
    return q, surface, pictures


def measured(
    q: Specification, number: int, surface: SurfaceHistory, grey: list[NDArray[np.uint16]]
) -> Experiment:
    """Measure the flyer's zero in the pictures, and compare it with the truth."""
    started = time.perf_counter()
    length_error = q.specimen.length * q.imperfections.length
    result = Experiment(number, q.cameras.flyer_share, q.cameras.pixel, length_error=length_error)
    bits = 8 if q.cameras.format == "png" else q.optics.bits
    pictures = (PicturesInMemory(grey[0], bits), PicturesInMemory(grey[1], bits))
    n, static = len(surface.time), np.arange(len(surface.time)) < q.frames.static
    usable = np.ones(n, dtype=bool)
    for series in pictures:
        usable &= frame_health(series).outcome == FrameOutcome.VALID
    try:
        regions = find_regions(pictures[0], static, usable, toward=q.cameras.flyer_side)
    except ValueError as error:
        return replace(result, why=f"no regions: {error}")
    made = rig_of(q, shot=number)
    rig = in_rig_frame(made.stereo).cropped(*made.crops)
    subset = Correlation(
        subset=int(np.clip(2 * round(2.0 * q.speckle.size) + 1, 15, 41)), shape=Shape.QUADRATIC
    )
    settings = ChainSettings(
        toward_flyer=q.cameras.flyer_side,
        zero=regions.edge,
        strip_half_width=STRIP,
        radius=0.5 * q.specimen.diameter * (1.0 + q.imperfections.diameter),
        length=q.specimen.length + length_error,
        length_sigma=1e-3 * q.specimen.length,
        tracking=Tracking(correlation=subset),
        stereo=subset,
    )
    try:
        inputs = inspect_pictures(pictures, static).with_cameras(rig, settings, surface.time, static)
        few = int(q.frames.static)
        rest = (PicturesInMemory(grey[0][:few], bits), PicturesInMemory(grey[1][:few], bits))
        still = inspect_pictures(rest, static[:few]).with_cameras(
            rig, settings, surface.time[:few], static[:few]
        )
        flyer = follow(inputs, [match_flyer(inputs, regions.flyer)])[0]
        placement = fit_test_frame(
            still, follow(still, [match_specimen(still, regions.specimen)])[0], flyer
        ).placement
        rim = rim_in(inputs, flyer, placement)
        before, past = clear_of_rim(inputs, flyer, placement, rim)
        narrower = follow_before_rim(inputs, regions.flyer, before) if past > 0.0 else None
        if narrower is not None:
            flyer, rim = narrower, rim_in(inputs, narrower, placement)
        axial = displacement_of(inputs, flyer, placement, rim, translations_of(inputs, flyer, placement))
    except ValueError as error:
        return replace(result, why=f"refused: {error}")
    first = made.stereo.cameras[0]
    seen = first.rotation.T @ (
        placement.frame.in_rig(np.array([[0.0, 0.0, settings.radius or 0.0]]))[0] - first.translation
    )
    result = replace(
        result,
        lower_error=float(seen[1]),
        lower_sigma=float(np.sqrt(placement.frame.covariance[4, 4])),
        why=regions.why,
        seconds=time.perf_counter() - started,
    )
    if axial is None:
        return replace(result, why="not followed back to rest")
    if axial.rim_disagreement is not None:
        result = with_lengths(result, q.specimen.length, settings, placement, axial.rim_disagreement)
    off = axial.displacement - surface.displacement[axial.frame]
    best = np.argsort(axial.n_points)[-LATE:]
    return replace(result, error=float(np.mean(off[best])), sigma=axial.rest_sigma, from_rim=axial.from_rim)


def with_lengths(
    result: Experiment,
    true: float,
    settings: ChainSettings,
    placement: Placement,
    disagreement: tuple[float, float],
) -> Experiment:
    """The experiment with the errors of the length in the pictures and of the used length."""
    lower = float(placement.frame.covariance[4, 4])  # the rig is the true one: no calibration error
    rim = rim_of(disagreement, length_sigma=settings.length_sigma, lower_variance=lower)
    length = conditioned_length(
        rim, declared=settings.length or 0.0, sigma=settings.length_sigma, y_sigma=float(np.sqrt(lower))
    )
    return replace(
        result,
        length_seen=(length.pictures - true, length.pictures_sigma),
        length_used=(length.used - true, length.used_sigma),
    )


def one(study: Study, number: int) -> dict[str, Any]:
    """Run one experiment; returns the fields of `Experiment`."""
    q, surface, pictures = prepared(study, number)
    return asdict(measured(q, number, surface, pictures))


def words(e: Experiment) -> str:
    """One line on an experiment."""
    um = 1e6
    place = f"{e.number:3d}  {e.share * 100:5.1f} %  {um * e.pixel:4.0f} um/px"
    lower = ""
    if e.lower_error is not None:
        lower = f"  lower {um * e.lower_error:6.2f} ({um * (e.lower_sigma or 0.0):.2f})"
    if e.error is None:
        return f"{place}{lower}  {e.why[:90]}"
    length = f"  L {um * e.length_error:6.2f}"
    if e.length_seen is not None and e.length_used is not None:
        seen, used = e.length_seen, e.length_used
        length += (
            f" seen {um * seen[0]:6.2f} ({um * seen[1]:.2f}) used {um * used[0]:6.2f} ({um * used[1]:.2f})"
        )
    zero = f"  {'rim' if e.from_rim else '   '} zero {um * e.error:7.2f} ({um * (e.sigma or 0.0):.2f})"
    return f"{place}{lower}{length}{zero}  {e.seconds:.0f} s"


def main() -> None:
    """Run the missing experiments and print a table."""
    parser = command(__doc__, seed=1)
    parser.add_argument("--only", default="1-12")
    parser.add_argument("--changes", default="")
    given = parser.parse_args()
    study = Study(str(given.out), given.seed, changes=given.changes)
    given.out.mkdir(parents=True, exist_ok=True)
    numbers = whole_numbers("--only", given.only)
    jobs = {given.out / f"{number:03d}.json": (study, number) for number in numbers}
    found = [Experiment(**fields) for fields in answers(one, jobs, workers=given.workers)]
    for experiment in found:
        print(words(experiment))
    print(json.dumps(scatter(found), indent=1))


def scatter(results: list[Experiment]) -> dict[str, float | int]:
    """Root mean square of the errors over their stated standard deviations, which is 1 if these are correct,
    and of the lengths' errors."""

    def rms(values: Any, scale: float = 1.0) -> float:
        return round(scale * float(np.sqrt(np.mean(np.square(values)))), 3) if len(values) else 0.0

    zero = [e.error / e.sigma for e in results if e.error is not None and e.sigma]
    lower = [e.lower_error / e.lower_sigma for e in results if e.lower_error is not None and e.lower_sigma]
    lengths = [e for e in results if e.length_seen is not None and e.length_used is not None]
    said: dict[str, float | int] = {
        "experiments": len(results),
        "with a zero": len(zero),
        "zero over sigma": rms(zero),
        "lower end over sigma": rms(lower),
        "with a length": len(lengths),
    }
    if not lengths:
        return said
    seen, used = np.array([e.length_seen for e in lengths]), np.array([e.length_used for e in lengths])
    return said | {
        "declared length, um": rms([e.length_error for e in lengths], 1e6),
        "length in the pictures, um": rms(seen[:, 0], 1e6),
        "length in the pictures over sigma": rms(seen[:, 0] / seen[:, 1]),
        "length used, um": rms(used[:, 0], 1e6),
        "length used, stated, um": rms(used[:, 1], 1e6),
        "length used over sigma": rms(used[:, 0] / used[:, 1]),
    }


if __name__ == "__main__":
    main()
