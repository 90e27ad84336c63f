"""Compression with Coulomb friction, slowly loaded, against static solutions of GetFEM."""

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scene import DENSITY, LENGTH, RADIUS, distances, rms, shear_modulus, speed_after_rise, table

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


TITLE = "Coulomb friction"
FIGURE_SIZE = (6.7, 3.1)
Case = tuple[tuple[int, int, float], str]
"""A mesh and an element."""
CASES: dict[str, Case] = {
    "16 × 22": (COARSE, "one_point"),
    "32 × 44": (FINE, "one_point"),
    "32 × 44, F-bar": (FINE, "fbar"),
}
FORCE_TOLERANCE = {"16 × 22": 0.02, "32 × 44": 0.01, "32 × 44, F-bar": 0.01}
"""Allowed relative difference of the force [-] beyond the reference's own uncertainty: the side rolls onto a
platen node by node, 2 % on 16 x 22 as in the bonded case, half of it on half the element; the loading's drag
and damping are 0.3 % of it at 10 %."""
RADIUS_TOLERANCE, OUTLINE_TOLERANCE = 20e-6, 40e-6
"""Allowed difference of the radius at mid-height and, rms, of the outline [m] on the fine mesh, beyond the
reference's uncertainty: twice what a camera resolves, and half an element at the edge, which folds sharply
with f = 0.1."""
MOMENTUM_TOLERANCE, ENERGY_TOLERANCE, GAP_TOLERANCE = 1e-5, 1e-3, 1e-15
"""Path of the centre of mass from 3000 recorded impulses [-]; energy as in `energy.py` [-]; round-off of a
height [m]."""
TANGLED = {0.1: 0.55}
"""Compression [-] from which one-point elements of the fine mesh tangle at the folded edge, by coefficient;
not compared, and said on the page."""
STUDY = (0.0, 2.5e-6, DAMPING)
"""Damping beta of the study of flutter [s]."""


@dataclass(frozen=True)
class Result:
    """Slow loadings with every coefficient, by mesh and by damping, and the impacts."""

    cases: dict[str, tuple[Found, ...]]
    """The comparison, by `CASES`."""
    study: dict[float, tuple[Found, ...]]
    """Even mesh, by damping."""
    coarse: tuple[Found, ...]
    """Coarse mesh without damping."""
    impact: Impact
    """Ledgers of energy and momentum."""


@cache
def case() -> Result:
    """Everything the page shows (some minutes)."""
    cases = {name: compress(mesh, element=element) for name, (mesh, element) in CASES.items()}
    study = {beta: compress(EVEN, beta) for beta in STUDY}
    return Result(cases, study, compress(COARSE, 0.0), impact())


def compared(friction: float, case_name: str) -> NDArray[np.bool_]:
    """Which compressions of the reference are held against a case."""
    compression = known(friction).compression
    if case_name != "32 × 44":
        return np.ones(len(compression), dtype=bool)
    return compression < TANGLED.get(friction, 1.0)


def force_excess(
    found: tuple[Found, ...], case_name: str, coefficients: tuple[float, ...] = FRICTION
) -> float:
    """Largest |force difference| beyond the reference's uncertainty, over the force [-]."""
    worst = 0.0
    for friction, one in zip(coefficients, found, strict=True):
        reference = known(friction)
        beyond = np.abs(force_difference(one, reference)) - reference.force_error / reference.force
        worst = max(worst, float(beyond[compared(friction, case_name)].max()))
    return worst


def radius_excess(
    found: tuple[Found, ...], case_name: str, coefficients: tuple[float, ...] = FRICTION
) -> tuple[float, float]:
    """Largest difference of the radius at mid-height, and of the outline (rms), beyond the uncertainty of the
    reference's radii of middle and edge [m]."""
    middle, outline = 0.0, 0.0
    for friction, one in zip(coefficients, found, strict=True):
        reference = known(friction)
        held = compared(friction, case_name)
        radius = np.abs(one.middle[: len(held)] - reference.middle) - reference.middle_error
        either = np.maximum(reference.middle_error, reference.corner_error)
        middle = max(middle, float(radius[held].max()))
        outline = max(outline, float((outline_difference(one, reference) - either)[held].max()))
    return middle, outline


