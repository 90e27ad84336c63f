"""Bonded compression, slowly loaded, against the static solutions of two finite-element programs."""

from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scene import DENSITY, LENGTH, RADIUS, distances, rms, shear_modulus, speed_after_rise

from explicit import Model, Samples, Sampling, cylinder, run
from explicit.materials import neo_hookean

FloatArray = NDArray[np.float64]

REFERENCE = Path(__file__).resolve().parent.parent / "reference"
POISSON = 0.495
COMPRESSION = np.array([0.1, 0.2, 0.3, 0.4, 0.5, 0.6])  # nominal compressions that are compared [-]
SWEEP = np.arange(0.05, 0.6001, 0.0025)
"""Compressions at which the force and the number of nodes on the platen are recorded [-]."""
STROKE = 0.61  # compression at which the loading ends [-]
DURATION = 0.1  # duration of the loading [s]: 150 passages of a wave
DRAG = 200.0  # Mass-proportional damping alpha [1/s]
RISE = 0.1  # share of the duration in which the platen picks up speed [-]
COARSE, FINE = (16, 22), ((32, 44), (48, 66))  # Meshes: elements across the radius and along the length
STUDY_DRAG, STUDY_DURATIONS = 2000.0, (0.025, 0.05, 0.1)
"""The study of what the loading itself adds: ten times the drag, three durations [s]."""
FORCE_TOLERANCE = {"coarse": 0.02, "fine": 0.005}
"""Allowed relative force error [-]: h^2 discretisation, 1 % at 16 x 22, plus the reference's own 0.1 %."""
RADIUS_TOLERANCE = {"coarse": 20e-6, "fine": 10e-6}
"""Allowed error of the radius at mid-height [m]: 0.01 mm is what a camera resolves."""
LARGE = COMPRESSION > 0.25  # where the reference is known to 0.1 %


Compressed = Reference = Result = SimpleNamespace


@cache
def reference() -> Reference:
    """Read the reference solutions."""
    rows = np.loadtxt(REFERENCE / "A_force_radius.csv", delimiter=",")
    outline = {}
    for side in ("stick", "slip"):
        columns = np.loadtxt(REFERENCE / f"A_nh_nu0.495_profiles_{side}.csv", delimiter=",").T
        outline[side] = np.stack([columns[2::2], columns[1::2]], axis=-1)
    return Reference(
        force=rows[:, 1],  # force [N], shape [6]
        sigma=rows[:, 2],  # its uncertainty [N], shape [6]
        radius=rows[:, 4],  # radius at mid-height [m], shape [6]
        outline=outline,  # Outline (r, z) by what the side does on a platen [m], shape [6, n_points, 2].
    )


@cache
def compress(
    mesh: tuple[int, int],
    duration: float = DURATION,
    drag: float = DRAG,
    *,
    element: str = "one_point",
    hourglass: float = 0.3,
) -> Compressed:
    """Load slowly at constant speed; forces and outlines at the six compressions."""
    rise = RISE * duration
    speed = STROKE * LENGTH / (duration - 0.5 * rise)

    def when(compression: FloatArray) -> FloatArray:
        return 0.5 * rise + compression * LENGTH / speed  # the rise covers half of speed times rise

    model = Model(
        cylinder(RADIUS, LENGTH, n_radial=mesh[0], n_axial=mesh[1]),
        DENSITY,
        (neo_hookean(shear_modulus(POISSON)),),
        (speed_after_rise(speed, rise, end=duration, n_knots=4001),),
        faces="bonded",
        side="bonded",
        element=element,
        hourglass=hourglass,
    )
    response = run(model, Samples.of(poisson=POISSON, mass_damping=drag), Sampling(when(SWEEP), when(SWEEP)))

    six = np.searchsorted(SWEEP, COMPRESSION - 1e-9)
    force = 0.5 * (response.force_flyer[0] + response.force_transmission[0])
    r, y = response.surface_r[0, six], response.surface_y[0, six]
    middle = 0.5 * y[:, -1]
    return Compressed(
        force=force[six],  # mean of both face forces [N], shape [6]
        # flyer force minus transmission force [N], shape [6]
        difference=(response.force_flyer[0] - response.force_transmission[0])[six],
        sweep=force,  # mean of both face forces at `SWEEP` [N]
        # radius at mid-height [m], shape [6]
        radius=np.array([np.interp(m, *pair) for m, *pair in zip(middle, y, r, strict=True)]),
        # surface nodes (r, |distance from mid-height|) [m], shape [6, n_nodes, 2]
        outline=np.stack([r, np.abs(y - middle[:, None])], axis=-1),
        # kinetic over elastic energy [-], shape [6]
        kinetic=(response.energy.kinetic[0] / response.energy.elastic[0])[six],
        # hourglass over elastic energy [-], shape [6]
        hourglass=(response.energy.hourglass[0] / response.energy.elastic[0])[six],
        speed=speed,  # speed of the flyer [m/s]
        completed=bool(response.completed.all()),  # whether the run reached its end
    )


