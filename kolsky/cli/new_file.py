"""Files that a command writes to begin with: an existing one is left as it is."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from kolsky.base.errors import InputError


@contextmanager
def beginning(path: Path) -> Iterator[None]:
    """Make the folder of a new file, and refuse what keeps either from being written.

    Within it the file is to be opened with the mode "x".

    Raises
    ------
    InputError
        If the file exists, something else stands where its folder is to be, or either cannot be written.
    """
    folder = path.parent
    try:
        folder.mkdir(parents=True, exist_ok=True)
        yield
    except FileExistsError as error:
        at_fault = path if folder.is_dir() else Path(error.filename)
        raise InputError(
            at_fault, "exists already and is left as it is", cure="edit it, or choose another folder"
        ) from None
    except OSError as error:
        raise InputError(
            folder, f"cannot be written ({error.strerror})", cure="give another folder, or make it writable"
        ) from None