def name(friction: float) -> str:
    """How a coefficient is written."""
    return "no slip" if friction >= 1000.0 else f"{friction:g}"


def flutter() -> FloatArray:
    """Fastest growth [1/s] at 5 and 10 % compression by coefficient on the coarsest and finest mesh of the
    linearised reference, rows (friction, coarsest, finest)."""
    rows = np.loadtxt(REFERENCE / "G_friction_flutter.csv", delimiter=",")
    sizes = rows[:, 1]
    worst = [
        [f, *(rows[(rows[:, 0] == f) & (sizes == n), 3].max() for n in (sizes.min(), sizes.max()))]
        for f in np.unique(rows[:, 0])
    ]
    return np.array(worst)


def row(result: Result) -> tuple[str, str, str]:
    """Line of the index: what is compared, what was measured, what is allowed."""
    forces = [f"{100 * force_excess(found, name):.1f} %" for name, found in result.cases.items()]
    radii = [radius_excess(result.cases[name], name) for name in list(CASES)[1:]]
    middle, outline = 1e3 * np.max(radii, axis=0)
    return (
        "force with f = 0.05 to 0.5 and without slip beyond the reference's uncertainty, 16 × 22, 32 × 44, "
        "F-bar; radius, outline (rms), 32 × 44; GetFEM",
        f"{', '.join(forces)}; {middle:.3f}, {outline:.3f} mm",
        f"{', '.join(f'{100 * t:g} %' for t in FORCE_TOLERANCE.values())}; {1e3 * RADIUS_TOLERANCE:g}, "
        f"{1e3 * OUTLINE_TOLERANCE:g} mm",
    )


def draw(result: Result, figure: Figure) -> None:
    """Left: force over the force without slip (colours as on the right); lines are 32 × 44 (F-bar), bars the
    reference with its uncertainty. Right: slip of the face at 30 % compression; lines are the reference,
    points every second node."""
    left, right = figure.subplots(1, 2)
    found = result.cases["32 × 44, F-bar"]
    whole = known(FRICTION[-1]).force
    percent = 100 * np.array([0.1, 0.2, 0.3, 0.4, 0.5, 0.6])
    for i, (friction, one) in enumerate(zip(FRICTION[:-1], found[:-1], strict=True)):
        reference = known(friction)
        n = len(reference.compression)
        left.plot(percent[:n], (one.force / whole)[:n], color=f"C{i}")
        left.errorbar(
            percent[:n],
            reference.force / whole[:n],
            reference.force_error / whole[:n],
            color=f"C{i}",
            fmt="o",
            markersize=2.5,
            capsize=2.0,
        )
        start = 1e3 * reference.face_start
        right.plot(start, 1e3 * reference.face[2] - start, color=f"C{i}", label=f"f = {friction:g}")
        start = 1e3 * one.face_start
        right.plot(start[::2], (1e3 * one.face[2] - start)[::2], "o", color=f"C{i}", markersize=2.5)
    left.set(xlabel="compression [%]", ylabel="force over that without slip [-]")
    right.set(xlabel="radius before loading [mm]", ylabel="slip at 30 % [mm]")
    right.legend(loc="upper left")


def page(result: Result) -> str:
    """The page's text: `friction_page.py`."""
    from friction import text  # it asks this module for numbers

    return text(result)


def forces(result: Result) -> str:
    """Force by coefficient and compression."""
    rows = []
    for i, f in enumerate(FRICTION):
        reference = known(f)
        each = [100 * force_difference(found[i], reference) for found in result.cases.values()]
        rows += [
            [
                name(f),
                f"{100 * e:.0f} %",
                f"{reference.force[k]:.4f}",
                f"{100 * reference.force_error[k] / reference.force[k]:.2f}",
                *(f"{d[k]:+.2f}" for d in each),
            ]
            for k, e in enumerate(reference.compression)
        ]
    return table(
        ["f", "compression", "GetFEM [N]", "its ± [%]", *(f"{case} [%]" for case in result.cases)], rows
    )


