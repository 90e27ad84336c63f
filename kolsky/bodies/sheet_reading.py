"""Read the [field] of a SPEC.toml and its files: a sheet with measured data, or with simulated data."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from kolsky.base.arrays import BoolArray, FloatArray, IntArray
from kolsky.base.errors import InputError
from kolsky.base.toml import TomlFile
from kolsky.bodies.sheet import (
    NEIGHBOURS,
    NOISE_POINTS,
    Sheet,
    cells_inside,
    outliers,
    point_noise,
    project,
    spacing,
)
from kolsky.bodies.sheet_fit import SMALLEST_EIGENVALUE, FieldData, FieldProblem
from kolsky.bodies.specimen_constants import POISSON, Constants, solid_of
from kolsky.bodies.specimen_fit import Expected, plan
from kolsky.bodies.specimen_reading import FieldSection, Specification, read_constants
from kolsky.equilibrium.elements import ELEMENTS, element
from kolsky.equilibrium.meshes import Mesh
from kolsky.equilibrium.solid import Solid
from kolsky.readers.meshes import MeshFile, read_mesh
from kolsky.readers.table import Column, read_table

KINDS = {one.n_nodes: one.name for one in ELEMENTS.values() if one.dimension == 2}
"""Element type by the number of its points."""


@dataclass(frozen=True)
class MeasuredField:
    """The problem of a sheet with its measured data."""

    problem: FieldProblem
    points: FloatArray
    """Measured points [m], shape [n, 2]."""
    left_out: BoolArray
    """Points rejected as outliers, shape [n]."""
    displacements: FloatArray
    """Displacements of the points [m], shape [frames, n, 2]."""
    frames: tuple[int, ...]
    inputs: dict[str, str]
    """SHA-256 of the files, by name."""
    declared_sigma: float | None = None
    """Declared standard deviation of a point's displacement [m]; None: estimated from the points."""


def read_field(spec: Specification) -> MeasuredField:
    """Read the mesh, the points and the pad of a sheet."""
    section, toml = spec.declared.field, spec.toml
    assert section is not None  # checked by the caller
    folder = toml.path.parent
    raw = read_mesh(folder / section.mesh, dimension=2)
    sheet, constants = _sheet(spec, section, raw)
    hashes: dict[str, str] = {}
    hashes[section.mesh] = raw.sha256
    points, displacements, hashes[section.points.file] = _points(toml, section)
    pad, force, hashes[section.pad.file] = _pad(toml, section)
    declared = section.sigma_displacement
    if len(points) < (NOISE_POINTS if declared is None else NEIGHBOURS):
        raise toml.error(
            "field.points",
            f"has {len(points)} points a frame in {section.points.file}: too few",
            allowed=f"at least {NEIGHBOURS}, since a quadratic through {NEIGHBOURS} neighbours gives the "
            f"value at a node; at least {NOISE_POINTS} without field.sigma_displacement, for their noise",
            cure='export more points of the same frames, or declare field.sigma_displacement, e.g. "5 um"',
        )
    bad = np.zeros(len(points), dtype=np.bool_)
    flat = np.moveaxis(displacements, 0, 1).reshape(len(points), -1)
    if section.points.gated:
        bad = outliers(points, flat, gate=section.points.gate)
    if not (declared or point_noise(points[~bad], flat[~bad])) > 0.0:
        raise toml.error(
            "field.sigma_displacement", "is missing, and the points show no noise", cure='write e.g. "5 um"'
        )
    every = np.ones(len(sheet.mesh.cells), dtype=np.bool_)
    data = FieldData(
        pad, force, displacements[:, :0], every, declared or 0.0, section.sigma_force, spacing(points) ** 2,
        section.relative_to == "camera",
    )  # fmt: skip
    problem = FieldProblem(sheet, data, constants)
    frames = tuple(section.frames)
    measured = keeping(MeasuredField(problem, points, bad, displacements, frames, hashes, declared), bad)
    if not measured.problem.data.cells.any():
        scale = mesh_scale(sheet.mesh.points, points)
        unit = f"; the mesh would hold them if it were {scale:g} times as large" if scale else ""
        raise toml.error(
            "field.points",
            f"lie on no whole cell of the mesh{unit}",
            cure="check field.mesh_unit, the units of x and y, and the origin",
        )
    return measured


def mesh_scale(nodes: FloatArray, points: FloatArray) -> float | None:
    """Common length factor for which the nodes' box contains the points. The box may be at most twice as
    large as the points' extent."""
    size, wanted = np.ptp(nodes, axis=0), np.ptp(points, axis=0)
    for factor in (1e3, 1e-3, 10.0, 0.1, 25.4, 1.0 / 25.4):
        low, high = factor * nodes.min(axis=0), factor * nodes.max(axis=0)
        held = ((points >= low) & (points <= high)).all()
        if held and (factor * size <= 2.0 * wanted).all():
            return factor
    return None


