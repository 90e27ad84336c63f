"""Image correlation of a shot: its surfaces, and the session in which its regions are drawn."""

from pathlib import Path

from kolsky.base.errors import InputError
from kolsky.base.files import usable_folder
from kolsky.pictures.correlation import places_of
from kolsky.pictures.measurement import read_measurement
from kolsky.pictures.picture_set import PictureSet
from kolsky.pictures.regions import DRAWABLES_OF_SHOT, Drawn, Session, drawables_of_measurement
from kolsky.schema.pictures import RegionSection, find_measurement_file
from kolsky.schema.shot_file import shot_toml
from kolsky.shot.load import load_pictures
from kolsky.shot.optical_data import Progress, Surfaces, surfaces

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
            "region": [] if dic.region is None else [_drawn_shape(dic.region, dic.reference)],
            "exclude": [_drawn_shape(one, dic.reference) for one in dic.exclude],
        }
        return Session(
            path,
            measurement.series[0],
            drawables_of_measurement(dic.reference),
            _valid_measurement,
            _non_empty(drawn),
        )
    loaded = load_pictures(source)
    section = loaded.pictures.toml.declared.dic
    assert section is not None  # shots with pictures have it
    drawn = {
        "specimen": []
        if section.specimen is None
        else [_drawn_shape(section.specimen, section.specimen.frame)],
        "flyer": [] if section.flyer is None else [_drawn_shape(section.flyer, section.flyer.frame)],
        "transmission_edge": []
        if section.transmission_edge is None
        else [Drawn((section.transmission_edge,), 0)],
    }
    return Session(
        loaded.pictures.toml.path,
        loaded.pictures.series[0],
        DRAWABLES_OF_SHOT,
        _shot_toml_of,
        _non_empty(drawn),
    )


def regions_in_pictures(pictures: PictureSet) -> tuple[dict[str, list[Drawn]], str]:
    """Regions that the shot file does not declare, detected in the pictures, and the method of detection.

    Raises InputError if one of them cannot be detected.
    """
    places = places_of(pictures)
    drawn = {
        "specimen": Drawn(places.specimen.corners, places.specimen.frame),
        "flyer": Drawn(places.flyer.corners, places.flyer.frame),
        "transmission_edge": Drawn((places.edge,), 0),
    }
    return {key: [drawn[key]] for key in places.found}, places.why


def _shot_toml_of(path: Path) -> None:
    """Raise InputError for an invalid shot file, whatever its file name."""
    shot_toml(path)


def _valid_measurement(path: Path) -> None:
    from kolsky.base.toml import read_toml
    from kolsky.schema.pictures import MeasurementFile

    read_toml(path, MeasurementFile)


def _drawn_shape(section: RegionSection, frame: int) -> Drawn:
    return Drawn(section.corners, frame)


def _non_empty(drawn: dict[str, list[Drawn]]) -> dict[str, list[Drawn]]:
    return {key: shapes for key, shapes in drawn.items() if shapes}


def frames_to_show(session: Session) -> tuple[int, ...]:
    """Frames to display: the first, the middle and the last that can be read."""
    n = session.pictures.n_frames
    found = [k for k in dict.fromkeys((0, n // 2, n - 1)) if not isinstance(session.png(k), str)]
    if not found:
        raise InputError(
            session.path,
            "has no frame of camera 0 that can be read",
            cure="copy or export the pictures again",
        )
    return tuple(found)
