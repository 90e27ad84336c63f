"""Exports of DIC programs: one barrelling specimen in every layout, with lost points."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from kolsky_command import run_kolsky
from shot_folders import OPEN_01, shot_in

from dic.outcome import PointOutcome
from dic.surfaces.surface_history import centre_line
from kolsky.base.errors import InputError
from kolsky.readers.dic_export import LAYOUTS, PointState, matching, read
from kolsky.shot.load import load_shot
from kolsky.shot.surface import cylinder_placement, declared_placement, flyer_motion, surface_history

FRAMES, ROWS, COLUMNS, RADIUS = 4, 12, 9, 4.75e-3
TIME = 1e-5 * np.arange(FRAMES)
# The test frame in the program's coordinates: y along -Y, Z along +Z, x then along -X, shifted.
TURN = np.array([[-1.0, 0, 0], [0, -1.0, 0], [0, 0, 1.0]])
SHIFT = np.array([1e-3, 8e-3, -2e-3])
LOST = (2, 30)
"""Frame and point that the program gave up."""


def barrel():
    """Reference positions and displacements of a side surface in the test frame [m]."""
    y, angle = np.meshgrid(
        np.linspace(0.2e-3, 6.3e-3, ROWS), np.radians(np.linspace(-25, 25, COLUMNS)), indexing="ij"
    )
    X = np.stack([RADIUS * np.sin(angle), y, RADIUS * np.cos(angle)], axis=-1).reshape(-1, 3)
    squeeze = 0.05 * np.arange(FRAMES)
    u = np.empty((FRAMES, len(X), 3))
    for i, e in enumerate(squeeze):
        bulge = 1.0 + e * (0.5 + 0.2 * np.sin(np.pi * X[:, 1] / 6.5e-3))
        u[i] = X * np.stack([bulge, np.full(len(X), 1.0 - e), bulge], axis=-1) - X
    return X, u


def in_program(X, u):
    return X @ TURN + SHIFT, u @ TURN


def number(value):
    return f"{1e3 * value:.8f}"  # mm, to 1e-11 m


def write(folder, layout, *, current=False, drop=True):
    """One file a frame; the lost point as the program marks it."""
    X, u = in_program(*barrel())
    pixels = [(100.0 + 5 * (i % COLUMNS), 40.0 + 5 * (i // COLUMNS)) for i in range(len(X))]
    for frame in range(FRAMES):
        lines = []
        for i in range(len(X)):
            lost = drop and (frame, i) == LOST
            place = X[i] + (u[frame, i] if current else 0.0)
            c, d = [number(v) for v in place], [number(v) for v in u[frame, i]]
            x, y = pixels[i]
            if layout == "vic3d":
                lines.append(", ".join([*c, *d, "-1" if lost else "0.004", str(x), str(y)]))
            elif layout == "duodic":
                lines.append(",".join([str(i + 1), *(["NaN"] * 6 if lost else [*c, *d])]))
            elif layout == "aramis":
                lines.append("; ".join([str(i + 1), *(["nan"] * 6 if lost else [*c, *d])]))
            elif layout == "matchid" and not lost:  # has no row for it
                lines.append(",".join([str(x), str(y), *c, *d]))
            elif layout == "dice":
                lines.append(",".join([str(i), str(x), str(y), *c, *d, "-1" if lost else "0.01", "0"]))
            elif layout == "opencorr":
                lines.append(",".join([str(x), str(y), *d, "-2" if lost else "0.98", *c]))
        head = {
            "opencorr": "x,y,u,v,w,r1r2 ZNCC,ref_x,ref_y,ref_z",
            "duodic": "point,Points3D_X,Points3D_Y,Points3D_Z,DispVec_X,DispVec_Y,DispVec_Z",
            "vic3d": '"X", "Y", "Z", "U", "V", "W", "sigma", "x", "y"',
            "aramis": "# stage data:\n####################\n"
            "#        ID; x_undef [mm]; y_undef [mm]; z_undef [mm]; u [mm]; v [mm]; w [mm]",
            "matchid": "Coordinates.Image X [Pixel],Coordinates.Image Y [Pixel],"
            "coor.X [mm],coor.Y [mm],coor.Z [mm],disp.Horizontal Displacement U [mm],"
            "disp.Vertical Displacement V [mm],disp.Out-Of-Plane: W [mm]",
            "dice": "SUBSET_ID,COORDINATE_X,COORDINATE_Y,"
            "MODEL_COORDINATES_X,MODEL_COORDINATES_Y,MODEL_COORDINATES_Z,"
            "MODEL_DISPLACEMENT_X,MODEL_DISPLACEMENT_Y,MODEL_DISPLACEMENT_Z,SIGMA,MATCH",
        }[layout]
        (folder / f"shot7_{frame:04d}_0.csv").write_text("\n".join([head, *lines]) + "\n")
    return matching(folder, "shot7_*_0.csv")


@pytest.mark.parametrize("layout", LAYOUTS)
def test_every_layout_gives_the_same_points(layout, tmp_path):
    export = read(write(tmp_path, layout), layout)
    X, u = in_program(*barrel())
    np.testing.assert_array_equal(export.frame, range(FRAMES))
    # Points in the order of the files: that of MatchID too, whose lost point has rows in other frames.
    np.testing.assert_allclose(export.X, X, rtol=0, atol=1e-11)  # printed to 1e-11 m
    lost = PointState.REJECTED if layout in ("vic3d", "dice", "opencorr") else PointState.MISSING
    expected = np.zeros(u.shape[:2], dtype=int)
    expected[LOST] = lost
    np.testing.assert_array_equal(export.state, expected)
    assert np.isnan(export.u[LOST]).all()
    kept = expected == 0
    np.testing.assert_allclose(export.u[kept], u[kept], rtol=0, atol=1e-11)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_current_coordinates_are_told_from_reference_ones(layout, tmp_path):
    export = read(write(tmp_path, layout, current=True), layout)
    np.testing.assert_allclose(export.X, in_program(*barrel())[0], rtol=0, atol=3e-11)  # a difference of two


def test_a_lost_point_is_an_outcome(tmp_path):
    export = read(write(tmp_path, "vic3d"), "vic3d")
    placement = declared_placement(y="-Y", Z="+Z", origin=tuple(SHIFT))
    surface = surface_history(export, placement, TIME, sigma=2e-6)
    assert surface.outcome[LOST] == PointOutcome.LOW_CORRELATION
    X, u = barrel()
    np.testing.assert_allclose(surface.X, X, rtol=0, atol=2e-11)
    np.testing.assert_allclose(surface.u[surface.valid], u[surface.valid], rtol=0, atol=2e-11)
    line = centre_line(surface, half_width=1.5e-3)
    assert line.left_out == {PointOutcome.LOW_CORRELATION: 1}
    # A body of revolution: the radius at a height is known.
    e = 0.05 * line.frame
    height = line.y / (1.0 - e)
    radius = RADIUS * (1.0 + e * (0.5 + 0.2 * np.sin(np.pi * height / 6.5e-3)))
    np.testing.assert_allclose(line.Z, radius, rtol=0, atol=5e-11)


def test_a_cylinder_finds_axis_and_origin(tmp_path):
    """Axis and centre of a specimen that hangs 3 degrees askew in the program's coordinates."""
    export = read(write(tmp_path, "dice"), "dice")
    tilt = np.radians(3.0)
    askew = np.array([[np.cos(tilt), np.sin(tilt), 0], [-np.sin(tilt), np.cos(tilt), 0], [0, 0, 1.0]])
    turned = replace(export, X=export.X @ askew.T, u=export.u @ askew.T)
    on_platen = askew @ (SHIFT + np.array([2e-3, 0.0, 1e-3]))  # any point of the plane
    placement = cylinder_placement(
        turned, y="-Y", Z="+Z", on_platen=tuple(on_platen), radius=RADIUS, sigma=1e-6
    )
    surface = surface_history(turned, placement, TIME, sigma=1e-6)
    X, _ = barrel()
    # Turning about the axis is free up to the declared Z; heights and radii are not.
    np.testing.assert_allclose(surface.X[:, 1], X[:, 1], rtol=0, atol=2e-9)  # iterations end at 1e-9 m
    np.testing.assert_allclose(np.hypot(surface.X[:, 0], surface.X[:, 2]), RADIUS, rtol=0, atol=2e-9)
    with pytest.raises(ValueError, match=r"87 degrees off the declared axis \+X"):
        cylinder_placement(turned, y="+X", Z="+Z", on_platen=tuple(on_platen), radius=RADIUS, sigma=1e-6)


