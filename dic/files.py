"""Files that are written completely or not at all, and text that a spreadsheet does not evaluate."""

import errno
import os
import shutil
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

try:
    import fcntl
except ImportError:  # Windows: files of a killed process are not removed
    fcntl = None  # type: ignore[assignment]


HIDDEN = ".partial-"
"""Prefix of the temporary folders in which files are written before they are renamed."""
_looked: set[str] = set()
"""Folders from which this process has removed the files of killed processes."""


@contextmanager
def scratch(folder: Path) -> Iterator[Path]:
    """A new hidden folder in `folder`; it is removed with its contents when the block ends.

    It is locked as long as this process runs. The folder of a killed process is not locked; another process
    recognises it and removes it.

    ``folder``: folder of the results; it must exist.
    """
    remove_abandoned(folder)
    while True:
        directory = Path(tempfile.mkdtemp(prefix=HIDDEN, dir=folder))
        try:
            lock = _locked(directory)
        except (BlockingIOError, FileNotFoundError):
            continue  # another process removed it as abandoned before it was locked
        if lock is None or directory.exists():
            break
        os.close(lock)
    _scratch.add(directory)
    try:
        yield directory
    finally:
        shutil.rmtree(directory, ignore_errors=True)
        _scratch.discard(directory)
        if lock is not None:
            os.close(lock)


_scratch: set[Path] = set()
"""Folders of `scratch` whose blocks have not ended."""


def remove_scratch() -> None:
    """Remove every folder of `scratch`, if the process ends inside the blocks."""
    for directory in tuple(_scratch):
        shutil.rmtree(directory, ignore_errors=True)


def remove_abandoned(folder: Path) -> None:
    """Remove the hidden folders of killed processes from a folder; once per process and folder."""
    if fcntl is None or str(folder) in _looked:
        return
    _looked.add(str(folder))
    for directory in sorted(Path(folder).glob(f"{HIDDEN}*")):
        if directory.is_symlink() or not directory.is_dir():
            continue
        try:
            lock = _locked(directory)
        except OSError:  # another process writes in it, or it was removed
            continue
        if lock is not None:
            shutil.rmtree(directory, ignore_errors=True)
            os.close(lock)


def _locked(folder: Path) -> int | None:
    """Handle that locks a folder; None where folders cannot be locked."""
    if fcntl is None:
        return None
    handle = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        os.close(handle)
        if isinstance(error, BlockingIOError):
            raise
        return None  # a file system without locks
    return handle


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A new empty file that replaces `path` when the block ends without an exception.

    The data are on the disk before the file is renamed. A reader therefore finds the old file or the complete
    new one. After an exception the old file is unchanged and the new one is removed.
    """
    path = Path(path)
    with scratch(path.parent) as folder:
        partial = folder / path.name  # some writers choose their format by the suffix
        os.close(os.open(partial, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
        yield partial
        with partial.open("rb+") as file:
            os.fsync(file.fileno())
        os.replace(partial, path)
    if os.name == "posix":  # the new name itself; Windows cannot open a folder
        folder_handle = os.open(path.parent, os.O_RDONLY)
        try:
            os.fsync(folder_handle)
        finally:
            os.close(folder_handle)


@contextmanager
def alone_in(folder: Path) -> Iterator[None]:
    """Lock a folder while files are renamed into it; a second process waits until the block ends."""
    handle = None
    if fcntl is not None:
        handle = os.open(folder, os.O_RDONLY)
        with suppress(OSError):  # a file system without locks
            fcntl.flock(handle, fcntl.LOCK_EX)
    try:
        yield
    finally:
        if handle is not None:
            os.close(handle)


KINDS = (
    (stat.S_ISDIR, "a folder"),
    (stat.S_ISFIFO, "a pipe"),
    (stat.S_ISSOCK, "a socket"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
)
"""Names of the types of file other than regular ones."""


def regular(path: Path | str) -> Path:
    """The path of a regular file. Any other type of file is rejected before it is opened.

    Reading from a pipe without a writer never returns, reading from a device never ends, and links may lead
    to either.

    Raises OSError if there is no such file, or it is a folder, a pipe, a socket or a device; `strerror` names
    the type.
    """
    mode = os.stat(path).st_mode
    if stat.S_ISREG(mode):
        return Path(path)
    kind = next((words for is_one, words in KINDS if is_one(mode)), "something else")
    raise OSError(errno.EINVAL, f"it is {kind}, not a regular file", str(path))


def one_line(text: str) -> str:
    """The text with line breaks and other unprintable characters written as escapes."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


FORMULA = ("=", "+", "-", "@", "\t", "\r", "\n", "＝", "＋", "－", "＠")
"""Characters that begin a formula for a spreadsheet, including full-width forms (OWASP, CSV Injection)."""


def text_cell(text: str) -> str:
    """Text that a spreadsheet shows and does not evaluate.

    Names come from folders and files of unknown origin. A name that begins like a formula gets a leading
    apostrophe, as OWASP advises. A number in text form stays a number.

    Parameters
    ----------
    text
        The cell's text, without quotation marks.

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
