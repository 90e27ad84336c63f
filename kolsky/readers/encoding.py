"""Which characters the bytes of a text file are."""

import codecs
from pathlib import Path

from kolsky.base.errors import InputError

ENCODINGS = ("utf-8", "utf-16", "utf-16-le", "utf-16-be", "cp1252", "latin-1", "cp932", "gb18030")
"""Encodings that may be stated; the first three and cp1252 are found without."""

_MARKS = (
    (codecs.BOM_UTF8, "utf-8"),
    (codecs.BOM_UTF16_LE, "utf-16-le"),
    (codecs.BOM_UTF16_BE, "utf-16-be"),
)


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