def keeping(measured: MeasuredField, left_out: BoolArray) -> MeasuredField:
    """The field without some of its points, projected on the mesh again.

    ``left_out``: shape [n]. Raises ValueError if too few are left.
    """
    problem, points = measured.problem, measured.points
    kept = ~left_out
    own = points[kept]
    flat = np.moveaxis(measured.displacements, 0, 1).reshape(len(points), -1)[kept]
    mesh = problem.sheet.mesh
    low, high = own.min(axis=0), own.max(axis=0)
    margin = 1e-12 * float((high - low).max())
    projected = project(own, flat, mesh.points)
    data = replace(
        problem.data,
        displacements=np.moveaxis(projected.reshape(len(projected), -1, 2), 0, 1),
        cells=cells_inside(mesh, low - margin, high + margin),
        sigma_displacement=measured.declared_sigma or point_noise(own, flat),
    )
    changed = FieldProblem(problem.sheet, data, problem.constants)
    return replace(measured, problem=changed, left_out=left_out)


def _sheet(spec: Specification, section: FieldSection, raw: MeshFile) -> tuple[Sheet, Constants]:
    """The sheet, and the constants with those of its other regions."""
    toml, constants = spec.toml, spec.constants
    groups, curves = raw.cell_groups, raw.groups
    sets = {}
    for key, names in (("moving", section.moving), ("fixed", section.fixed)):
        for name in names:
            if name not in curves:
                raise toml.error(
                    f"field.{key}",
                    f"names {name!r}, no group of curves of the mesh",
                    allowed=", ".join(curves),
                )
        sets[f"the {key} pad"] = np.unique(np.concatenate([curves[name] for name in names]))
    moving, fixed = sets
    if np.isin(sets[moving], sets[fixed]).any():
        raise toml.error(
            "field.moving", "shares points with field.fixed", cure="name two pads that are apart"
        )
    cells, turned = counterclockwise(raw.points, raw.cells)
    mesh = Mesh(section.mesh_unit * raw.points, cells, KINDS[cells.shape[1]], sets, raw.numbers)
    regions = None
    held: dict[int, Solid] = {}
    if section.region is not None:
        if section.region not in groups:
            raise toml.error("field.region", "is no group of surfaces", allowed=", ".join(groups))
        constants, held = _further(toml, section, constants, [n for n in groups if n != section.region])
        regions = np.zeros(len(cells), dtype=np.int64)
        order = [*constants.regions, *(n for n in groups if n not in (section.region, *constants.regions))]
        for number, name in enumerate(order, start=1):
            regions[groups[name]] = number
    elif section.regions:
        raise toml.error(
            "field.region", "is missing", cure="name the group of surfaces that [material] is of"
        )
    axis = "xy".index(section.axis)
    sheet = Sheet(
        mesh, section.kinematics, section.thickness, moving, fixed, axis, regions, held, spec.device, turned
    )
    return sheet, constants


def counterclockwise(points: FloatArray, cells: IntArray) -> tuple[IntArray, int]:
    """Cells with counter-clockwise node order, and the number of reversed cells. The shapes do not change."""
    kind = KINDS[cells.shape[1]]
    corners = points[cells[:, : 3 if kind.startswith("tri") else 4]]
    later = np.roll(corners, -1, axis=1)
    area = 0.5 * (corners[..., 0] * later[..., 1] - corners[..., 1] * later[..., 0]).sum(axis=1)
    clockwise = area < 0.0
    turned = cells.copy()
    nodes = element(kind).nodes  # a mirrored cell has its reference coordinates swapped
    turned[clockwise] = cells[clockwise][:, (nodes[:, None] == nodes[:, ::-1]).all(axis=2).argmax(axis=0)]
    return turned, int(clockwise.sum())


def _further(
    toml: TomlFile, section: FieldSection, constants: Constants, names: list[str]
) -> tuple[Constants, dict[int, Solid]]:
    """The constants with the free ones of other regions, and the materials of fixed regions."""
    law, values, free, regions = constants.law, dict(constants.values), list(constants.free), []
    fixed = {}
    for name in names:
        key = f"field.regions.{name}"
        if name not in section.regions:
            raise toml.error(key, "is missing", cure="add its constants and poisson; free = [] holds them")
        own = section.regions[name]
        given = read_constants(toml, f"{key}.constants", law, own.constants) | {POISSON: own.poisson}
        if not own.free:
            fixed[name] = given
            continue
        for free_name in own.free:
            if free_name not in given:
                raise toml.error(f"{key}.free", f"names {free_name!r}", allowed=", ".join(given))
        regions.append(name)
        values |= {f"{name}.{one}": value for one, value in given.items()}
        free += [f"{name}.{one}" for one in own.free]
    held = {len(regions) + k: solid_of(law, given) for k, given in enumerate(fixed.values(), start=1)}
    return Constants(law, values, tuple(free), tuple(regions)), held