def test_the_flyer_is_the_mean_of_points_that_never_go(tmp_path):
    export = read(write(tmp_path, "vic3d"), "vic3d")
    rigid = np.zeros_like(export.u)
    rigid[..., 1] = 1e-4 * np.arange(FRAMES)[:, None]  # along +Y, which is toward the specimen
    rigid[LOST] = np.nan
    rigid[:, LOST[1], 1] += 5e-4  # the point that is lost once must not count
    placement = declared_placement(y="-Y", Z="+Z", origin=tuple(SHIFT))
    flyer = flyer_motion(replace(export, u=rigid), placement, TIME, sigma=1e-6)
    np.testing.assert_allclose(flyer.displacement, 1e-4 * np.arange(FRAMES), rtol=1e-12, atol=1e-18)
    none = replace(export, state=np.ones_like(export.state))
    with pytest.raises(ValueError, match="no point of the flyer is valid in every frame"):
        flyer_motion(none, placement, TIME, sigma=1e-6)


def damage(paths, frame, change):
    lines = paths[frame].read_text().splitlines()
    paths[frame].write_text("\n".join(change(lines)) + "\n")


def with_line(lines, index, text):
    return [*lines[:index], text, *lines[index + 1 :]]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            lambda lines: [lines[0].replace('"W"', '"exx"'), *lines[1:]],
            "lacks columns of 'vic3d'; its columns are X",
        ),
        (lambda lines: [*lines, lines[40]], r"0002_0.csv line 110: has the point|line 41: has the point"),
        (lambda lines: with_line(lines, 50, lines[50][:20]), "line 51: has 2 fields, the other lines have 9"),
        (lambda lines: with_line(lines, 50, "abc" + lines[50][3:]), "line 51: column 'X' is not a number"),
        (lambda lines: lines[:1], "has a header but no data|no column of numbers"),
    ],
)
def test_damaged_files_are_told_by_line(change, words, tmp_path):
    paths = write(tmp_path, "vic3d")
    damage(paths, 2, change)
    with pytest.raises(InputError, match=words) as caught:
        read(paths, "vic3d")
    assert "shot7_0002_0.csv" in str(caught.value)


