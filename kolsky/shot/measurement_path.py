"""Where a measurement by image correlation alone is described: told without a look into the file."""

from pathlib import Path

MEASUREMENT_FILE = "dic.toml"


def measurement_file(source: Path) -> Path | None:
    """The dic.toml that `source` is or holds; None if it is something else.

    A folder with a shot.toml as well is a shot.
    """
    path = Path(source)
    if path.is_dir():
        here = path / MEASUREMENT_FILE
        return here if here.is_file() and not (path / "shot.toml").exists() else None
    return path if path.is_file() and path.name != "shot.toml" and path.suffix == ".toml" else None
