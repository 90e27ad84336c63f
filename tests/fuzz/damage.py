"""Damage of a file: its bytes, a kind and a seed give other bytes, the same on every machine."""

import random
import re
from collections.abc import Callable

Damage = Callable[[bytes, random.Random], bytes]

FIELDS = (
    "nan", "inf", "-inf", "1e308", "-1e308", "1e-320", "1e999", "", " ", "0", "-1", "1,5", "1.2.3", "0x10",
    "1_000", '"' + "a" * 140_000 + '"',
    "１２", "٣", "--1", "+", "e5", "true", "=1+1", '"', "'", "\x1b[31m", "\u202e", "9" * 400, "a" * 140_000,
    "1" * 140_000, "[" + " " * 3000,
)  # fmt: skip
"""What takes the place of a field of a text."""
VALUES = (
    "nan", "inf", "-inf", "0", "-1", "1e308", "1e-320", "true", "[]", "{}", '""', '"x"', '"1e300 m"',
    '"1e-300 s"',
    '"-5 mm"', '"6.5 furlong"', '"nan mm"', '"5"', '"5 mm 3"', "[1, 2, 3]", "1979-05-27",
    '"../../etc/passwd"',
    '"/dev/zero"', '"' + "a" * 5000 + '"', '"\\u001b[31m"', "[" * 200 + "]" * 200, "9223372036854775808",
)  # fmt: skip
"""What takes the place of a value of a TOML file."""
FIELD = re.compile(rb"[^,;\t\r\n ]+")
NUMBER = re.compile(rb"[-+]?\d+\.?\d*(?:[eE][-+]?\d+)?")
VALUE = re.compile(rb"(?m)^([A-Za-z_0-9.\" ]+=[ ]*)([^\n#]+)")


def cut(data: bytes, rng: random.Random) -> bytes:
    """The end is missing."""
    return data[: rng.randrange(len(data))]


def flip(data: bytes, rng: random.Random) -> bytes:
    """One bit is turned."""
    made = bytearray(data)
    made[rng.randrange(len(made))] ^= 1 << rng.randrange(8)
    return bytes(made)


def flip_early(data: bytes, rng: random.Random) -> bytes:
    """One bit is turned among the first hundred bytes, where headers are."""
    made = bytearray(data)
    made[rng.randrange(min(100, len(made)))] ^= 1 << rng.randrange(8)
    return bytes(made)


def scatter(data: bytes, rng: random.Random) -> bytes:
    """A few bytes are others."""
    made = bytearray(data)
    for _ in range(rng.randint(2, 20)):
        made[rng.randrange(len(made))] = rng.randrange(256)
    return bytes(made)


def huge(data: bytes, rng: random.Random) -> bytes:
    """Four or eight bytes say a large number: a count, a size, an offset."""
    made = bytearray(data)
    place = rng.randrange(max(1, min(len(made) - 8, 2000)))
    word = rng.choice([b"\xff" * 4, b"\xff\xff\xff\x7f", b"\x00\x00\x00\x80", b"\xff" * 8, b"\x00" * 8])
    made[place : place + len(word)] = word
    return bytes(made)


def zeros(data: bytes, rng: random.Random) -> bytes:
    """A block is zero, as on a disk that failed."""
    start = rng.randrange(len(data))
    length = min(rng.choice([1, 16, 512, 4096]), len(data) - start)
    return data[:start] + bytes(length) + data[start + length :]


def hole(data: bytes, rng: random.Random) -> bytes:
    """A block is missing."""
    start = rng.randrange(len(data))
    return data[:start] + data[start + rng.choice([1, 7, 64, 512]) :]


def twice(data: bytes, rng: random.Random) -> bytes:
    """A block stands twice."""
    start = rng.randrange(len(data))
    block = data[start : start + rng.choice([1, 7, 64, 512])]
    return data[:start] + block + data[start:]


def other(data: bytes, rng: random.Random) -> bytes:
    """Something else altogether."""
    return rng.choice(
        [
            rng.randbytes(3000), b"\x00" * 3000, b"\n" * 3000, b"PK\x03\x04" + rng.randbytes(300),
            b"%PDF-1.7\n",
            b"\x89HDF\r\n\x1a\n" + rng.randbytes(300), b"<?xml version='1.0'?><a/>", b"{" * 100_000,
            b"[" * 100_000,
            b"- " * 50_000, b"\xff\xfe" + rng.randbytes(300), b"1\n" * 3000,
            b"version https://git-lfs.github.com\n",
        ]
    )  # fmt: skip


def _lines(data: bytes) -> list[bytes]:
    return data.split(b"\n")


