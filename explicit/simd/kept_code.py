"""Translated time loops, kept beside Warp's compiled kernels: a process that finds one translates nothing.

A file's name carries the hash of everything the translation depends on: Warp's hash of the scalar kernel,
which covers all functions, constants and structs it refers to, this package's source, and the choice of
lanes.
"""

import os
import tempfile
from collections.abc import Callable
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any

import warp as wp

from explicit.device import kernel_cache

FOLDER = "lanes"
"""Folder in Warp's kernel cache."""


def kept(time_loop: Any, choice: str, translate: Callable[[], str]) -> str:
    """The source over lanes of a time loop: from its file, or translated and put there.

    Parameters
    ----------
    time_loop
        The scalar Warp kernel, alone in its module.
    choice
        Mapping, lanes and precision in words.
    translate : callable
        Makes the source.
    """
    file = file_of(time_loop, choice)
    try:
        return file.read_text(encoding="utf-8")
    except OSError:
        code = translate()
    _put(file, code)
    return code


def file_of(time_loop: Any, choice: str) -> Path:
    """Where the source of a time loop is kept; there is no such file before it was translated."""
    name = sha256(time_loop.module.hash_module() + _package() + choice.encode()).hexdigest()
    return kernel_cache() / FOLDER / f"{name}.inc"


def _put(file: Path, code: str) -> None:
    """Write a file whole or not at all; where the cache cannot be written, nothing is kept."""
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        number, name = tempfile.mkstemp(dir=file.parent)
        try:
            with os.fdopen(number, "w", encoding="utf-8") as part:
                part.write(code)
            Path(name).replace(file)
        except OSError:
            Path(name).unlink(missing_ok=True)
    except OSError:
        return


@cache
def _package() -> bytes:
    """Hash of the translator's and the time loop's source, and of Warp's version."""
    found = sha256(wp.__version__.encode())
    root = Path(__file__).parents[1]
    for file in sorted(root.rglob("*.py")):
        found.update(file.relative_to(root).as_posix().encode() + b"\0" + file.read_bytes())
    return found.digest()