def test_points_that_cannot_be_told_apart(tmp_path):
    paths = write(tmp_path, "vic3d")
    for path in paths:  # without pixels: rows are all there is
        rows = [", ".join(line.split(", ")[:7]) for line in path.read_text().splitlines()]
        path.write_text("\n".join(rows) + "\n")
    np.testing.assert_allclose(read(paths, "vic3d").X, in_program(*barrel())[0], rtol=0, atol=1e-11)
    damage(paths, 1, lambda lines: [*lines[:20], *lines[21:]])
    with pytest.raises(InputError, match="have 107 to 108 rows and nothing that identifies the points"):
        read(paths, "vic3d")


def renumbered(lines, number):
    """The same points under other numbers."""
    rest = [line.partition(",")[2] for line in lines[1:]]
    return [lines[0], *(f"{number(i)},{line}" for i, line in enumerate(rest))]


def test_coordinates_of_neither_kind(tmp_path):
    paths = write(tmp_path, "dice")
    damage(paths, 3, lambda lines: renumbered(lines, lambda i: 5000 + i))
    assert read(paths, "dice").X.shape[0] == 2 * ROWS * COLUMNS  # new numbers are new points
    damage(paths, 3, lambda lines: renumbered(lines, lambda i: ROWS * COLUMNS - 1 - i))
    damage(paths, 2, lambda lines: renumbered(lines, lambda i: ROWS * COLUMNS - 1 - i))
    damage(paths, 1, lambda lines: renumbered(lines, lambda i: (i + 7) % (ROWS * COLUMNS)))
    with pytest.raises(InputError, match=r"coordinates of a point change by .* and not by its displacement"):
        read(paths, "dice")