def study() -> tuple[Compressed, ...]:
    """The same loading with strong drag, ever slower, on the coarse mesh."""
    return tuple(compress(COARSE, duration, STUDY_DRAG) for duration in STUDY_DURATIONS)


@cache
def case() -> Result:
    """All meshes (a minute) and the study."""
    meshes = {mesh: compress(mesh) for mesh in (COARSE, *FINE)}
    return Result(
        reference=reference(),
        meshes=meshes,  # slow loading by mesh
        study=study(),  # loading with strong drag, by duration
    )


def force_error(found: Compressed) -> FloatArray:
    """Relative force error [-], shape [6]."""
    return found.force / reference().force - 1.0


def outline_error(found: Compressed, side: str) -> FloatArray:
    """Root-mean-square and largest normal distance of the surface nodes to a reference's outline [m],
    shape [2, 6]."""
    lines = reference().outline[side]
    each = [distances(points, line) for points, line in zip(found.outline, lines, strict=True)]
    return np.array([[rms(d) for d in each], [d.max() for d in each]])


def drag_difference(found: Compressed, drag: float) -> float:
    """What the drag alone makes the face forces differ by [N].

    alpha M v with the mass M and the speed v of its centre, half the flyer's by symmetry.
    """
    mass = DENSITY * np.pi * RADIUS**2 * LENGTH
    return float(drag * mass * 0.5 * found.speed)


def loading_part(runs: tuple[Compressed, ...]) -> FloatArray:
    """Steps of the mean force between neighbouring durations over the force, shape [n_durations - 1, 6]."""
    forces = np.array([one.force for one in runs])
    return -np.diff(forces, axis=0) / reference().force


def homogeneous_drag(found: Compressed, drag: float) -> FloatArray:
    """What the drag adds to the mean face force if the deformation is homogeneous [N], shape [6].

    alpha M v (1/12 + R^2 / (8 L^2)) with the current R and L: the power of the drag on the velocity relative
    to the centre, axial and radial, over v.
    """
    mass = DENSITY * np.pi * RADIUS**2 * LENGTH
    shape = (RADIUS / LENGTH) ** 2 / (1.0 - COMPRESSION) ** 3
    return np.asarray(drag * mass * found.speed * (1.0 / 12.0 + shape / 8.0))


