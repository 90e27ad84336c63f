"""Runs of the page on contact's limits and ledgers: impacts to 60 %, a slow pull, a static compression."""

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scene import DENSITY, LENGTH, RADIUS, rms, shear_modulus, smooth_stroke, speed_after_rise

from explicit import Model, PlatenMotion, Response, Samples, Sampling, Stepping, cylinder, run
from explicit.materials import neo_hookean
from explicit.mesh import element_geometry

FloatArray = NDArray[np.float64]

END, POISSON, DAMPING = 1.5e-3, 0.495, 2.5e-5
"""End of the impacts at 2.6 m/s, at 60 % [s]; Poisson's ratio [-]; stiffness-proportional damping [s]."""
AREA = np.pi * RADIUS**2
"""Undeformed area of a face [m^2]."""
TIMES = np.linspace(0.0, END, 301)[1:]
STEP, N_STEPS = 0.5e-6, 3000
"""Step of the runs for the ledgers [s], below the stable one throughout, and how many there are."""
LAWS: dict[str, dict[str, float]] = {
    "frictionless": {},
    "coulomb": {"friction": 0.2},
    "penalty": {"friction": 0.2},
    "rough": {},
    "bonded_release": {"release_stress": 10e3},
    "bonded": {},
}
"""The laws, with parameters that make faces stick and slip, or let go."""
STIFFNESS = 10.0 ** np.arange(10.0, 15.1, 0.5)
"""Penalty stiffnesses [Pa/m]."""
FRICTION = 2.0 ** np.arange(-1, 13)
"""Coefficients on the way to infinity [-]."""
RELEASE = np.array([0.0, 0.3e3, 1e3, 3e3, 10e3, 20e3, 50e3, 100e3, np.inf])
"""Release stresses of the impacts [Pa]."""
PULLED = np.array([0.5e3, 1e3, 2e3, 4e3])
"""Release stresses of the slow pull [Pa]."""
SLOW, DRAG = 20e-3, 400.0
"""Duration of the slow pull and compression [s], and their mass-proportional damping [1/s]."""


def model(
    law: str, motion: PlatenMotion, mesh: tuple[int, int] = (16, 22), poisson: float = POISSON
) -> Model:
    """Faces and side with one law."""
    body = cylinder(RADIUS, LENGTH, n_radial=mesh[0], n_axial=mesh[1])
    return Model(body, DENSITY, (neo_hookean(shear_modulus(poisson)),), (motion,), faces=law, side=law)


@cache
def impact(law: str, **parameters: tuple[float, ...]) -> Response:
    """Impact at 2.6 m/s to 60 %, the side rolling onto both platens."""
    varied = {name: np.array(values) for name, values in parameters.items()}
    samples = Samples.of(poisson=POISSON, damping=DAMPING, **varied)  # type: ignore[arg-type]
    motion = speed_after_rise(2.6, 50e-6, end=END)
    return run(model(law, motion), samples, Sampling(TIMES, TIMES, all_nodes=True))


@dataclass(frozen=True)
class Ledger:
    """Every step of an impact with one law."""

    penetration: float
    """Deepest place of any node beyond a platen [m]."""
    rolled: int
    """Side nodes within 1 um of the transmission platen at the end, corner included."""
    momentum: float
    """Largest difference between the platens' impulses and the specimen's momentum, over the largest
    momentum [-]."""
    energy: float
    """Largest |external work minus its parts| over external work [-]."""
    friction: float
    """Lost to friction over external work at the end [-]."""
    impact: float
    """Lost in landing, or held by the penalty's springs, over external work at the end [-]."""
    tension: float
    """Smallest force on the transmission platen [N]."""
    step: float
    """Smallest step [s]."""


@cache
def ledger(law: str) -> Ledger:
    """Steps of one size, so that the velocity of each is the difference of two places within it."""
    motion = speed_after_rise(2.6, 50e-6, end=END)
    made = model(law, motion)
    body = made.mesh
    middle = (np.arange(N_STEPS) + 0.5) * STEP  # where the recorded impulses belong to the velocity
    twice = (middle[:, None] + 0.25 * STEP * np.array([-1.0, 1.0])).ravel()
    response = run(
        made,
        Samples.of(poisson=POISSON, damping=DAMPING, **LAWS[law]),  # type: ignore[arg-type]
        Sampling(middle, twice, all_nodes=True),
        stepping=Stepping(largest_step=STEP),
    )
    assert response.nodes is not None
    y = response.nodes[0, :, :, 1]
    mass = np.bincount(
        body.quads.ravel(), DENSITY * element_geometry(body).corner_volume.ravel(), minlength=body.n_nodes
    )
    momentum = (y[1::2] - y[::2]) @ mass / (0.5 * STEP)
    gained = (response.impulse_transmission - response.impulse_flyer)[0]
    flyer = LENGTH - motion(twice)
    energy = response.energy
    work = energy.external[0, -1]
    return Ledger(
        penetration=float(max(-y.min(), (y - flyer[:, None]).max())),
        rolled=int((np.abs(response.surface_y[0, -1]) < 1e-6).sum()),
        momentum=float(np.abs(gained - momentum).max() / np.abs(momentum).max()),
        energy=float(energy.imbalance()[0]),
        friction=float(energy.friction[0, -1] / work),
        impact=float(energy.impact[0, -1] / work),
        tension=float(response.force_transmission.min()),
        step=float(response.smallest_step[0]),
    )