def shapes(result: Result) -> str:
    """Differences of the shape, F-bar on the fine mesh, at 30 % and at the last compression."""
    rows = []
    for f, one in zip(FRICTION, result.cases["32 × 44, F-bar"], strict=True):
        reference = known(f)
        outline, face = (1e6 * d(one, reference) for d in (outline_difference, face_difference))
        for k in sorted({2, len(reference.compression) - 1}):
            middle, corner, contact = (
                f"{1e6 * (getattr(one, part)[k] - getattr(reference, part)[k]):+.0f} "
                f"(± {1e6 * getattr(reference, part + '_error')[k]:.0f})"
                for part in ("middle", "corner", "contact")
            )
            rows.append(
                [
                    name(f),
                    f"{100 * reference.compression[k]:.0f} %",
                    middle,
                    f"{1e3 * reference.corner[k]:.3f}",
                    corner,
                    f"{1e3 * reference.contact[k]:.2f}",
                    contact,
                    f"{outline[k]:.0f}",
                    f"{face[k]:.0f}",
                ]
            )
    header = [
        "f",
        "compression",
        "radius at mid-height: difference [µm]",
        "radius of the edge [mm]",
        "difference [µm]",
        "radius of the contact [mm]",
        "difference [µm]",
        "outline, rms [µm]",
        "slip of the face, largest [µm]",
    ]
    return table(header, rows)


def undamped(result: Result) -> str:
    """What flutter does to the force without damping."""
    rates = flutter()
    rows = []
    for i, f in enumerate(FRICTION):
        last = int(np.flatnonzero(compared(f, "32 × 44"))[-1])
        base = result.study[DAMPING][i]
        rate = rates[rates[:, 0] == f]
        rows.append(
            [
                name(f),
                *(f"{v:.0f}" for v in (rate[0, 1:] if len(rate) else [0.0, 0.0])),
                *(
                    f"{100 * (result.study[b][i].force / base.force - 1)[k]:+.2f}"
                    for b in STUDY[:-1]
                    for k in (0, 1, last)
                ),
            ]
        )
    header = ["f", "growth, coarsest mesh [1/s]", "finest mesh [1/s]"]
    header += [f"β = {b:g} s: {where}" for b in STUDY[:-1] for where in ("10 % [%]", "20 % [%]", "last [%]")]
    return table(header, rows)


