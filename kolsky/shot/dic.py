"""The surfaces of a shot with pictures, from its shot file."""

from pathlib import Path

from kolsky.base.files import usable_folder
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
    """Correlate the pictures of a shot, or read back what they gave: what `kolsky dic` does before it writes.

    Parameters
    ----------
    shot
        A shot's folder, or its shot.toml.
    results
        Where its file is or will be; by default the folder "results" of the shot.
    device, again, progress
        As in `kolsky.shot.optical_data.surfaces`.

    Raises
    ------
    InputError
        If the shot cannot be used or has no pictures, the cameras cannot be calibrated, or nothing can be
        measured.
    """
    pictures = load_pictures(shot).pictures
    place = usable_folder(results or pictures.toml.path.parent / "results")
    return surfaces(pictures, place, device=device, again=again, progress=progress)
