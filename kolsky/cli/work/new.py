"""An annotated shot.toml to begin with."""

from importlib.resources import files
from pathlib import Path

from kolsky.base.errors import InputError


def template(*, bars: bool = False) -> str:
    """The annotated shot.toml that every new shot begins with; `bars`: that of a test between bars."""
    name = "bars.toml" if bars else "shot.toml"
    return files("kolsky").joinpath("cli", "templates", name).read_text(encoding="utf-8")


def write_template(folder: Path, *, bars: bool = False) -> Path:
    """Write the template into a folder, which is made if it is not there.

    Parameters
    ----------
    folder
        Where to.
    bars
        Whether the test is one between bars with strain gauges, without cameras.

    Returns
    -------
    Path
        The new shot.toml.

    Raises
    ------
    InputError
        If there is a shot.toml already, or the folder cannot be made or written.
    """
    path = folder / "shot.toml"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with path.open("x", encoding="utf-8") as file:
            file.write(template(bars=bars))
    except FileExistsError as error:
        at_fault = path if folder.is_dir() else Path(error.filename)
        raise InputError(
            at_fault, "exists already and is left as it is", cure="edit it, or choose another folder"
        ) from None
    except OSError as error:
        raise InputError(folder, f"cannot be written ({error.strerror})") from None
    return path