def _points(toml: TomlFile, section: FieldSection) -> tuple[FloatArray, FloatArray, str]:
    """Points, their displacements in the fitted frames, and the file's hash."""
    own = section.points
    path = toml.path.parent / own.file
    table = read_table(path, layout=None if own.layout is None else own.layout.as_layout())
    frame = table.integers(Column(own.frame))
    columns = np.stack([table.values(c.as_column()) for c in (own.x, own.y, own.ux, own.uy)], axis=-1)
    rows = [columns[frame == number] for number in section.frames]
    for number, values in zip(section.frames, rows, strict=True):
        if not len(values):
            raise toml.error("field.frames", f"names frame {number}, which {own.file} does not have")
        if len(values) != len(rows[0]):
            raise InputError(
                path,
                f"has {len(values)} points in frame {number}, {len(rows[0])} in the first",
                cure="export the same points in every frame",
            )
        if not np.array_equal(values[:, :2], rows[0][:, :2]):
            raise InputError(
                path, f"has other points in frame {number}", cure="export the points of the reference"
            )
    whole = np.stack(rows)
    return whole[0, :, :2].copy(), whole[..., 2:].copy(), table.sha256


def _pad(toml: TomlFile, section: FieldSection) -> tuple[FloatArray, FloatArray, str]:
    own = section.pad
    path: Path = toml.path.parent / own.file
    table = read_table(path, layout=None if own.layout is None else own.layout.as_layout())
    frame = table.integers(Column(own.frame))
    rows = [np.flatnonzero(frame == number) for number in section.frames]
    for number, place in zip(section.frames, rows, strict=True):
        if len(place) != 1:
            raise toml.error("field.frames", f"names frame {number}: {own.file} has {len(place)} rows of it")
    displacement, force = (
        table.values(c.as_column())[np.concatenate(rows)] for c in (own.displacement, own.force)
    )
    return displacement, force, table.sha256


FIELD, FORCE = "field", "force"
"""Names of the two parts of a sheet's test."""


@dataclass(frozen=True)
class SimulatedSheet:
    """Simulated measurements of a sheet."""

    frames: tuple[int, ...]
    points: FloatArray
    """Positions of the points [m], shape [n, 2]."""
    displacements: FloatArray
    """Displacements of the points, with noise if requested [m], shape [frames, n, 2]."""
    pad: FloatArray
    """Displacement of the moving pad [m], shape [frames]."""
    force: FloatArray
    """Force on it, with noise if requested [N], shape [frames]."""

    @property
    def point_columns(self) -> dict[str, FloatArray]:
        """Columns of the CSV file that `[field.points]` can name."""
        n = len(self.points)
        places = np.tile(self.points, (len(self.frames), 1))
        moved = self.displacements.reshape(-1, 2)
        return {
            "frame": np.repeat(self.frames, n),
            "x (mm)": 1e3 * places[:, 0],
            "y (mm)": 1e3 * places[:, 1],
            "ux (mm)": 1e3 * moved[:, 0],
            "uy (mm)": 1e3 * moved[:, 1],
        }

    @property
    def pad_columns(self) -> dict[str, FloatArray]:
        """Columns of the CSV file that `[field.pad]` can name."""
        return {"frame": np.array(self.frames), "pad (mm)": 1e3 * self.pad, "force (mN)": 1e3 * self.force}


def simulate_sheet(measured: MeasuredField, *, seed: int | None = None) -> SimulatedSheet:
    """Simulated data of a sheet with the declared constants, at the positions and noise of its files.

    ``seed``: seed of the noise of displacements and forces; None: no noise.
    """
    problem = measured.problem
    cost = problem.cost(problem.constants.start)
    nodal = np.moveaxis(cost.state.displacements, 0, 1)
    at_points = project(problem.sheet.mesh.points, nodal.reshape(len(nodal), -1), measured.points)
    u = np.moveaxis(at_points.reshape(len(measured.points), -1, 2), 0, 1)
    force = cost.state.force
    if seed is not None:
        rng = np.random.default_rng(seed)
        u = u + problem.data.sigma_displacement * rng.standard_normal(u.shape)
        force = force + problem.data.sigma_force * rng.standard_normal(force.shape)
    return SimulatedSheet(measured.frames, measured.points, u, problem.data.pad, force)


def plan_sheet(problem: FieldProblem, *, wanted: tuple[str, ...] = ()) -> list[Expected]:
    """Expected deviations of the constants from field and force together, and from each separately. The
    information of the field is int du/dm_I . du/dm_J / (a sigma_u^2), which is Eq. (K.30) over the noise of
    one point per area a. That of the force is df/dm_I df/dm_J / sigma_f^2."""
    cost, data, constants = problem.cost(problem.constants.start), problem.data, problem.constants
    variance = data.area * data.sigma_displacement**2
    sizes = np.maximum(np.abs(constants.start), 1e-3 * constants.scales)
    information = cost.curvature_displacement / variance * np.outer(sizes, sizes)
    values, vectors = np.linalg.eigh(information)
    seen = values > SMALLEST_EIGENVALUE * values[-1]
    rows = np.zeros_like(vectors)
    rows[seen] = (vectors * np.sqrt(np.maximum(values, 0.0))).T[seen] / sizes
    whitened = {FIELD: rows, FORCE: cost.state.force_by_constants / data.sigma_force}
    peak = float(np.abs(cost.state.force).max())
    choices = ((FIELD, FORCE), (FIELD,), (FORCE,))
    return plan(choices, whitened, {FIELD: peak, FORCE: peak}, constants, wanted=wanted)
