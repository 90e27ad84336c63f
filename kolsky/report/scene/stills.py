"""Still pictures of the report, rendered in a separate process while the other figures are drawn.

VTK may crash the process that renders where it has nothing to draw with, so a page never renders in its own
process; and a rendering that is started early is finished when the page needs it.
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

from kolsky.report.scene.drawing import render, silent_pyvista
from kolsky.report.scene.film import evenly_spaced
from kolsky.report.scene.scene_data import Scene, SceneDataMissing, scene_of

if TYPE_CHECKING:
    from kolsky.inverse.result import Identification

COUNT = 3
"""Number of still pictures in a report."""
SIZE = (800, 480)
"""Width and height of each [px]: 350 dots per inch on the page."""
LONGEST = 120.0
"""Seconds after which the process is killed."""
CHILD = "from kolsky.report.scene.stills import child; child()"


@dataclass(frozen=True)
class Rendering:
    """Running process and the file that it writes to."""

    process: subprocess.Popen[bytes]
    """Process that renders."""
    output: IO[bytes]
    """File of its pictures, complete when the process has ended."""


_running: dict[str, Rendering] = {}
_done: dict[str, NDArray[np.uint8] | None] = {}
_last: tuple[tuple[object, ...], Scene | None] = ((), None)


def start_stills(result: Identification) -> None:
    """Start the process that renders the stills of a result; do nothing if the result lacks their data."""
    scene = scene_of_stills(result)
    if scene is not None:
        _start(scene)


def stills(result: Identification) -> tuple[Scene, NDArray[np.uint8]] | None:
    """Return the stills and their scene.

    Returns
    -------
    tuple or None
        The scene at the times of the stills, and RGB pictures of shape [n, height, width, 3]; None if the
        result lacks their data or this machine cannot render.
    """
    scene = scene_of_stills(result)
    if scene is None:
        return None
    key = _start(scene)
    if key not in _done:
        _done.clear()  # of one result at a time
        _done[key] = _collect(_running.pop(key), len(scene.times))
    images = _done[key]
    return None if images is None else (scene, images)


def scene_of_stills(result: Identification) -> Scene | None:
    """Scene at the times of the stills; None if the result lacks its data."""
    global _last  # of one result at a time: a page asks for it when it begins, and for every figure
    parts = (result.response, result.comparison, result.provenance)
    if len(_last[0]) != len(parts) or any(a is not b for a, b in zip(_last[0], parts, strict=True)):
        try:
            scene = scene_of(result)
        except SceneDataMissing:
            _last = (parts, None)
        else:
            _last = (parts, scene.at(evenly_spaced(len(scene.times), COUNT)))
    return _last[1]


def child() -> None:
    """Render in the child process: a scene from standard input, its pictures to standard output."""
    scene: Scene = pickle.load(sys.stdin.buffer)  # written by `_start` of the process above
    pyvista = silent_pyvista()
    for k in range(len(scene.times)):
        sys.stdout.buffer.write(render(pyvista, scene, k, size=SIZE, bar=False).tobytes())


def _start(scene: Scene) -> str:
    """Start the rendering of a scene unless it runs or is done; return the key of its pictures."""
    text = pickle.dumps(scene)
    key = hashlib.sha256(text).hexdigest()
    if key in _running or key in _done:
        return key
    for old in list(_running):  # of a page that was never written
        _running[old].process.kill()
        _collect(_running.pop(old), 0)
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
    _running[key] = Rendering(process, output)
    return key


def _collect(rendering: Rendering, count: int) -> NDArray[np.uint8] | None:
    """Wait for the process and return its pictures, None if it failed."""
    try:
        ended = rendering.process.wait(LONGEST)
    except subprocess.TimeoutExpired:
        rendering.process.kill()
        ended = rendering.process.wait()
    with rendering.output as output:
        output.seek(0)
        values = np.frombuffer(output.read(), dtype=np.uint8)
    shape = (count, SIZE[1], SIZE[0], 3)
    return values.reshape(shape) if ended == 0 and values.size == np.prod(shape) else None
