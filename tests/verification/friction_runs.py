"""Compression with Coulomb friction: static solutions of GetFEM, slow loadings and impacts."""

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from outline import distances, rms
from scene import DENSITY, LENGTH, RADIUS, shear_modulus, speed_after_rise

from explicit import Model, Samples, Sampling, cylinder, run
from explicit.materials import neo_hookean
from explicit.mesh import element_geometry

FloatArray = NDArray[np.float64]

REFERENCE = Path(__file__).resolve().parent.parent / "reference"
POISSON = 0.495
FRICTION = (0.05, 0.1, 0.2, 0.3, 0.5, 1000.0)
"""Coefficients of the reference; the last one never slips."""
COMPRESSION = np.array([0.1, 0.2, 0.3, 0.4, 0.5, 0.6])
"""Nominal compressions that are recorded [-]; the reference says up to which one it is known."""
STROKE, DURATION, RISE, DRAG = 0.61, 0.1, 0.1, 200.0
"""Compression at the end [-], duration [s], share of it in which the platen picks up speed [-] and
mass-proportional damping [1/s]: the slow loading of `static_bonded.py`."""
DAMPING = 2.5e-5
"""Stiffness-proportional damping beta [s], the paper's: it stops the flutter of sliding faces."""
COARSE, EVEN, FINE = (16, 22, 1.0), (32, 44, 1.0), (32, 44, 3.0)
"""Meshes: elements across the radius and along the length, largest element over smallest."""
IMPACT_END = 1.5e-3
"""End of the impacts at 2.6 m/s [s], at 60 %."""


@dataclass(frozen=True)
class Known:
    """The static solution for one coefficient; the first axis is compression."""

    compression: FloatArray
    """Compressions at which the solution is known [-], shape [n]."""
    force: FloatArray
    """Force [N], shape [n]."""
    force_error: FloatArray
    """Its uncertainty [N], shape [n]."""
    corner: FloatArray
    """Radius of the face's edge [m], shape [n]."""
    corner_error: FloatArray
    """Its uncertainty [m], shape [n]."""
    middle: FloatArray
    """Radius at mid-height [m], shape [n]."""
    middle_error: FloatArray
    """Its uncertainty [m], shape [n]."""
    contact: FloatArray
    """Radius of the area that presses on the platen [m], shape [n]."""
    contact_error: FloatArray
    """Its uncertainty [m], shape [n]."""
    outline: FloatArray
    """Side surface (r, distance from mid-height) from middle to edge [m], shape [n, n_points, 2]."""
    face_start: FloatArray
    """Places on the face before loading [m], shape [n_places]."""
    face: FloatArray
    """Their radii [m], shape [n, n_places]."""


@dataclass(frozen=True)
class Found:
    """One slow loading with one coefficient; the first axis is compression."""

    force: FloatArray
    """Mean of both face forces [N], shape [6]."""
    uneven: FloatArray
    """Flyer force minus transmission force [N], shape [6]."""
    corner: FloatArray
    """Radius of the edge, mean of both faces [m], shape [6]."""
    middle: FloatArray
    """Radius at mid-height [m], shape [6]."""
    contact: FloatArray
    """Largest radius of a node on a platen [m], shape [6]."""
    outline: FloatArray
    """Side nodes (r, distance from mid-height) [m], shape [6, n_nodes, 2]."""
    face_start: FloatArray
    """Nodes of a face before loading [m], shape [n_places]."""
    face: FloatArray
    """Their radii, mean of both faces [m], shape [6, n_places]."""
    kinetic: FloatArray
    """Kinetic over elastic energy [-], shape [6]."""
    imbalance: FloatArray
    """External work minus the sum of its parts over external work [-], shape [6]."""
    penetration: float
    """Deepest place of a surface node beyond a platen [m]."""
    completed: bool
    """Whether the run reached its end."""


@cache
def known(friction: float) -> Known:
    """Read the reference for a coefficient."""

    def rows(name: str) -> FloatArray:
        table = np.loadtxt(REFERENCE / name, delimiter=",")
        return np.asarray(table[table[:, 0] == friction][:, 1:])

    scalars, outline, face = (rows(f"G_friction_{name}.csv") for name in ("force", "outline", "face"))
    compression = scalars[:, 0]
    n = len(compression)
    lines = outline.reshape(n, -1, outline.shape[1])
    places = face.reshape(n, -1, face.shape[1])
    return Known(
        compression,
        *scalars[:, 1:].T,
        outline=lines[:, :, [3, 2]],
        face_start=places[0, :, 1],
        face=places[:, :, 2],
    )


