"""Picture files written byte by byte from the documented layouts, for the tests of the readers."""

import struct

import numpy as np


def packed(values, bits):
    """Packed grey values without gaps, most significant bit first."""
    text = "".join(f"{int(value):0{bits}b}" for value in np.ravel(values))
    text += "0" * (-len(text) % 8)
    return bytes(int(text[i : i + 8], 2) for i in range(0, len(text), 8))


def twelve_bit_tiff(pages, *, order="<", white=False, extra=()):
    """An uncompressed TIFF of 12 bits per value. Each row begins at a whole byte; pages are before their
    headers."""
    out = (b"II*\0" if order == "<" else b"MM\0*") + b"\0\0\0\0"
    link = 4
    for page in pages:
        raw = b"".join(packed(row, 12) for row in page)
        data, header = len(out), len(out) + len(raw) + len(raw) % 2
        rows, columns = page.shape
        tags = [(256, columns), (257, rows), (258, 12), (259, 1), (262, 0 if white else 1), (273, data)]
        tags += [(277, 1), (278, rows), (279, len(raw)), *extra]
        out = out[:link] + struct.pack(order + "I", header) + out[link + 4 :] + raw + b"\0" * (len(raw) % 2)
        out += struct.pack(order + "H", len(tags))
        for tag, value in tags:
            out += struct.pack(order + "HHII", tag, 4, 1, value)
        link = len(out)
        out += b"\0\0\0\0"
    return out


def cine(pictures, *, bits=12, packing=0, trigger=(7, 1 << 30), stamps=None, first=-2, rate=1000, **lies):
    """A Phantom cine: uncompressed bottom row first, or packed with the top row first.

    `lies` overwrite entries of the headers: count, columns, height, table, setup, mark, notes, size, colours.
    """
    rows, columns = pictures[0].shape
    container = 8 if bits == 8 else 16
    setup = bytearray(1000)
    struct.pack_into("<2sH", setup, 140, lies.get("mark", b"ST"), len(setup))
    struct.pack_into("<I", setup, 768, rate)
    struct.pack_into("<I", setup, 808, lies.get("colours", 0))
    struct.pack_into("<I", setup, 896, bits)
    blocks = b""
    if stamps is not None:
        body = b"".join(struct.pack("<II", fraction, second) for second, fraction in stamps)
        exposure = b"\0\0\0\0" * len(pictures)
        blocks = struct.pack("<IHH", 8 + len(exposure), 1003, 0) + exposure
        blocks += struct.pack("<IHH", 8 + len(body), 1002, 0) + body
    at_setup = 44 + 40
    table = at_setup + len(setup) + len(blocks)
    place, places, body = table + 8 * len(pictures), [], b""
    for picture in pictures:
        if packing:
            raw = packed(picture, {256: 10, 1024: 12}[packing])
        else:
            raw = picture[::-1].astype("<u1" if container == 8 else "<u2").tobytes()
        note = b"note" + struct.pack("<I", lies.get("size", len(raw)))
        places.append(place + len(body))
        body += struct.pack("<I", lies.get("notes", 4 + len(note))) + note + raw
    head = struct.pack(
        "<2sHHHiIiIIIIII",
        *(b"CI", 44, lies.get("compression", 0), 1, first, 100, first, lies.get("count", len(pictures))),
        *(44, lies.get("setup", at_setup), lies.get("table", table), trigger[1], trigger[0]),
    )
    height = lies.get("height", rows)
    bitmap = struct.pack(
        "<IiiHHIIiiII", 40, lies.get("columns", columns), height, 1, container, packing, 0, 0, 0, 0, 0
    )
    return head + bitmap + bytes(setup) + blocks + struct.pack(f"<{len(places)}q", *places) + body


CIH = {
    "Date": "2026/1/1", "Record Rate(fps)": "120000", "Shutter Speed(s)": "1/120000", "Total Frame": "3",
    "Original Total Frame": "3", "Start Frame": "-1", "Save Step": "1", "Image Width": "16",
    "Image Height": "6", "Color Type": "Mono", "Color Bit": "16", "File Format": "MRaw",
    "EffectiveBit Depth": "12", "EffectiveBit Side": "Lower",
}  # fmt: skip


def cih(**changes):
    """Text of a Photron camera information header; `changes` by field name, None leaves a field out."""
    fields = {**CIH, **{name.replace("_", " "): value for name, value in changes.items()}}
    lines = [f"{name} : {value}" for name, value in fields.items() if value is not None]
    return "\n".join(["#Camera Information Header", *lines, "END", ""])


def cihx(*, inside="", width=16, height=6, frames=3, bit=12, depth=12, colours="Mono", segment=""):
    """XML of a Photron camera information header, between other bytes as the camera's software writes it."""
    return (
        b"\x01\x00\xff junk <?xml version='1.0'?>\n"
        + (
            f"<cih>{inside}<recordInfo><recordRate>120000</recordRate></recordInfo><frameInfo><totalFrame>{frames}"
            f"</totalFrame><startFrame>-1</startFrame></frameInfo><imageFileInfo><fileFormat>MRaw</fileFormat>"
            f"</imageFileInfo><imageDataInfo><resolution><width>{width}</width><height>{height}</height>"
            f"</resolution>{segment}<colorInfo><type>{colours}</type><bit>{bit}</bit></colorInfo><effectiveBit><depth>{depth}"
            "</depth><side>Lower</side></effectiveBit></imageDataInfo></cih>"
        ).encode()
        + b"\0\0 tail"
    )
