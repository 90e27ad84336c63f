"""The files of open-05 in the formats of a laboratory: a German scope file, series of VIC-3D, a workbook."""

import csv
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline

OPEN_05 = Path(__file__).parents[2] / "runs" / "open-05"
LENGTH = 6.5  # of the specimen [mm]
HEIGHTS = np.linspace(0.12, 0.88, 9) * LENGTH  # of the points at rest [mm]
ANGLES = np.radians(np.linspace(-24.0, 24.0, 5))
"""Angles of the points about the specimen's axis. One column is near the centre plane, so its noise is
independent."""
PLATEN = 2.0  # y of the transmission platen's face in the program's frame [mm]. Y points down in this frame.
HEAD = '"X [mm]", "Y [mm]", "Z [mm]", "U [mm]", "V [mm]", "W [mm]", "sigma", "x", "y"'
TYPED = {
    "specimen.diameter": '"9.5 mm"', "specimen.length": '"6.5 mm"', "specimen.density": '"870 kg/m^3"',
    "interface.faces": '"bonded"', "interface.side": '"bonded"', "transmission.support": '"rigid"',
    "force.sensitivity": '"0.0112 V/N"', "frames.clock_offset": '"0 us"',
    "surface.origin": f'["0 mm", "{PLATEN} mm", "0 mm"]', "model.poisson": "0.499",
    "model.damping": '"25 us"',
}  # fmt: skip
"""Values that a person types, because no file contains them."""


def table(name: str) -> np.ndarray:
    """The numbers of one file of open-05."""
    with (OPEN_05 / name).open(encoding="utf-8") as file:
        return np.array([[float(cell) for cell in row] for row in list(csv.reader(file))[1:]])


def write_export(path: Path, places: np.ndarray, motion: np.ndarray, sigma: np.ndarray) -> None:
    """One frame in the format of a VIC-3D export."""
    pixels = np.column_stack([np.arange(len(places)) % 9, np.arange(len(places)) // 9]) * 12.0
    rows = np.column_stack([places, motion, sigma, pixels])
    lines = [HEAD, *(", ".join(f"{v:.5f}" for v in row) for row in rows)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def write_exports(folder: Path) -> None:
    """Series of the specimen's surface and of the flyer, in a sub-folder."""
    outline, travel = table("centreline.csv"), table("flyer.csv")[:, 2]
    noise = np.random.default_rng(5)
    (folder / "dic").mkdir()
    at_rest = np.empty(0)
    for frame, way in enumerate(travel):
        _, _, y, Z, _ = outline[outline[:, 0] == frame].T
        height = HEIGHTS * (1.0 - way / LENGTH)
        radius = CubicSpline(y, Z)(height.clip(y.min(), y.max()))  # of the outline's points 0.2 mm apart
        grid = np.stack(
            [
                np.outer(radius, np.sin(ANGLES)),
                PLATEN - np.outer(height, np.ones(ANGLES.size)),
                np.outer(radius, np.cos(ANGLES)),
            ],
            axis=-1,
        ).reshape(-1, 3) + noise.normal(0.0, 0.001, (HEIGHTS.size * ANGLES.size, 3))
        at_rest = grid if not at_rest.size else at_rest
        seen = np.repeat((height >= y.min()) & (height <= y.max()), ANGLES.size)
        write_export(
            folder / "dic" / f"specimen_{frame:04d}.csv", at_rest, grid - at_rest, np.where(seen, 0.004, -1.0)
        )
        flat = np.stack(np.meshgrid([-1.0, 0.0, 1.0], [-5.0, -6.0], [0.3], indexing="ij"), axis=-1)
        places = flat.reshape(-1, 3)
        moved = np.tile([0.0, way, 0.0], (6, 1))  # toward the platen: along +Y
        write_export(folder / "dic" / f"flyer_{frame:04d}.csv", places, moved, np.full(6, 0.004))


def write_scope(path: Path) -> None:
    """A file with semicolons and decimal commas. The header gives the rate and the first time; there is no
    time column."""
    rows = table("scope.csv")
    step = float(np.median(np.diff(rows[:, 0])))
    head = [f"Abtastrate;{1e-6 / step:g} MHz", f"Start;{1e6 * rows[0, 0]:g} us"]
    names = "Kanal 1 Eingang (V);Kanal 2 Ausgang (V)"
    lines = [*head, names, *(";".join(f"{v:.7f}".replace(".", ",") for v in row[1:]) for row in rows)]
    path.write_bytes("\r\n".join(lines).encode("cp1252"))


def write_workbook(path: Path) -> None:
    """A file with per cent and MPa in a row of units."""
    from openpyxl import Workbook

    book = Workbook()
    sheet = book.active
    sheet.append(["Specimen", "gel A"])
    sheet.append(["Strain", "Stress"])
    sheet.append(["%", "MPa"])
    for strain, stress in table("quasi_static.csv")[:, :2]:
        sheet.append([100.0 * strain, 1e-6 * stress])
    book.save(path)


def laboratory(folder: Path) -> Path:
    """A folder with all of them and the frames' times."""
    folder.mkdir(parents=True)
    write_scope(folder / "Oszi Versuch 5.csv")
    times = [f"{int(n)};{t:.9f}".replace(".", ",") for n, t in table("frames.csv")[:, :2]]
    (folder / "Bildzeiten.csv").write_text("\n".join(["Bildnummer;Zeit (s)", *times]), encoding="utf-8")
    write_exports(folder)
    write_workbook(folder / "Druckversuch.xlsx")
    return folder