@dataclass(frozen=True)
class Distance:
    """How far the simulations of a sweep are from their limit; shape [n] each."""

    outline: FloatArray
    """Radii of the side nodes, rms over nodes and times [m]."""
    force: FloatArray
    """Force on the transmission platen, rms over times, over its rms [-]."""
    impulse: FloatArray
    """Its impulse at the end [-]."""


def distance(sweep: Response, limit: Response) -> Distance:
    """Distance of every row from a response of one row."""
    force, impulse = limit.force_transmission[0], limit.impulse_transmission[0, -1]
    return Distance(
        outline=np.array([rms(radius - limit.surface_r[0]) for radius in sweep.surface_r]),
        force=np.array([rms(row - force) for row in sweep.force_transmission]) / rms(force),
        impulse=np.abs(sweep.impulse_transmission[:, -1] / impulse - 1.0),
    )


def same_bits(sweep: Response, row: int, one: Response) -> bool:
    """Whether a row is a single-row response to the last bit, every node and force at all times."""
    names = ("force_flyer", "force_transmission", "nodes")
    return all(np.array_equal(getattr(sweep, name)[row], getattr(one, name)[0]) for name in names)


def depth(response: Response) -> FloatArray:
    """Deepest place of any node beyond a platen at the recorded times [m], shape [n]."""
    assert response.nodes is not None
    y = response.nodes[..., 1]
    flyer = LENGTH - speed_after_rise(2.6, 50e-6, end=END)(TIMES)
    return np.asarray(np.maximum(-y.min(axis=(1, 2)), (y - flyer[:, None]).max(axis=(1, 2))))


@cache
def pull() -> FloatArray:
    """Largest tensile force of a slow pull without lateral contraction, over release stress times area [-],
    columns flyer and transmission platen, rows `PULLED`."""
    times = np.linspace(0.0, SLOW, 4001)[1:]
    back = smooth_stroke(-0.08 * LENGTH, SLOW, end=SLOW)
    samples = Samples.of(poisson=0.0, damping=DAMPING, mass_damping=DRAG, release_stress=PULLED)
    response = run(model("bonded_release", back, (6, 8), 0.0), samples, Sampling(times, times[-1:]))
    forces = np.stack([response.force_flyer, response.force_transmission], axis=-1)
    assert np.array_equal(forces[:, -1], np.zeros((len(PULLED), 2)))  # both faces came off
    return np.asarray(-forces.min(axis=1) / (PULLED * AREA)[:, None])


@cache
def stuck() -> FloatArray:
    """Largest radial displacement of a face that sticks on springs after a slow compression to 20 % [m], rows
    `STIFFNESS`."""
    end = np.array([SLOW])
    push = smooth_stroke(0.2 * LENGTH, SLOW, end=SLOW)
    samples = Samples.of(
        poisson=POISSON, damping=DAMPING, mass_damping=DRAG, friction=1e3, contact_stiffness=STIFFNESS
    )
    made = model("penalty", push, (6, 8))
    response = run(made, samples, Sampling(end, end, all_nodes=True))
    assert response.nodes is not None
    face = made.mesh.lower_face
    return np.asarray(np.abs(response.nodes[:, -1, face, 0] - made.mesh.nodes[face, 0]).max(axis=1))


@cache
def twice() -> tuple[FloatArray, FloatArray]:
    """Slowly pulled by 5 % of the length, pressed by 5 % and pulled again, bonded and letting go at 1 kPa:
    smallest and largest force of the flyer [N], rows first pull, push, second pull."""
    stroke, turn, times = 0.05 * LENGTH, 3.0 * np.pi / SLOW, np.linspace(0.0, SLOW, 1201)[1:]
    wave = PlatenMotion.sampled(
        lambda t: -stroke * np.sin(turn * t) ** 3,
        lambda t: -3.0 * turn * stroke * np.sin(turn * t) ** 2 * np.cos(turn * t),
        start=0.0,
        end=SLOW,
        n_knots=3001,
    )
    made = model("bonded_release", wave, (6, 8))
    samples = Samples.of(
        poisson=POISSON, damping=DAMPING, mass_damping=DRAG, release_stress=np.array([np.inf, 1e3])
    )
    force = run(made, samples, Sampling(times, times[-1:])).force_flyer
    bonded, released = (np.array([[part.min(), part.max()] for part in np.split(row, 3)]) for row in force)
    return bonded, released


@cache
def press() -> FloatArray:
    """Penetration of a face's nodes times stiffness over pressure after a slow frictionless compression to
    20 % [-], rows `STIFFNESS`, columns nodes of the face on the transmission platen."""
    end = np.array([SLOW])
    push = smooth_stroke(0.2 * LENGTH, SLOW, end=SLOW)
    samples = Samples.of(poisson=POISSON, damping=DAMPING, mass_damping=DRAG, contact_stiffness=STIFFNESS)
    made = model("penalty", push, (6, 8))
    response = run(made, samples, Sampling(end, end, all_nodes=True))
    assert response.nodes is not None
    pressure = response.force_transmission[:, -1] / AREA
    return np.asarray(-response.nodes[:, -1, made.mesh.lower_face, 1] * (STIFFNESS / pressure)[:, None])