@cache
def compress(
    mesh: tuple[int, int, float],
    damping: float = DAMPING,
    element: str = "one_point",
    friction: tuple[float, ...] = FRICTION,
    contact: str = "coulomb",
) -> tuple[Found, ...]:
    """Load slowly at constant speed, one run a coefficient."""
    rise = RISE * DURATION
    speed = STROKE * LENGTH / (DURATION - 0.5 * rise)
    when = 0.5 * rise + COMPRESSION * LENGTH / speed  # the rise covers half of speed times rise
    motion = speed_after_rise(speed, rise, end=DURATION, n_knots=4001)
    body = cylinder(RADIUS, LENGTH, n_radial=mesh[0], n_axial=mesh[1], grading=mesh[2])
    law = neo_hookean(shear_modulus(POISSON))
    model = Model(body, DENSITY, (law,), (motion,), faces=contact, side=contact, element=element)
    samples = Samples.of(
        poisson=POISSON, mass_damping=DRAG, damping=damping, friction=np.array(friction, dtype=float)
    )
    response = run(model, samples, Sampling(when, when, all_nodes=True))
    assert response.nodes is not None
    platen = LENGTH - motion(when)[:, None]
    found = []
    for i in range(len(friction)):
        r, y = response.surface_r[i], response.surface_y[i]
        faces = response.nodes[i][:, [body.lower_face, body.upper_face], 0]
        edge = np.concatenate([body.side, body.lower_face, body.upper_face])
        every_r, every_y = response.nodes[i][:, edge, 0], response.nodes[i][:, edge, 1]
        on_platen = (every_y < 1e-9) | (every_y > platen - 1e-9)
        ledger = response.energy.select(np.array([i]))
        middle = 0.5 * platen[:, 0]
        found.append(
            Found(
                force=0.5 * (response.force_flyer[i] + response.force_transmission[i]),
                uneven=response.force_flyer[i] - response.force_transmission[i],
                corner=0.5 * (r[:, 0] + r[:, -1]),
                middle=np.array([np.interp(m, *pair) for m, *pair in zip(middle, y, r, strict=True)]),
                contact=np.where(on_platen, every_r, 0.0).max(axis=1),
                outline=np.stack([r, np.abs(y - middle[:, None])], axis=-1),
                face_start=body.nodes[body.lower_face, 0],
                face=faces.mean(axis=1),
                kinetic=(ledger.kinetic / ledger.elastic)[0],
                imbalance=(ledger.residual / ledger.external)[0],
                penetration=float(max(-every_y.min(), (every_y - platen).max())),
                completed=bool(response.completed[i]),
            )
        )
    return tuple(found)


def force_difference(found: Found, reference: Known) -> FloatArray:
    """Relative difference of the force where the reference is known [-], shape [n]."""
    return found.force[: len(reference.force)] / reference.force - 1.0


def outline_difference(found: Found, reference: Known) -> FloatArray:
    """Root-mean-square normal distance of the side nodes to the reference's outline [m], shape [n]."""
    pairs = zip(found.outline, reference.outline, strict=False)
    return np.array([rms(distances(points, line)) for points, line in pairs])


def face_difference(found: Found, reference: Known) -> FloatArray:
    """Largest difference of the radii of the face's nodes [m], shape [n]."""
    each = [
        np.abs(mine - np.interp(found.face_start, reference.face_start, theirs)).max()
        for mine, theirs in zip(found.face, reference.face, strict=False)
    ]
    return np.array(each)


@dataclass(frozen=True)
class Impact:
    """Impacts at 2.6 m/s without drag, one a coefficient; coarse mesh."""

    friction: FloatArray
    """Coefficients [-], shape [n]."""
    energy: FloatArray
    """Largest |external work minus its parts| over external work [-], shape [n]."""
    momentum: FloatArray
    """Largest error of the path of the centre of mass, from the platens' impulses, over the path [-],
    shape [n]."""
    dissipated: FloatArray
    """Lost to friction over external work at the end [-], shape [n]."""
    given_back: float
    """Largest fall of the friction entry between two times over external work [-]."""
    penetration: float
    """Deepest place of a surface node beyond a platen [m]."""


@cache
def impact() -> Impact:
    """Faces and side that stick and slip in the waves of an impact."""
    friction = np.array(FRICTION)
    motion = speed_after_rise(2.6, 50e-6, end=IMPACT_END)
    body = cylinder(RADIUS, LENGTH)
    law = neo_hookean(shear_modulus(POISSON))
    model = Model(body, DENSITY, (law,), (motion,), faces="coulomb", side="coulomb")
    times = np.linspace(0.0, IMPACT_END, 3001)[1:]
    shown = times[49::50]
    samples = Samples.of(poisson=POISSON, damping=DAMPING, friction=friction)
    response = run(model, samples, Sampling(times, shown, all_nodes=True))
    assert response.nodes is not None
    mass = np.bincount(
        body.quads.ravel(), DENSITY * element_geometry(body).corner_volume.ravel(), minlength=body.n_nodes
    )
    path = (response.nodes[..., 1] - body.nodes[:, 1]) @ mass  # of the centre, times the mass [kg m]
    gained = np.pad(response.impulse_transmission - response.impulse_flyer, ((0, 0), (1, 0)))
    travelled = np.cumsum(0.5 * (gained[:, 1:] + gained[:, :-1]) * times[0], axis=1)[:, 49::50]
    height = response.surface_y
    work = response.energy.external[:, -1]
    return Impact(
        friction=friction,
        energy=response.energy.imbalance(),
        momentum=np.abs(path - travelled).max(axis=1) / np.abs(path).max(axis=1),
        dissipated=response.energy.friction[:, -1] / work,
        given_back=float(-(np.diff(response.energy.friction, axis=1) / work[:, None]).min()),
        penetration=float(max(-height.min(), (height - (LENGTH - motion(shown))[:, None]).max())),
    )