def draw(result: Result, figure: Figure) -> None:
    """Draw the figure of the page."""
    left, right = figure.subplots(1, 2, width_ratios=(1.0, 1.15))
    percent = 100 * COMPRESSION
    band = 100 * result.reference.sigma / result.reference.force
    left.fill_between(percent, -band, band, color="0.85", linewidth=0, label="reference")
    left.axhline(0.0, color="0.6", linewidth=0.6)
    for (mesh, found), mark in zip(result.meshes.items(), ("o-", "s-", "^-"), strict=True):
        left.plot(percent, 100 * force_error(found), mark, label=f"{mesh[0]} × {mesh[1]}")
    left.set(xlabel="compression [%]", ylabel="force error [%]", ylim=(-0.5, None))
    left.legend()
    for k in (1, 3, 5):
        line = result.reference.outline["stick"][k] * 1e3
        right.plot(*line.T, color="0.3", linewidth=0.8, label="reference" if k == 1 else None)
        for mesh, mark, color in ((COARSE, "o", "C0"), (FINE[-1], ".", "C2")):
            points = result.meshes[mesh].outline[k] * 1e3
            half = points[: mesh[1] // 2 + 1]
            label = f"{mesh[0]} × {mesh[1]}" if k == 1 else None
            size = 3.5 if mesh == COARSE else 2.0
            right.plot(*half.T, mark, color=color, markersize=size, fillstyle="none", label=label)
        right.annotate(
            f"{percent[k]:.0f} %", (line[:, 0].max(), 0.0), (4, 4), textcoords="offset points", va="bottom"
        )
    right.set(xlabel="r [mm]", ylabel="height above mid-height [mm]", xlim=(4.6, 8.2), ylim=(0.0, None))
    right.legend(loc="upper right")


def shown(result: Result) -> dict[str, object]:
    """What the page and the index show beside the fields of the result."""
    names = [f"{n} × {m}" for n, m in result.meshes]
    found = list(result.meshes.values())
    known = result.reference
    header = ["compression", "reference [N]", "its ± [%]", *names]
    forces = [
        [
            f"{100 * e:.0f} %",
            f"{known.force[k]:g}",
            f"{100 * known.sigma[k] / known.force[k]:.2f}",
            *(f"{100 * force_error(one)[k]:+.2f}" for one in found),
        ]
        for k, e in enumerate(COMPRESSION)
    ]
    radii = [
        [
            f"{100 * e:.0f} %",
            f"{1e3 * known.radius[k]:.4f}",
            *(f"{1e6 * (one.radius[k] - known.radius[k]):+.1f}" for one in found),
        ]
        for k, e in enumerate(COMPRESSION)
    ]
    errors = {side: [outline_error(one, side) for one in found] for side in ("stick", "slip")}
    outlines = [
        [
            f"{100 * e:.0f} %",
            *(f"{1e6 * d[0, k]:.1f} ({1e6 * d[1, k]:.0f})" for side in errors for d in errors[side]),
        ]
        for k, e in enumerate(COMPRESSION)
    ]
    slower = [
        [
            f"{1e3 * t:g}",
            *(f"{100 * force_error(one)[k]:+.2f}" for k in (0, 1, 2, 5)),
            f"{1e3 * one.difference[0]:.2f}",
            f"{1e3 * drag_difference(one, STUDY_DRAG):.2f}",
        ]
        for t, one in zip(STUDY_DURATIONS, result.study, strict=True)
    ]

    landing = (SWEEP > 0.15) & (SWEEP < 0.25)
    sawtooth = 100 * np.abs(found[1].sweep / found[2].sweep - 1.0)[landing].max()
    outside = 1e6 * (known.outline["stick"][1, 0, 0] - known.radius[1])
    # The part is proportional to drag times speed: scale the last step of the study, which is its remainder.
    scale = DRAG / STUDY_DRAG * STUDY_DURATIONS[-1] / DURATION
    left_over = 100 * scale * loading_part(result.study)[-1]
    asymmetry = 100 * found[0].difference / found[0].force
    fine = 100 * np.abs(force_error(result.meshes[FINE[-1]]))[LARGE].max()
    radius = 1e3 * np.abs(result.meshes[FINE[-1]].radius - result.reference.radius).max()
    return locals()


def test_coarse_static_force_and_radius_against_the_reference() -> None:
    found = compress(COARSE)
    assert found.completed
    assert np.abs(force_error(found)).max() < FORCE_TOLERANCE["coarse"]
    assert np.abs(found.radius - reference().radius).max() < RADIUS_TOLERANCE["coarse"]


# Later than 40 % single nodes roll onto the one face before the other, which scatters both quantities below
# by more than what is looked at.
EARLY = COMPRESSION < 0.45


@pytest.mark.slow
def test_face_forces_differ_by_the_drag_on_the_centre_of_mass() -> None:
    for found in study():
        expected = drag_difference(found, STUDY_DRAG)
        # exact for a shape symmetric about mid-height; the drag, 2 to 8 % of the force, spoils that a little
        np.testing.assert_allclose(found.difference[EARLY], expected, rtol=0.03)


@pytest.mark.slow
def test_the_loading_part_of_the_static_force_halves_with_the_speed() -> None:
    fast, slow = loading_part(study())
    np.testing.assert_allclose(fast[EARLY], 2.0 * slow[EARLY], rtol=0.1)  # first order; inertia is the rest


@pytest.mark.slow
def test_the_loading_part_is_the_drag_on_the_deformation() -> None:
    runs = study()
    forces = [homogeneous_drag(one, STUDY_DRAG) for one in runs]
    expected = -np.diff(forces, axis=0)[-1] / reference().force
    # the estimate is for a homogeneous deformation; the middle of a bonded one moves out faster
    ratio = (loading_part(runs)[-1] / expected)[EARLY]
    assert (ratio > 1.0).all()
    assert (ratio < 1.25).all()


FINE_MESHES = pytest.mark.parametrize(
    "mesh", [pytest.param(FINE[0], marks=pytest.mark.slow), pytest.param(FINE[1], marks=pytest.mark.long)]
)


@FINE_MESHES
def test_fine_static_force_against_the_reference(mesh: tuple[int, int]) -> None:
    found = compress(mesh)
    assert found.completed
    assert np.abs(force_error(found)).max() < FORCE_TOLERANCE["fine"]


@FINE_MESHES
def test_fine_static_outline_against_the_reference(mesh: tuple[int, int]) -> None:
    found = compress(mesh)
    assert np.abs(found.radius - reference().radius).max() < RADIUS_TOLERANCE["fine"]
    slip, stick = (outline_error(found, side)[0] for side in ("slip", "stick"))
    # the two programs solve the same problem up to 30 %; the FElupe outline is less exact at 20 %
    assert slip[:3].max() < RADIUS_TOLERANCE["fine"]
    assert stick[2:].max() < RADIUS_TOLERANCE["fine"]
