"""Files that are complete or not there at all, and text that a spreadsheet shows and does not evaluate."""

import errno
import os
import secrets
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A new empty file beside `path` that takes its place when the block ends without an exception.

    The data are on the disk before the name changes, so a reader finds the old file or the whole new one.
    After an exception the old file is untouched and nothing else is left.
    """
    path = Path(path)
    # The suffix stays last: some writers choose their format by it.
    partial = path.with_name(f".{secrets.token_hex(6)}.{path.name}")
    os.close(os.open(partial, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
    try:
        yield partial
        with partial.open("rb+") as file:
            os.fsync(file.fileno())
        os.replace(partial, path)
    except BaseException:
        partial.unlink(missing_ok=True)
        raise
    if os.name == "posix":  # the new name itself; Windows cannot open a folder
        folder = os.open(path.parent, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)


KINDS = (
    (stat.S_ISDIR, "a folder"),
    (stat.S_ISFIFO, "a pipe"),
    (stat.S_ISSOCK, "a socket"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
)
"""What may stand under a name beside regular files, in words."""


def regular(path: Path | str) -> Path:
    """The path of a regular file; whatever else it names is refused before it is opened.

    A pipe that nobody writes to never answers, a device never ends, and links lead to both.

    Raises
    ------
    OSError
        If there is no such file, or it is a folder, a pipe, a socket or a device; `strerror` says which.
    """
    mode = os.stat(path).st_mode
    if stat.S_ISREG(mode):
        return Path(path)
    kind = next((words for is_one, words in KINDS if is_one(mode)), "something else")
    raise OSError(errno.EINVAL, f"it is {kind}, not a regular file", str(path))


FORMULA = ("=", "+", "-", "@", "\t", "\r", "\n", "＝", "＋", "－", "＠")
"""Characters that begin a formula for a spreadsheet, full-width forms included (OWASP, CSV Injection)."""


def text_cell(text: str) -> str:
    """Text that a spreadsheet shows and does not evaluate.

    Names come from folders and files of anybody. One that begins as a formula gets a leading apostrophe, as
    OWASP advises; a number written as text stays a number.

    Parameters
    ----------
    text
        The cell's text, not quoted yet.

    References
    ----------
    OWASP Foundation, CSV Injection, https://owasp.org/www-community/attacks/CSV_Injection.
    """
    if not text.startswith(FORMULA):
        return text
    try:
        float(text)
    except ValueError:
        return f"'{text}"
    return text
