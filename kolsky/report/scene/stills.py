"""The report's stills, rendered in a process of their own while the other figures are drawn.

Where VTK finds nothing to draw with it may take its process with it, so that no page should render in its
own; and pictures that are asked for early are there when the page comes to them.
"""

from __future__ import annotations

import hashlib
import os
import pickle
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from typing import IO, TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from kolsky.report.scene.drawing import quiet, rendered
from kolsky.report.scene.film import chosen
from kolsky.report.scene.stage import NotShown, Stage, stage_of

if TYPE_CHECKING:
    from kolsky.inverse.result import Identification

COUNT = 3
"""Stills of a report."""
SIZE = (800, 480)
"""Of each [px]: 350 dots per inch on the page."""
LONGEST = 120.0
"""Seconds after which the process is given up."""
CHILD = "from kolsky.report.scene.stills import child; child()"


@dataclass(frozen=True)
class Begun:
    """A process at work, and the file that it writes to."""

    process: subprocess.Popen[bytes]
    """The process."""
    output: IO[bytes]
    """Its pictures in the end."""


_begun: dict[str, Begun] = {}
_done: dict[str, NDArray[np.uint8] | None] = {}
_last: tuple[tuple[object, ...], Stage | None] = ((), None)


def begin(result: Identification) -> None:
    """Let another process render the stills of a result, if it holds what they show."""
    stage = shown(result)
    if stage is not None:
        _begin(stage)


def stills(result: Identification) -> tuple[Stage, NDArray[np.uint8]] | None:
    """The stills and what they show.

    Returns
    -------
    tuple or None
        The stage at the times of the stills, and RGB pictures of shape [n, height, width, 3]; None if the
        result does not hold what is drawn, or this machine cannot render.
    """
    stage = shown(result)
    if stage is None:
        return None
    key = _begin(stage)
    if key not in _done:
        _done.clear()  # of one result at a time
        _done[key] = _finished(_begun.pop(key), len(stage.times))
    images = _done[key]
    return None if images is None else (stage, images)


def shown(result: Identification) -> Stage | None:
    """What the stills show; None if the result does not hold it."""
    global _last  # of one result at a time: a page asks for it when it begins, and for every figure
    parts = (result.response, result.comparison, result.provenance)
    if len(_last[0]) != len(parts) or any(a is not b for a, b in zip(_last[0], parts, strict=True)):
        try:
            stage = stage_of(result)
        except NotShown:
            _last = (parts, None)
        else:
            _last = (parts, stage.at(chosen(len(stage.times), COUNT)))
    return _last[1]


def child() -> None:
    """What the other process does: a stage from standard input, its pictures to standard output."""
    stage: Stage = pickle.load(sys.stdin.buffer)  # written by `_begin` of the process above
    pyvista = quiet()
    for k in range(len(stage.times)):
        sys.stdout.buffer.write(rendered(pyvista, stage, k, size=SIZE, bar=False).tobytes())


def _begin(stage: Stage) -> str:
    """The key of a stage whose pictures are on their way, or there."""
    text = pickle.dumps(stage)
    key = hashlib.sha256(text).hexdigest()
    if key in _begun or key in _done:
        return key
    for old in list(_begun):  # of a page that was never written
        _begun[old].process.kill()
        _finished(_begun.pop(old), 0)
    output = tempfile.TemporaryFile()  # noqa: SIM115  # closed by `_finished`; a pipe would have to be emptied
    with tempfile.TemporaryFile() as given:
        given.write(text)
        given.seek(0)
        process = subprocess.Popen(
            [sys.executable, "-c", CHILD],
            stdin=given,
            stdout=output,
            stderr=subprocess.DEVNULL,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)},
        )
    _begun[key] = Begun(process, output)
    return key


def _finished(begun: Begun, count: int) -> NDArray[np.uint8] | None:
    """The pictures, None if the process ended otherwise."""
    try:
        ended = begun.process.wait(LONGEST)
    except subprocess.TimeoutExpired:
        begun.process.kill()
        ended = begun.process.wait()
    with begun.output as output:
        output.seek(0)
        values = np.frombuffer(output.read(), dtype=np.uint8)
    shape = (count, SIZE[1], SIZE[0], 3)
    return values.reshape(shape) if ended == 0 and values.size == np.prod(shape) else None