def text(result: Result) -> str:
    """The page."""
    ledger = result.impact
    impacts = [
        [name(f), f"{100 * w:.2f}", f"{100 * e:.3f}", f"{m:.0e}"]
        for f, w, e, m in zip(ledger.friction, ledger.dissipated, ledger.energy, ledger.momentum, strict=True)
    ]
    slow = max(one.penetration for found in result.cases.values() for one in found)
    tangled = force_difference(result.cases["32 × 44"][1], known(0.1))[-1]
    radii = [radius_excess(result.cases[case], case) for case in list(result.cases)[1:]]
    middle, outline = 1e3 * np.max(radii, axis=0)
    bare = [
        np.abs(b.force / d.force - 1.0).max()
        for b, d in zip(result.coarse, result.cases["16 × 22"], strict=True)
    ]
    coarse = 100 * max(bare[1:])
    kinetic = max(one.kinetic.max() for one in result.cases["32 × 44"])
    return f"""# {TITLE}

**What is checked.** Force, outline, contact radius and slip of the faces of a specimen that is compressed
with Coulomb friction on both faces and on the side surface where it rolls onto a platen; energy and momentum
through stick and slip; penetration. The limits f = 0 and f towards infinity are on the page
[Contact laws](contact.md).

**Independent source.** Static solutions computed for this purpose with GetFEM 5.4.2: axisymmetric half model,
quadratic displacement and linear pressure, Coulomb's law exact at every node, several meshes
(`tests/reference/README.md`, with the scripts). Its solution without slip meets the consensus of FElupe and
DOLFINx ([Static bonded compression](static_bonded.md)).

**Set-up.** Neo-Hookean, E = 80 kPa, ν = 0.495. Slow loading as in the bonded case: {1e3 * DURATION:g} ms,
α = {DRAG:g} 1/s, force the mean of both faces; and β = {DAMPING:g} s (see *Flutter*). Drag and damping
together make the force 0.3 % too large at 10 % and 0.1 % at 30 %; it is not taken off. Kinetic energy is at
most {kinetic:.0e} of the elastic one. 32 × 44 elements with the largest {FINE[2]:g} times the smallest, at
the edge.

{forces(result)}

{shapes(result)}

(F-bar. The contact radius moves from node to node, 0.1 to 0.3 mm apart; the reference's by half of that.)

**Where the solution is not unique.** With f = 0.05 from about 32 % the edge is unstable: both meshes of the
reference that were taken further snap, onto branches whose forces differ by 5 % and more, some with the
edge rolled on and some with it curled off the platen. A slipping free surface nears Biot's surface
instability there (56 % compression of a frictionless specimen). Nothing is compared beyond 30 %. For f =
0.1 and 0.2 some meshes snap and some do not; those that do lose up to 6 % of force against the others,
which agree with each other, and the latter are the reference. This solver follows them on every mesh. The
uncertainty at 20 and 30 % is that of landing: a mesh rolls on node by node, and until the next one lands
the specimen is too soft.

**An element that fails.** With f = 0.1 the edge folds sharply. Past about 55 % the *one-point* elements at
the fold of the fine mesh tangle and overlap, yet the run completes; the force at 60 % is
{100 * tangled:+.0f} % off. The coarse mesh and the F-bar element do not do this. That one entry is left
out of the comparison; with friction near 0.1 and more than 50 % compression, use F-bar.

**Flutter.** A sliding node's friction follows its normal force, which makes the stiffness non-symmetric, and
an undamped elastic body can draw growing oscillations from that. The reference, linearised at 5 and 10 %
compression, has them for every f > 0 and none for f = 0; the rate rises with f and with the mesh, far above
the α/2 = {0.5 * DRAG:g} 1/s that the drag takes off. They make faces slip that should stick. Change of our
force ({EVEN[0]} × {EVEN[1]}) against β = {DAMPING:g} s:

{undamped(result)}

On 16 × 22 the same takes {coarse:.1f} % of the force at most. So **friction on a fine mesh needs some
stiffness-proportional damping**; the paper's β = 2.5e-5 s stops the flutter, a tenth of it not quite.

**Ledgers.** Impact at 2.6 m/s to 60 %, 16 × 22, no drag. Momentum: the path of the centre of mass from the
platens' impulses against the nodes' masses and places.

{table(["f", "lost to friction [% of work]", "energy [% of work]", "momentum [-]"], impacts)}

The friction entry never falls by more than {ledger.given_back:.0e} of the work. The deepest node lies
{max(slow, ledger.penetration):.0e} m beyond a platen.

**Tolerance.** Force {100 * FORCE_TOLERANCE["16 × 22"]:g} % on 16 × 22 and
{100 * FORCE_TOLERANCE["32 × 44"]:g} % on 32 × 44, beyond the reference's uncertainty: landing of the side's
nodes and the loading. On 32 × 44 the radius at mid-height {1e3 * RADIUS_TOLERANCE:g} mm and the outline (rms)
{1e3 * OUTLINE_TOLERANCE:g} mm, beyond the uncertainty of the radii; measured {middle:.3f} mm and
{outline:.3f} mm. Energy {100 * ENERGY_TOLERANCE:g} %, momentum {MOMENTUM_TOLERANCE:.0e}, penetration
{GAP_TOLERANCE:.0e} m.
"""
