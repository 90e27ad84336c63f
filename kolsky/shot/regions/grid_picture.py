"""A picture with a grid in pixel coordinates and the lines to fill in: regions without a page."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dic.opencv import cv2
from kolsky.base.errors import InputError
from kolsky.base.files import filling
from kolsky.shot.regions.session import Session

LINES = 20
"""Lines of the grid across the longer side, about."""
LEAST_SIDE = 1000
"""The picture is enlarged by a whole factor until its longer side has so many pixels."""


def write_grids(folder: Path, session: Session, frames: tuple[int, ...]) -> list[Path]:
    """Write frames with a grid, and regions.toml with the lines to fill in.

    Parameters
    ----------
    folder
        Where to; made if absent.
    session
        The pictures and what can be drawn.
    frames
        Frames that are written.

    Returns
    -------
    list of Path
        The pictures, then the TOML file.

    Raises
    ------
    InputError
        If none of the frames can be read, or nothing can be written.
    """
    names = []
    with filling(folder) as partial:
        said = ""
        for frame in frames:
            found = session.png(frame)
            if isinstance(found, str):
                said = found
                continue
            picture = cv2.imdecode(np.frombuffer(found, np.uint8), cv2.IMREAD_GRAYSCALE)
            assert picture is not None  # it was encoded a line before
            name = f"grid_{frame:04d}.png"
            (partial / name).write_bytes(
                cv2.imencode(".png", with_grid(np.asarray(picture, dtype=np.uint8)))[1].tobytes()
            )
            names.append(name)
        if not names:
            raise InputError(
                session.path,
                f"has no frame that can be shown: {said}",
                cure="copy or export the pictures again",
            )
        (partial / "regions.toml").write_text(snippet(session), encoding="utf-8")
    return [folder / name for name in (*names, "regions.toml")]


def grid_step(longest: int) -> int:
    """Distance of the lines [px]: 1, 2 or 5 times a power of ten, some `LINES` across the longer side."""
    for power in range(6):
        for digit in (1, 2, 5):
            if digit * 10**power * LINES >= longest:
                return int(digit * 10**power)
    return 10**6


def with_grid(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """A picture enlarged, with lines and numbers at round pixel coordinates, shape [rows, columns, 3].

    A line runs through the middle of the pixels whose coordinate it names.
    """
    rows, columns = picture.shape
    factor = max(1, -(-LEAST_SIDE // max(rows, columns)))
    large = cv2.resize(picture, None, fx=factor, fy=factor, interpolation=cv2.INTER_NEAREST)
    drawn = cv2.cvtColor(large, cv2.COLOR_GRAY2BGR)
    step, size = grid_step(max(rows, columns)), 0.5
    for axis, most in ((0, columns), (1, rows)):
        for value in range(0, most, step):
            at = value * factor + factor // 2
            first, last = (at, 0), (at, int(drawn.shape[0]) - 1)
            if axis == 1:
                first, last = (0, at), (int(drawn.shape[1]) - 1, at)
            cv2.line(drawn, first, last, (0, 160, 230), 1)
            place = (at + 3, 14) if axis == 0 else (3, at - 3 if at > 20 else at + 30)
            for colour, width in (((0, 0, 0), 3), ((0, 220, 255), 1)):
                cv2.putText(
                    drawn, str(value), place, cv2.FONT_HERSHEY_SIMPLEX, size, colour, width, cv2.LINE_AA
                )
    return np.asarray(drawn, dtype=np.uint8)


def snippet(session: Session) -> str:
    """Lines for the table [dic]: what the file declares already, and examples of the rest."""
    declared = session.snippet(session.drawn)
    rows, columns = session.pictures.shape
    x, y = columns - 1, rows - 1
    lines = [
        f"# Regions for the table [dic] of {session.path.name}: replace the numbers by those of the grid,",
        "# x to the right and y down, and copy the lines into the file. Corners stand in order around it.",
    ]
    for one in session.wanted:
        lines.append(f"# {one.title}")
        if one.key in declared:
            lines.append(f"{one.key} = {declared[one.key]}")
            continue
        if one.point:
            value = f"[{x // 2}, {y}]"
        else:
            frame = ", frame = 0" if one.framed else ""
            corners = f"[[0, 0], [{x}, 0], [{x}, {y}], [0, {y}]]"
            value = f"{{ polygon = {corners}{frame} }}"
            value = f"[{value}]" if one.many else value
        lines.append(f"# {one.key} = {value}")
    return "\n".join(lines) + "\n"
