"""Where a shot's file is, and which kind of shot it declares."""

from pathlib import Path

from kolsky.base.errors import InputError
from kolsky.shot.schema.bars import AnyFile
from kolsky.shot.schema.reading import read_declared

SHOT_FILE = "shot.toml"


def find_shot_file(path: Path) -> Path:
    """The shot file of a folder, or the file itself."""
    if path.is_dir():
        if not (path / SHOT_FILE).exists():
            raise InputError(path, f"has no {SHOT_FILE}", cure=f"`kolsky new {path}` writes one to fill in")
        return path / SHOT_FILE
    if not path.exists():
        raise InputError(path, "there is no such folder or file", cure="give the folder of a shot")
    return path


def folder_of(folder_or_toml: str | Path) -> Path:
    """The folder of a shot that is named by its folder or its shot file."""
    path = Path(folder_or_toml)
    return path.parent if path.is_file() else path


def is_bar_driven(folder_or_toml: str | Path) -> bool:
    """Whether a shot's motion and force come from the gauges of its bars: [gauges] and no cameras.

    Raises
    ------
    InputError
        If the file cannot be read or is no TOML.
    """
    content = read_declared(find_shot_file(Path(folder_or_toml)), lambda content: AnyFile)[0].content
    return "gauges" in content and not {"flyer", "pictures", "frames"} & set(content)