def test_names_without_a_frame_number(tmp_path):
    paths = write(tmp_path, "dice")
    moved = [paths[0].rename(tmp_path / "a_1_1.csv"), paths[1].rename(tmp_path / "a_2_2.csv")]
    with pytest.raises(InputError, match="no single number that differs"):
        read(moved, "dice")
    with pytest.raises(InputError, match="matches no file"):
        matching(tmp_path, "b_*.csv")
    with pytest.raises(InputError, match="is declared to be of 'paint'; it must be one of vic3d, aramis"):
        read(moved, "paint")


def surface_shot(folder: Path) -> Path:
    """open-01 with its outline as a VIC-3D export: every point of it turned to three places on the circle."""
    shot = shot_in(folder / "shot")
    rows = [line.split(",") for line in (shot / "centreline.csv").read_text().splitlines()[1:]]
    first = {}
    for frame in dict.fromkeys(row[0] for row in rows):
        lines = ['"X","Y","Z","U","V","W","sigma","x","y"']
        for place, row in enumerate(row for row in rows if row[0] == frame):
            for side, angle in enumerate(np.radians([-8.0, 0.0, 8.0])):
                y, r = float(row[2]), float(row[3])
                here = np.array([r * np.sin(angle), y + 3.0, r * np.cos(angle) - 20.0])
                start = first.setdefault((place, side), here)
                values = [*start, *(here - start)]
                lines.append(",".join([*(f"{v:.7f}" for v in values), "0.01", str(side), str(place)]))
        (shot / f"dic_{int(frame):04d}.csv").write_text("\n".join(lines) + "\n")
    text = (shot / "shot.toml").read_text()
    before, rest = text.split("[centre_line]", 1)
    after = rest[rest.index("\n[") :]
    section = """[surface]
pattern = "dic_*.csv"
program = "vic3d"
y = "+Y"
Z = "+Z"
frame = "declared"
origin = ["0 mm", "3 mm", "-20 mm"]
half_width = "1.2 mm"
sigma = "4 um"
"""
    (shot / "shot.toml").write_text(before + section + after)
    return shot


def test_a_shot_with_a_surface_has_the_outline_of_its_points(tmp_path):
    shot = load_shot(surface_shot(tmp_path))
    plain = load_shot(OPEN_01).centre_line
    assert shot.centre_line.Z.size == 3 * plain.Z.size
    for frame in np.unique(plain.frame)[::40]:
        mine, theirs = shot.centre_line.frame == frame, plain.frame == frame
        np.testing.assert_allclose(
            np.sort(shot.centre_line.y[mine]), np.sort(np.repeat(plain.y[theirs], 3)), rtol=0, atol=2e-10
        )  # printed to 1e-10 m
        np.testing.assert_allclose(shot.centre_line.time[mine], plain.time[theirs][0], rtol=0)
    assert "dic_*.csv" in shot.inputs
    run_kolsky("check", shot.folder)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('program = "vic3d"', 'program = "paint"',
         'surface.program = "paint" is not known; it must be one of "vic3d"'),
        ('Z = "+Z"', 'Z = "-Y"', 'surface.Z = "-Y" is the axis of y too'),
        ('half_width = "1.2 mm"', 'half_width = "-1 mm"', "surface.half_width"),
        ('origin = ["0 mm", "3 mm", "-20 mm"]', 'origin = ["0 mm", "3 mm", "20 mm"]',
         "surface.* does not fit its points"),
        ('pattern = "dic_*.csv"', 'pattern = "vic_*.csv"', "matches no file"),
        ('sigma = "4 um"', 'sigma = "4 um"\nflyer = { pattern = "f_*.csv", sigma = "1 um" }',
         "flyer .*is given twice"),
    ],
)  # fmt: skip
def test_bad_surfaces_are_told_with_their_key(old, new, words, tmp_path):
    shot = surface_shot(tmp_path)
    path = shot / "shot.toml"
    before, after = path.read_text().split("[surface]")
    assert old in after
    path.write_text(before + "[surface]" + after.replace(old, new, 1))
    with pytest.raises(InputError, match=words):
        load_shot(shot)
