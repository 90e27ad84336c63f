"""Films and still pictures of a scene; every file is replaced when the new one is complete."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dic.files import replacing
from kolsky.report.scene.drawing import picture
from kolsky.report.scene.scene_data import Scene

Progress = Callable[[int], None]
FILMS = ("mp4", "gif")
"""Formats of a film."""


def write_film(
    path: Path, scene: Scene, *, every: int = 1, rate: float = 25.0, progress: Progress = lambda n: None
) -> Path:
    """Write the deformation as a film; arguments and errors as of `write_frames`, ``scene`` to show."""
    frames = range(len(scene.times))
    return write_frames(path, lambda k: picture(scene, k), frames, every=every, rate=rate, progress=progress)


def write_frames(
    path: Path,
    draw: Callable[[int], NDArray[np.uint8]],
    frames: Sequence[int],
    *,
    every: int = 1,
    rate: float = 25.0,
    progress: Progress = lambda n: None,
) -> Path:
    """Write pictures as a film.

    ``path``: file to write; its suffix gives the format, one of `FILMS`. ``draw``: returns the picture of a
    frame, shape [height, width, 3]. ``every``: take one frame in this many, the first included. ``rate``:
    frame rate of the film [1/s]. ``progress``: called with 1 after each picture. Raises ValueError if the
    format is unknown, or `every` or `rate` is not positive. Raises ImportError if the package that writes
    films is not installed; the message says how to get it.
    """
    path = Path(path)
    kind = path.suffix.lstrip(".").lower()
    if kind not in FILMS:
        raise ValueError(f"format {kind!r} is not one of {', '.join(FILMS)}")
    if every < 1 or not rate > 0.0:
        raise ValueError(f"every must be at least 1 and rate positive, got {every} and {rate}")
    writer = writer_for(kind)
    path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(path) as partial, writer(partial, rate) as film:
        for k in frames[::every]:
            film.append_data(draw(k))
            progress(1)
    return path


def write_stills(folder: Path, scene: Scene, count: int = 6) -> list[Path]:
    """Write `count` pictures at equal intervals of time as PNG files and return their paths."""
    if count < 1:
        raise ValueError(f"count must be at least 1, got {count}")
    import matplotlib.image

    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for k in evenly_spaced(len(scene.times), count):
        path = folder / f"still_{k:05d}.png"
        with replacing(path) as partial:
            matplotlib.image.imsave(partial, picture(scene, k), format="png")
        written.append(path)
    return written


def evenly_spaced(n: int, count: int) -> Sequence[int]:
    """Indices of `count` of n pictures at equal intervals, first and last included."""
    return sorted({int(k) for k in np.round(np.linspace(0, n - 1, min(count, n)))})


def writer_for(kind: str) -> Callable[[Path, float], Any]:
    """Return the function that opens a film for writing.

    Raises ImportError if imageio, or for "mp4" imageio-ffmpeg, is not installed.
    """
    try:
        import imageio.v2 as imageio

        if kind == "mp4":
            import imageio_ffmpeg  # noqa: F401
    except ImportError as error:
        raise ImportError(f"films need the package {error.name}: pip install 'kolsky[film]'") from None
    if kind == "mp4":
        return lambda path, rate: imageio.get_writer(
            path, format="FFMPEG", mode="I", fps=rate, codec="libx264", pixelformat="yuv420p", quality=8
        )
    return lambda path, rate: imageio.get_writer(path, format="GIF", mode="I", duration=1e3 / rate, loop=0)
