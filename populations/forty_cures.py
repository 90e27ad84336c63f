"""Remedies for a rejected random shot: the actions that its message recommends to a user."""

import json
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kolsky.base.arrays import FloatArray
from kolsky.base.toml import with_values
from kolsky.virtual.make import SURFACE, TRUTH
from kolsky.virtual.schema import Specification

CLEAR = 4.0
"""Distance of a declared region from the edges of the body and of the picture [px]."""
LEAST = 8.0
"""Smallest height of such a region [px]."""


@dataclass(frozen=True)
class View:
    """The view of camera 0 of a synthetic shot."""

    specification: Specification
    camera: dict[str, list[list[float]]]
    """Its matrix K, its pose R and t, and its crop."""
    last_face: float
    """Height of the flyer's face over the transmission platen in the last frame [m]."""

    @classmethod
    def of(cls, folder: Path) -> "View | None":
        """None for a shot without pictures."""
        answer = json.loads((folder / TRUTH).read_text("utf-8"))
        if "cameras" not in answer:
            return None
        q = Specification.model_validate(answer["specification"])
        with np.load(folder / SURFACE) as kept:
            return cls(q, answer["cameras"][0], q.specimen.length - float(kept["d"][-1]))

    def pixel(self, y: float, z: float = 0.0) -> FloatArray:
        """Pixel (x, y) of a point at height y on the axis, or at a distance z from it toward the cameras."""
        R, t, K = (np.array(self.camera[name]) for name in ("R", "t", "K"))
        ahead = R @ [0.0, y, z] + t
        return np.asarray((K @ (ahead / ahead[2]))[:2] - np.array(self.camera["crop_offset"]))

    @property
    def radii(self) -> tuple[float, float]:
        """Radii of specimen and platens [m]."""
        q = self.specification
        return 0.5 * q.specimen.diameter, 0.5 * q.motion.flyer_diameter

    def lower_edge(self) -> FloatArray:
        """Pixel (x, y) of the specimen's lower end, or of the platen's rim if the rim hides the end."""
        places = [self.pixel(0.0, z) for z in self.radii]
        side = self.specification.cameras.flyer_side
        axis, way = int(side in ("up", "down")), -1.0 if side in ("up", "left") else 1.0
        return max(places, key=lambda place: way * float(place[axis]))

    def rectangle(self, low: float | None, high: float | None) -> tuple[list[float], list[float]] | None:
        """A rectangle, as ranges of x and y [px], inside the picture and between the heights `low` and `high`
        above the transmission platen [m]. A height of None: up to the edge of the picture. Returns None if
        the rectangle is too flat."""
        columns, rows = self.specification.cameras.picture
        side = self.specification.cameras.flyer_side
        x, y = [CLEAR, columns - 1 - CLEAR], [CLEAR, rows - 1 - CLEAR]
        along, axis = (y, 1) if side in ("up", "down") else (x, 0)
        up = side in ("up", "left")  # the flyer is at small pixel coordinates
        for height, inward in ((low, -1.0), (high, 1.0)):
            if height is None:
                continue
            way = inward if up else -inward
            seen = [way * float(self.pixel(height, z)[axis]) for z in (0.0, *self.radii)]
            place = way * max(seen) + way * CLEAR
            k = 0 if way > 0.0 else 1
            along[k] = max(along[k], place) if k == 0 else min(along[k], place)
        return None if along[1] - along[0] < LEAST else (x, y)


def flyer_region(text: str, folder: Path) -> str | None:
    """Declare a region of the flyer in the last frame, as a user would who looks at the picture."""
    view = View.of(folder)
    if view is None or "flyer = {" in text:
        return None
    region = view.rectangle(view.last_face, None)
    return None if region is None else with_values(text, "dic", {"flyer": _toml(region, _last_frame(folder))})


def all_regions(text: str, folder: Path) -> str | None:
    """Declare flyer, specimen and the specimen's lower end, as `kolsky dic --regions` requests."""
    view = View.of(folder)
    if view is None or "specimen = {" in text:
        return None
    flyer = view.rectangle(view.last_face, None)
    specimen = view.rectangle(0.0, view.specification.specimen.length)
    if flyer is None or specimen is None:
        return None
    x, y = view.lower_edge()
    regions = {"specimen": _toml(specimen, 0), "flyer": _toml(flyer, _last_frame(folder))}
    return with_values(text, "dic", {**regions, "transmission_edge": f"[{x:.1f}, {y:.1f}]"})


def _toml(region: tuple[list[float], list[float]], frame: int) -> str:
    ranges = [", ".join(f"{value:.1f}" for value in pair) for pair in region]
    return f"{{ x = [{ranges[0]}], y = [{ranges[1]}], frame = {frame} }}"


def _last_frame(folder: Path) -> int:
    return len((folder / "frames.csv").read_text("utf-8").splitlines()) - 2


def with_subset(share: float) -> Callable[[str, Path], str | None]:
    """Correlate with subsets of a different size. The size is odd and within the limits of a shot file."""

    def changed(text: str, folder: Path) -> str | None:
        found = re.search(r"^subset = (\d+)$", text, re.MULTILINE)
        if found is None:
            return None
        size = int(np.clip(2 * round(0.5 * (share * int(found[1]) - 1.0)) + 1, 11, 51))
        return text.replace(found[0], f"subset = {size}", 1)

    return changed


def true_inputs(text: str, folder: Path) -> str:
    """Declare the true length, diameter, density and sensitivity. A remaining error then comes from the
    measurement or the program."""
    q = json.loads((folder / TRUTH).read_text("utf-8"))["specification"]
    sizes = {key: f'"{q["specimen"][key]}"' for key in ("diameter", "length", "density")}
    sensitivity = f'"{q["transmitted"]["sensitivity"]}"'
    return with_values(with_values(text, "specimen", sizes), "force", {"sensitivity": sensitivity})


CURES: dict[str, Callable[[str, Path], str | None]] = {
    "a region of the flyer": flyer_region,
    "all regions by hand": all_regions,
    "larger subsets": with_subset(1.4),
    "smaller subsets": with_subset(0.7),
}
"""Remedies for a shot whose pictures were rejected. They are tried in this order, one at a time."""
FINER_MESH = "a finer mesh"
"""First remedy for a rejected value: a finer mesh of the search."""
