"""Remarks on the test and its declarations, in sentences with numbers and cures."""

from collections.abc import Iterable

import numpy as np

from dic.arrays import IntArray
from dic.bodies.follow import TrackedBody
from dic.bodies.region import Region
from dic.outcome import FrameOutcome, PointOutcome, Remark
from dic.result import Placement
from dic.rigid_body.axial_displacement import AxialDisplacement
from dic.stereo.diagnose import Finding

RADIUS_SIGMAS = 4.0
"""Disagreement of the measured radius with the declared one that is remarked on, in standard deviations."""
RADIUS_SHARE = 0.01
"""And as a share of it: below this a calibration or a calliper explains it."""


def of_findings(findings: Iterable[Finding]) -> list[Remark]:
    """Remarks on faults that the epipolar distances show."""
    return [
        Remark(name=finding.fault.name.lower().replace("_", " "), text=finding.what, cure=finding.cure)
        for finding in findings
    ]


def of_radius(placement: Placement, declared: float | None) -> list[Remark]:
    """Remark on a measured radius at rest that is not the declared one."""
    if declared is None:
        return []
    off = placement.radius - declared
    if abs(off) <= max(RADIUS_SIGMAS * placement.radius_sigma, RADIUS_SHARE * declared):
        return []
    return [
        Remark(
            name="another radius",
            text=(
                f"the specimen at rest has a radius of {1e3 * placement.radius:.4f} ± "
                f"{2e3 * placement.radius_sigma:.4f} mm (k = 2), declared are {1e3 * declared:.4f} mm"
            ),
            cure="measure the specimen again; check the calibration's unit and target, and the region",
        )
    ]


def of_edge(cameras: int) -> list[Remark]:
    """Remark on an end of the specimen that was not found in the pictures."""
    if cameras:
        return []
    return [
        Remark(
            name="no edge",
            text="the specimen's end at the transmission platen was found in neither camera within two "
            "pixels of the declared place, which is used as it is",
            cure="declare it more closely; an error of a tenth of a pixel shifts all heights y by as much",
        )
    ]


def of_flyer(wanted: bool, axial: AxialDisplacement | None) -> list[Remark]:
    """Remark on a flyer whose place at rest is not known, or is not seen."""
    if wanted and axial is not None and axial.from_rim:
        known = 1e6 * axial.rest_sigma
        return [
            Remark(
                name="rest from the flyer's rim",
                text="no static frame shows enough of the flyer; its place at rest follows from the "
                f"specimen's declared length and the rim of its face in later frames, to {known:.1f} µm",
                cure="nothing to do; a few rows of the flyer in view at rest tell it to a micrometre",
            )
        ]
    if not wanted or axial is not None:
        return []
    return [
        Remark(
            name="no displacement of the flyer",
            text="the flyer was seen by both cameras in no frame, or neither at rest nor with the rim of its "
            "face clear in enough frames",
            cure="declare a region of it, clear of its edge, in a frame that shows much of it",
        )
    ]


def of_rim(past: float, narrower: bool) -> list[Remark]:
    """Remark on a region of the flyer that reaches `past` px past the rim of its face [px]; `narrower`: the
    flyer was followed by what lies before it."""
    if past <= 0.0:
        return []
    return [
        Remark(
            name="region of the flyer past its rim",
            text=f"the region of the flyer reaches {past:.1f} px past the rim of its face, where the face or "
            "the specimen is seen, and no longer its side; "
            + ("what lies past it was left out" if narrower else "too little of it lies before the rim"),
            cure="nothing to do; a region that ends before the rim is used as it is"
            if narrower
            else "declare a region of it, clear of its edge, in a frame that shows more of it",
        )
    ]


def of_missing_points(outcome: IntArray) -> list[Remark]:
    """Remark on points that both cameras found in no static frame, given their outcomes."""
    if outcome.size == 0:
        return []
    ends = _counted(outcome)
    words = ", ".join(f"{count} {_words(end.name)}" for end, count in ends)
    most = max(ends, key=lambda pair: pair[1])[0]
    return [
        Remark(
            name="points without a place at rest",
            text=f"{outcome.size} points of the region were found by both cameras in no static frame: "
            f"{words}",
            cure=most.cure,
        )
    ]


def of_uncertain_rows(count: int, largest: float | None) -> list[Remark]:
    """Remark on rows of the outline that were left out for their sigma."""
    if not count or largest is None:
        return []
    return [
        Remark(
            name="uncertain rows",
            text=f"{count} rows of the outline, over all frames, have a sigma above {1e6 * largest:.3g} µm "
            "and are left out of it",
            cure="nothing to do; a larger sigma lets them in",
        )
    ]


def of_frames(health: tuple[IntArray, IntArray]) -> list[Remark]:
    """Remarks on pictures that could not be used, camera by camera and kind by kind."""
    found = []
    for camera, outcome in enumerate(health):
        for kind in FrameOutcome:
            frames = np.flatnonzero(outcome == kind)
            if kind.ok or not frames.size:
                continue
            listed = ", ".join(str(frame) for frame in frames[:10]) + (
                " and more" if frames.size > 10 else ""
            )
            found.append(
                Remark(
                    name=f"{_words(kind.name)} pictures",
                    text=f"camera {camera}, frame {listed} (counted from 0): {kind.cause}",
                    cure=kind.cure,
                )
            )
    return found


def of_material(body: TrackedBody, region: Region) -> list[Remark]:
    """Remark on a material picture that is not the declared one."""
    if body.material == region.frame:
        return []
    return [
        Remark(
            name="another reference",
            text=f"the region is declared in frame {region.frame}, which cannot be used; points were "
            f"chosen in frame {body.material}",
            cure="see that the body lies in the region there too",
        )
    ]


def _counted(outcome: IntArray) -> list[tuple[PointOutcome, int]]:
    numbers, counts = np.unique(outcome, return_counts=True)
    return [(PointOutcome(int(number)), int(count)) for number, count in zip(numbers, counts, strict=True)]


def _words(name: str) -> str:
    return name.lower().replace("_", " ")
