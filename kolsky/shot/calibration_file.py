"""A description of calibration pictures and their target: calibration.toml, or the table of a shot.toml."""

from pathlib import Path

from kolsky.base.errors import InputError
from kolsky.shot.schema.pictures import CalibrationSection
from kolsky.shot.schema.reading import TomlFile, parse_toml, shot_toml
from kolsky.shot.schema.section import Section

NAMES = ("calibration.toml", "shot.toml")
"""Files that are looked for in a folder, in this order."""


class CalibrationFile(Section):
    """A whole calibration.toml."""

    calibration: CalibrationSection


def read_calibration_toml(source: Path) -> tuple[TomlFile, CalibrationSection]:
    """The description of calibration pictures and their target.

    Parameters
    ----------
    source
        A calibration.toml, a shot.toml, or a folder with one of them.

    Raises
    ------
    InputError
        If there is none, it declares anything unknown, incomplete or impossible, or it names a finished
        calibration in place of pictures.
    """
    path = Path(source)
    if path.is_dir():
        there = [path / name for name in NAMES if (path / name).is_file()]
        if not there:
            raise InputError(
                path,
                f"has neither {NAMES[0]} nor {NAMES[1]}",
                cure="describe pictures and target in one of them",
            )
        path = there[0]
    if path.name == NAMES[1]:
        shot = shot_toml(path)
        toml: TomlFile = shot
        section = shot.declared.calibration
        if section is None:
            raise InputError(path, "has no table [calibration]", cure="add it, with pictures and target")
    else:
        toml = parse_toml(path)
        section = toml.validated(CalibrationFile).calibration
    if section.file is not None:
        raise toml.error(
            "calibration.file", "is a calibration that is finished", cure="name pictures and target instead"
        )
    return toml, section
