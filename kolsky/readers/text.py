"""Bytes of a text file, their characters and their lines."""

import codecs
import hashlib
import re
import stat
from pathlib import Path

from kolsky.base.errors import InputError
from kolsky.readers.contents import Layout

SIZE_LIMIT = 200_000_000
"""Largest text export that is read [bytes]."""
ENCODINGS = ("utf-8", "utf-16", "utf-16-le", "utf-16-be", "cp1252", "latin-1", "cp932", "gb18030")
"""Encodings that may be stated; the first three and cp1252 are found without."""

LONGEST_FIELD = 200
"""Longest field that is searched for a name and a unit [characters]: no heading is longer, and what a search
takes grows with a power of the length."""
LONGEST_PAIR = 4000
"""Longest line of a header that is searched for a key and its values [characters]."""

_MARKS = (
    (codecs.BOM_UTF8, "utf-8"),
    (codecs.BOM_UTF16_LE, "utf-16-le"),
    (codecs.BOM_UTF16_BE, "utf-16-be"),
)


def matched(pattern: re.Pattern[str], field: str, *, longest: int = LONGEST_FIELD) -> re.Match[str] | None:
    """The match of a pattern with a whole field; None for a field of more characters than `longest`."""
    return pattern.fullmatch(field) if len(field) <= longest else None


def read_text(path: Path, layout: Layout) -> tuple[str, list[str], str]:
    """Hash, lines and encoding of a text file.

    Raises
    ------
    InputError
        If it cannot be read.
    """
    data = read_bytes(path)
    text, encoding = decode_text(path, data, layout.encoding)
    return hashlib.sha256(data).hexdigest(), lines_of(path, text), encoding


def read_bytes(path: Path, *, limit: int = SIZE_LIMIT) -> bytes:
    """The bytes of a regular file of sensible size.

    Raises
    ------
    InputError
        If there is no such file, it is a folder or a device, it is empty, larger than `limit` bytes
        (found without reading it), or may not be read.
    """
    try:
        status = path.stat()
        if stat.S_ISDIR(status.st_mode):
            raise InputError(path, "is a folder, not a file", cure="name the file inside it")
        if not stat.S_ISREG(status.st_mode):
            kind = "a pipe" if stat.S_ISFIFO(status.st_mode) else "a device or a socket"
            raise InputError(path, f"is {kind}, not a regular file", cure="copy the data into a file")
        if status.st_size > limit:
            raise InputError(
                path,
                f"has {status.st_size / 1e6:.0f} MB, more than the {limit / 1e6:.0f} MB that are read",
                cure="export the time span of the test only",
            )
        data = path.read_bytes()
    except FileNotFoundError:
        raise InputError(path, "there is no such file", cure="put it there or correct its name") from None
    except OSError as error:
        raise InputError(
            path, f"cannot be read ({error.strerror})", cure="copy it again, and see that it may be read"
        ) from None
    if not data.strip():
        raise InputError(path, "is empty", cure="export it again")
    return data


def decode(path: Path, data: bytes) -> str:
    """UTF-8 text of a file, with or without a byte order mark.

    Raises
    ------
    InputError
        If the bytes are not UTF-8, with the offset of the first that is not.
    """
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        offset = error.start + (3 if data.startswith(b"\xef\xbb\xbf") else 0)
        raise InputError(
            path,
            f"is not UTF-8 text: byte 0x{data[offset]:02x} at byte offset {offset}",
            line=data.count(b"\n", 0, offset) + 1,
            cure="convert it to UTF-8, e.g. `iconv -f latin1 -t utf-8`",
        ) from None


def decode_text(path: Path, data: bytes, encoding: str | None = None) -> tuple[str, str]:
    """The text of a file and the words for its encoding.

    A byte order mark decides; without one, many zero bytes mean UTF-16, and what is not valid UTF-8 is
    cp1252, the code page of Windows in western Europe and America.

    Parameters
    ----------
    path
        The file, for messages.
    data
        Its bytes.
    encoding
        One of `ENCODINGS`, or None to find it.

    Raises
    ------
    InputError
        If the encoding is unknown, or a byte is no character in it: with line and offset.
    """
    if encoding is not None and encoding not in ENCODINGS:
        raise InputError(
            path,
            f"is said to be encoded as '{encoding}'",
            allowed=f"one of {', '.join(ENCODINGS)}",
            cure="leave encoding out: UTF-8, UTF-16 and cp1252 are found",
        )
    mark, marked = next(((m, name) for m, name in _MARKS if data.startswith(m)), (b"", None))
    body = data[len(mark) :]
    if encoding is not None:
        bare = "utf-16-le" if encoding == "utf-16" and marked is None else encoding
        chosen, words = (marked or bare) if bare.startswith("utf") else bare, f"{encoding} (stated)"
    elif marked is not None:
        chosen, words = marked, f"{marked} with a byte order mark"
    else:
        chosen = _without_mark(body)
        words = chosen
    try:
        text = body.decode(chosen)
    except UnicodeDecodeError as error:
        raise InputError(
            path,
            f"is not {chosen} text: byte 0x{body[error.start]:02x} at byte offset {error.start + len(mark)}",
            line=body.count(b"\n", 0, error.start) + 1,
            cure="say the encoding in the layout, or convert the file to UTF-8",
        ) from None
    if "\0" in text:
        line = text.count("\n", 0, text.index("\0")) + 1
        raise InputError(
            path,
            "has a zero byte: it is no text, or was cut off",
            line=line,
            cure="copy it again, or say its format in the layout",
        )
    return text, words


def _without_mark(data: bytes) -> str:
    sample = data[:4000]
    even, odd = sample[0::2].count(0), sample[1::2].count(0)
    if max(even, odd) > 0.4 * (len(sample) // 2) and len(data) % 2 == 0:
        return "utf-16-le" if odd > even else "utf-16-be"
    try:
        data.decode("utf-8")
    except UnicodeDecodeError:
        return "cp1252"
    return "utf-8"


def lines_of(path: Path, text: str) -> list[str]:
    """The lines of a text without empty ones at its end; lines end with LF, CR LF or CR.

    Raises
    ------
    InputError
        If there is nothing but blanks.
    """
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    while lines and not lines[-1].strip():
        lines.pop()
    if not lines:
        raise InputError(path, "is empty", cure="export it again")
    return lines
