"""Image correlation of a shot: its surfaces, and the session in which its regions are drawn."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

from dic.bodies.region import Region
from kolsky.base.files import usable_folder
from kolsky.base.toml import read_toml
from kolsky.pictures.correlation import places_of, region_of
from kolsky.pictures.measurement import read_measurement
from kolsky.pictures.picture_set import PictureSet, Progress
from kolsky.pictures.regions import DRAWABLES_OF_SHOT, Session, drawables_of_measurement
from kolsky.schema.pictures import MeasurementFile, find_measurement_file
from kolsky.schema.shot_file import shot_toml
from kolsky.shot.load import load_pictures
from kolsky.shot.optical_data import Surfaces, surfaces

__all__ = ["dic"]


def dic(
    shot: str | Path,
    *,
    results: Path | None = None,
    device: str = "cpu",
    again: bool = False,
    progress: Progress = lambda stage, done, total: None,
) -> Surfaces:
    """Correlate the pictures of a shot, or read a stored result.

    `kolsky dic` calls this function and writes tables.

    Parameters
    ----------
    shot
        A shot's folder, or its shot.toml.
    results
        Folder of the result file; by default the folder "results" of the shot.
    device, again, progress
        As in `kolsky.shot.optical_data.surfaces`.

    Raises
    ------
    InputError
        If the shot cannot be used or has no pictures; if the cameras cannot be calibrated; or if nothing can
        be measured.
    """
    pictures = load_pictures(shot).pictures
    place = usable_folder(results or pictures.toml.path.parent / "results")
    return surfaces(pictures, place, device=device, again=again, progress=progress)


def open_region_session(source: Path) -> Session:
    """Open the pictures of camera 0 and their declared regions.

    ``source``: folder or file of a shot with pictures, or of a dic.toml. Raises InputError if the file or its
    pictures cannot be used.
    """
    path = find_measurement_file(source)
    if path is not None:
        measurement = read_measurement(path)
        dic = measurement.declared.dic
        drawn = {
            "region": [] if dic.region is None else [Region(dic.region.corners, dic.reference)],
            "exclude": [Region(one.corners, dic.reference) for one in dic.exclude],
        }
        wanted, series = drawables_of_measurement(dic.reference), measurement.series[0]
        check: Callable[[Path], object] = partial(read_toml, schema=MeasurementFile)
    else:
        pictures = load_pictures(source).pictures
        section = pictures.toml.declared.dic
        assert section is not None  # shots with pictures have it
        bodies = {"specimen": section.specimen, "flyer": section.flyer}
        drawn = {key: [region_of(one)] for key, one in bodies.items() if one is not None}
        if section.transmission_edge is not None:
            drawn["transmission_edge"] = [Region((section.transmission_edge,))]
        path, wanted, series, check = pictures.toml.path, DRAWABLES_OF_SHOT, pictures.series[0], shot_toml
    return Session(path, series, wanted, check, {key: shapes for key, shapes in drawn.items() if shapes})


def regions_in_pictures(pictures: PictureSet) -> tuple[dict[str, list[Region]], str]:
    """Regions that the shot file does not declare, detected in the pictures, and the method of detection.

    Raises InputError if one of them cannot be detected.
    """
    places = places_of(pictures)
    drawn = {"specimen": places.specimen, "flyer": places.flyer, "transmission_edge": Region((places.edge,))}
    return {key: [drawn[key]] for key in places.found}, places.why