def _below(lines: list[bytes], rng: random.Random) -> int:
    """A line of the lower two thirds."""
    return rng.randrange(len(lines) // 3, max(len(lines) // 3 + 1, len(lines) - 1))


def field(data: bytes, rng: random.Random) -> bytes:
    """A field of a text is another."""
    lines = _lines(data)
    for _ in range(20):
        row = rng.randrange(len(lines))
        found = list(FIELD.finditer(lines[row]))
        if found:
            hit = rng.choice(found)
            lines[row] = lines[row][: hit.start()] + rng.choice(FIELDS).encode() + lines[row][hit.end() :]
            break
    return b"\n".join(lines)


def number(data: bytes, rng: random.Random) -> bytes:
    """A number of a text is a wild one."""
    found = list(NUMBER.finditer(data[:200_000]))
    if not found:
        return data + b"nan"
    hit = rng.choice(found)
    word = rng.choice([b"nan", b"inf", b"1e308", b"-1e308", b"1e-320", b"-0.0", b"1e22", b"9" * 400])
    return data[: hit.start()] + word + data[hit.end() :]


def dropped(data: bytes, rng: random.Random) -> bytes:
    """A line is missing."""
    lines = _lines(data)
    del lines[_below(lines, rng)]
    return b"\n".join(lines)


def repeated(data: bytes, rng: random.Random) -> bytes:
    """A line stands twice or 500 times."""
    lines = _lines(data)
    row = _below(lines, rng)
    return b"\n".join([*lines[:row], *[lines[row]] * rng.choice([1, 500]), *lines[row:]])


def swapped(data: bytes, rng: random.Random) -> bytes:
    """Two lines change places."""
    lines = _lines(data)
    one, two = _below(lines, rng), _below(lines, rng)
    lines[one], lines[two] = lines[two], lines[one]
    return b"\n".join(lines)


def blank(data: bytes, rng: random.Random) -> bytes:
    """An empty line, one of blanks, or one of a hundred thousand of them."""
    lines = _lines(data)
    row = _below(lines, rng)
    return b"\n".join([*lines[:row], rng.choice([b"", b"   ", b" " * 100_000]), *lines[row:]])


def shortened(data: bytes, rng: random.Random) -> bytes:
    """A line ends in its middle."""
    lines = _lines(data)
    row = _below(lines, rng)
    lines[row] = lines[row][: max(1, len(lines[row]) // 2)]
    return b"\n".join(lines)


def foreign(data: bytes, rng: random.Random) -> bytes:
    """A character of another encoding, a zero byte, a mark of another, other ends of lines."""
    place = rng.randrange(len(data))
    return rng.choice(
        [
            data[:place] + b"\xb5" + data[place:], data[:place] + b"\0" + data[place:], b"\xff\xfe" + data,
            b"\xef\xbb\xbf" + data, data.replace(b"\n", b"\r"),
            data[:place] + b"\x1b]0;owned\x07" + data[place:],
        ]
    )  # fmt: skip


def value(data: bytes, rng: random.Random) -> bytes:
    """A value of a TOML file is another."""
    found = list(VALUE.finditer(data))
    if not found:
        return data + b"\nx = 1\n"
    hit = rng.choice(found)
    return data[: hit.start(2)] + rng.choice(VALUES).encode() + data[hit.end(2) :]


def key(data: bytes, rng: random.Random) -> bytes:
    """A key is missing, stands twice, or is misspelt."""
    found = list(VALUE.finditer(data))
    if not found:
        return data + b"\nx = 1\n"
    hit = rng.choice(found)
    whole = data[hit.start() : hit.end()]
    new = rng.choice([b"", whole + b"\n" + whole, b"x" + whole, b"[deep]\n" + whole])
    return data[: hit.start()] + new + data[hit.end() :]


def nested(data: bytes, rng: random.Random) -> bytes:
    """Something a hundred thousand levels deep."""
    return data + rng.choice(
        [b"\nx = " + b"[" * 100_000, b"\nx = " + b"{a=" * 100_000, b"\n[" + b"a." * 100_000]
    )


ANY: dict[str, Damage] = {
    made.__name__: made for made in (cut, flip, flip_early, scatter, huge, zeros, hole, twice, other)
}
"""Damage of any file."""
OF_TEXT: dict[str, Damage] = {
    made.__name__: made
    for made in (cut, flip, other, field, number, dropped, repeated, swapped, blank, shortened, foreign)
}
"""Damage of a table of text."""
OF_TOML: dict[str, Damage] = {
    made.__name__: made for made in (cut, flip, other, value, key, nested, dropped, repeated, foreign)
}
"""Damage of a file of settings."""
