"""Regions by hand of a shot, or of a measurement by image correlation alone."""

from pathlib import Path

from kolsky.base.errors import InputError
from kolsky.shot.load import load_pictures
from kolsky.shot.measurement import read_measurement
from kolsky.shot.measurement_path import measurement_file
from kolsky.shot.regions.session import Session
from kolsky.shot.regions.shapes import SHOT, Drawn, alone
from kolsky.shot.schema.pictures import RegionSection
from kolsky.shot.schema.reading import shot_toml


def open_session(source: Path) -> Session:
    """Open the pictures of camera 0 and what the file declares of their regions.

    Parameters
    ----------
    source
        Folder or file of a shot with pictures, or of a dic.toml.

    Raises
    ------
    InputError
        If the file or its pictures cannot be used.
    """
    path = measurement_file(source)
    if path is not None:
        measurement = read_measurement(path)
        dic = measurement.declared.dic
        drawn = {
            "region": [] if dic.region is None else [_drawn(dic.region, dic.reference)],
            "exclude": [_drawn(one, dic.reference) for one in dic.exclude],
        }
        return Session(path, measurement.series[0], alone(dic.reference), _valid_measurement, _given(drawn))
    loaded = load_pictures(source)
    section = loaded.pictures.toml.declared.dic
    assert section is not None  # shots with pictures have it
    drawn = {
        "specimen": [] if section.specimen is None else [_drawn(section.specimen, section.specimen.frame)],
        "flyer": [] if section.flyer is None else [_drawn(section.flyer, section.flyer.frame)],
        "transmission_edge": []
        if section.transmission_edge is None
        else [Drawn((section.transmission_edge,), 0)],
    }
    return Session(loaded.pictures.toml.path, loaded.pictures.series[0], SHOT, shot_toml_of, _given(drawn))


def shot_toml_of(path: Path) -> None:
    """Refuse a shot file that is not valid; its name does not matter."""
    shot_toml(path)


def _valid_measurement(path: Path) -> None:
    from kolsky.shot.schema.full_field import MeasurementFile
    from kolsky.shot.schema.reading import parse_toml

    parse_toml(path).validated(MeasurementFile)


def _drawn(section: RegionSection, frame: int) -> Drawn:
    return Drawn(section.corners, frame)


def _given(drawn: dict[str, list[Drawn]]) -> dict[str, list[Drawn]]:
    return {key: shapes for key, shapes in drawn.items() if shapes}


def frames_to_show(session: Session) -> tuple[int, ...]:
    """Frames for a grid: the first, the middle and the last that can be read."""
    n = session.pictures.n_frames
    found = [k for k in dict.fromkeys((0, n // 2, n - 1)) if not isinstance(session.png(k), str)]
    if not found:
        raise InputError(
            session.path,
            "has no frame of camera 0 that can be read",
            cure="copy or export the pictures again",
        )
    return tuple(found)
