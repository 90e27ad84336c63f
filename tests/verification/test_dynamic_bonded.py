"""Bonded dynamic compression at 2.6 m/s against two dynamic finite-element solutions."""

from functools import cache
from math import asin, pi, sqrt
from pathlib import Path
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import pytest
from matplotlib.figure import Figure
from numpy.typing import NDArray
from order import assert_order, fitted_order
from scene import DENSITY, LENGTH, RADIUS, distances, rms, shear_modulus, speed_after_rise
from scipy.signal import butter, filtfilt

from explicit import Model, Response, Samples, Sampling, Stepping, cylinder, run
from explicit.materials import neo_hookean

FloatArray = NDArray[np.float64]

REFERENCE = Path(__file__).resolve().parent.parent / "reference"
FIGURE_SIZE = (6.7, 6.4)
POISSON = 0.495
SPEED, RISE, END = 2.6, 50e-6, 1.5e-3  # flyer speed [m/s], its rise [s] and the end of the runs [s]
CUTOFFS = (5e3, 10e3, 20e3)  # Low-pass cut-offs [Hz]
EARLY = 1.0e-3  # up to here the side surface has rolled onto the platens by little [s]
PROFILE_TIMES = np.array([0.25, 0.5, 0.75, 1.0, 1.25, 1.5]) * 1e-3  # times of the outlines [s]
SMALL = 0.02  # scale of the motion in the small-strain study [-]: 1.2 % compression at the end
BETA = 2.5e-5  # Stiffness-proportional damping of Mates et al. (2012) [s].


class Grid(NamedTuple):
    """A mesh of the study."""

    across: int  # elements across the radius
    along: int  # elements along the length
    grading: float = 1.0  # largest over smallest element size [-]

    def __str__(self) -> str:
        return f"{self.across} × {self.along}" + (f", graded {self.grading:g}" if self.grading > 1.0 else "")


COARSE, COARSE_GRADED = Grid(16, 22), Grid(16, 22, 2.0)
GRIDS = (COARSE, COARSE_GRADED, Grid(24, 33), Grid(32, 44), Grid(32, 44, 2.0), Grid(48, 66), Grid(64, 88))
"""Meshes that are compared with the references."""
UNIFORM = (Grid(16, 22), Grid(24, 33), Grid(32, 44), Grid(48, 66))  # series of the order of convergence
FINEST = Grid(96, 132)  # what the series converges to, where no reference exists
COARSE_TOLERANCE, FINE_TOLERANCE = 0.02, 0.01  # allowed rms difference of the 5 kHz force, over its peak [-]
FINE = (Grid(32, 44, 2.0), Grid(48, 66), Grid(64, 88))  # meshes that the finer tolerance is asked of
PROFILE_TOLERANCE = 20e-6
"""Allowed rms normal distance of the surface nodes to the reference's outline on a refined mesh [m]: the
reference's own 0.01 mm, and as much again for the mesh."""
ENERGIES = ("elastic", "kinetic", "external")  # entries of the ledger that the FElupe reference has
ENERGY_TOLERANCE = 1e-3  # allowed imbalance [-]


class Difference(NamedTuple):
    """Root-mean-square difference of two low-passed forces."""

    of_peak: float  # over the reference's largest low-passed force [-]
    of_rms: float  # over the reference's rms low-passed force [-]


Reference = Result = SimpleNamespace


@cache
def reference(side: str) -> Reference:
    """Read the reference whose side "stick"s or "slip"s."""
    name = {"stick": "D_48x66_stick.npz", "slip": "D_32x44_slip.npz"}[side]
    with np.load(REFERENCE / name, allow_pickle=False) as data:
        return Reference(
            time=data["t"],  # times of the forces [s], shape [n]
            transmission=data["Fbot_raw"].astype(float),  # force on the fixed platen [N], shape [n]
            outline_time=data["profile_t"],  # times of the outlines [s], shape [n_outlines]
            # outlines (r, y) [m], shape [n_outlines, n_points, 2]
            outline=np.stack([data["profile_r"], data["profile_z"]], axis=-1),
            # Elastic, kinetic and external energy at the end [J], if the file has them
            energy=data.get("energy"),
        )


@cache
def simulate(
    grid: Grid,
    side: str = "bonded",
    *,
    scale: float = 1.0,
    beta: float = 0.0,
    safety: float = 0.9,
    element: str = "one_point",
) -> Response:
    """The reference's problem on a mesh; forces on the reference's time grid."""
    motion = speed_after_rise(scale * SPEED, RISE, end=END)
    mesh = cylinder(RADIUS, LENGTH, n_radial=grid.across, n_axial=grid.along, grading=grid.grading)
    law = neo_hookean(shear_modulus(POISSON))
    model = Model(mesh, DENSITY, (law,), (motion,), faces="bonded", side=side, element=element)
    sampling = Sampling(reference("stick").time, PROFILE_TIMES)
    samples = Samples.of(poisson=POISSON, damping=beta)
    return run(model, samples, sampling, stepping=Stepping(safety=safety))


def transmitted(response: Response) -> FloatArray:
    """Force on the fixed platen at the reference's times [N], shape [n].

    Difference quotient of the impulse: the mean over two samples, which does not alias.
    """
    return np.gradient(response.impulse_transmission[0], response.force_times)


def low_pass(force: FloatArray, cutoff: float, *, step: float = 5e-7) -> FloatArray:
    """Butterworth low-pass of fourth order, forward and backward [N].

    Gustafsson's (1996) initial states invent no force before or after the record; SciPy's default, mirrored
    samples, starts the backward pass from the *last raw sample*.
    """
    b, a = butter(4, cutoff, fs=1.0 / step)
    return np.asarray(filtfilt(b, a, force, method="gust"))


def difference(force: FloatArray, against: FloatArray, cutoff: float, *, until: float = END) -> Difference:
    """Compare two raw histories on one grid after the same low-pass; both are filtered whole."""
    n = min(len(force), len(against))
    found, wanted = (low_pass(history[:n], cutoff) for history in (force, against))
    last = min(n, round(until / 5e-7) + 1)
    error = rms((found - wanted)[:last])
    return Difference(error / float(wanted.max()), error / rms(wanted[:last]))


def outline_errors(response: Response, side: str) -> FloatArray:
    """Rms normal distance of the surface nodes to the reference's outline at its times [m]."""
    wanted = reference(side)
    index = np.searchsorted(response.surface_times, wanted.outline_time - 1e-9)
    points = np.stack([response.surface_r[0], response.surface_y[0]], axis=-1)[index]
    return np.array([rms(distances(p, line)) for p, line in zip(points, wanted.outline, strict=True)])


def final_energies(response: Response) -> FloatArray:
    """Elastic, kinetic and external energy at the end [J], shape [3]."""
    return np.array([getattr(response.energy, name)[0, -1] for name in ENERGIES])


def against_reference(grid: Grid, side: str, cutoff: float, **options: float) -> Difference:
    """Difference of the transmitted force on a mesh from a reference's."""
    law = {"stick": "bonded", "slip": "frictionless"}[side]
    wanted = reference(side).transmission
    return difference(transmitted(simulate(grid, law)), wanted, cutoff, **options)


def shear_cutoff(grid: Grid) -> float:
    """Highest frequency of a shear wave along the axis on a uniform mesh [Hz].

    Of omega = (2 c / h) sin(k h / 2), linear elements with lumped mass. In a neo-Hookean solid the shear
    wave's speed in reference coordinates is sqrt(mu / rho) at any compression.
    """
    return sqrt(shear_modulus(POISSON) / DENSITY) / (pi * LENGTH / grid.along)


def shear_slowness(grid: Grid, frequency: float) -> float:
    """How much slower than in the solid a shear wave travels on a uniform mesh [-]; 1 where it does not."""
    ratio = frequency / shear_cutoff(grid)
    return 1.0 - ratio / asin(ratio) if ratio < 1.0 else 1.0


def against_finer(
    grids: tuple[Grid, ...], finer: Grid, until: float, **options: float
) -> dict[Grid, Difference]:
    """Differences of the 5 kHz force of meshes from that of a finer one."""
    fine = transmitted(simulate(finer, **options))  # type: ignore[arg-type]
    return {
        grid: difference(transmitted(simulate(grid, **options)), fine, 5e3, until=until)  # type: ignore[arg-type]
        for grid in grids
    }


def half_step() -> Difference:
    """Difference of a third of the step on the coarse mesh."""
    return difference(transmitted(simulate(COARSE, safety=0.3)), transmitted(simulate(COARSE)), 5e3)


@cache
def case() -> Result:
    """All meshes (half a minute) and the three studies of what the error is."""
    grids = (*UNIFORM, COARSE_GRADED)
    return Result(
        stick={grid: simulate(grid) for grid in GRIDS},  # side sticks, by mesh
        # side slides without friction, by mesh
        slip={grid: simulate(grid, "frictionless") for grid in GRIDS},
        # Small strain: 5 kHz difference from the finest mesh up to `EARLY`, by mesh.
        small=against_finer(grids, FINEST, EARLY, scale=SMALL),
        # with `BETA`: 5 kHz difference from the finest mesh, by mesh
        damped=against_finer(grids, FINEST, END, beta=BETA),
        half_step=half_step(),  # coarse mesh, 5 kHz: a third of the time step against the default one
    )


def draw(result: Result, figure: Figure) -> None:
    """Draw the figure of the page."""
    top, bottom = figure.subfigures(2, 1, height_ratios=(1.15, 1.0))
    force, below = top.subplots(2, 1, sharex=True, height_ratios=(1.6, 1.0))
    known = reference("stick")
    milli = 1e3 * known.time
    wanted = low_pass(known.transmission, 5e3)
    force.plot(milli, wanted, color="black", linewidth=1.6, label="reference")
    for grid in (COARSE, COARSE_GRADED, Grid(48, 66)):
        found = low_pass(transmitted(result.stick[grid]), 5e3)
        (line,) = force.plot(milli, found, label=str(grid))
        below.plot(milli, found - wanted, color=line.get_color())
    below.axhline(0.0, color="0.6", linewidth=0.6)
    force.set(ylabel="force [N]", xlim=(0.0, 1.5))
    below.set(xlabel="time [ms]", ylabel="difference [N]")
    force.legend(loc="upper left")
    top.align_ylabels()

    series, shape = bottom.subplots(1, 2)
    across = [grid.across for grid in GRIDS if grid.grading == 1.0]
    for cutoff, color, mark in zip(CUTOFFS, ("C0", "C1", "C2"), ("o", "s", "^"), strict=True):
        for side, filled, style in (("stick", color, "-"), ("slip", "white", "--")):
            values = [
                100 * against_reference(grid, side, cutoff).of_peak for grid in GRIDS if grid.grading == 1.0
            ]
            label = f"{1e-3 * cutoff:g} kHz" if side == "stick" else None
            series.loglog(
                across, values, mark, linestyle=style, color=color, markerfacecolor=filled, label=label
            )
    series.set(xlabel="elements across the radius [-]", ylabel="rms difference / peak [%]")
    series.set_xticks(across, [f"{n}" for n in across])
    series.set_xticks([], minor=True)
    ticks = (0.2, 0.5, 1, 2, 5, 10)
    series.set_yticks(ticks, [f"{value:g}" for value in ticks])
    series.legend()
    fine = result.stick[Grid(48, 66)]
    for k, line in enumerate(known.outline):
        shape.plot(*(1e3 * line).T, color="black", linewidth=0.8, label="reference" if k == 0 else None)
        points = 1e3 * np.column_stack([fine.surface_r[0, k], fine.surface_y[0, k]])
        shape.plot(*points.T, ".", color="C2", markersize=2.0, label="48 × 66" if k == 0 else None)
    shape.set(xlabel="r [mm]", ylabel="height y [mm]", xlim=(4.7, 8.2), ylim=(-0.1, 6.4))
    shape.legend(loc="upper right")


def _percent(pair: Difference) -> str:
    return f"{100 * pair.of_peak:.2f} ({100 * pair.of_rms:.1f})"


def shown(result: Result) -> dict[str, object]:
    """What the page and the index show beside the fields of the result."""
    sides = ("stick", "slip")
    forces = [
        [str(grid), *(_percent(against_reference(grid, side, f)) for side in sides for f in CUTOFFS)]
        for grid in GRIDS
    ]
    outlines = [
        [
            str(grid),
            *(
                " ".join(f"{1e6 * d:.0f}" for d in outline_errors(responses[grid], side))
                for side, responses in (("stick", result.stick), ("slip", result.slip))
            ),
        ]
        for grid in GRIDS
    ]
    h = [1.0 / grid.across for grid in UNIFORM]
    order = fitted_order(h, [result.small[grid].of_rms for grid in UNIFORM])
    # Differences from a finest mesh that has an error C h_f^2 of its own fall as h^2 - h_f^2.
    second = fitted_order(h, [x**2 - 1.0 / FINEST.across**2 for x in h]).order
    causes = [
        [
            str(grid),
            f"{1e-3 * shear_cutoff(grid):.1f}" if grid.grading == 1.0 else "",
            f"{100 * shear_slowness(grid, 5e3):.1f}" if grid.grading == 1.0 else "",
            f"{100 * result.small[grid].of_rms:.2f}",
            f"{100 * against_reference(grid, 'stick', 5e3, until=EARLY).of_rms:.2f}",
            _percent(result.damped[grid]),
        ]
        for grid in (*UNIFORM, COARSE_GRADED)
    ]
    fine = result.stick[Grid(48, 66)]
    known = reference("stick").energy
    assert known is not None
    energies = [
        [name, f"{1e3 * here:.3f}", f"{1e3 * there:.3f}"]
        for name, here, there in zip(ENERGIES, final_energies(fine), known, strict=True)
    ]
    imbalance = {grid: response.energy.imbalance()[0] for grid, response in result.stick.items()}
    labels = [f"{side}, {1e-3 * f:g} kHz" for side in sides for f in CUTOFFS]
    coarsest, finest = (
        100 * against_reference(grid, "stick", 5000.0).of_peak for grid in (COARSE_GRADED, Grid(48, 66))
    )
    outline = 1e3 * outline_errors(result.stick[Grid(48, 66)], "stick").max()
    return locals()


KHZ = 1e3
# Measured is 0.4 to 0.6 %; 10 and 20 kHz: the reference's own 1 and 2 % and as much again for 48 x 66.
FINE_10_KHZ, FINE_20_KHZ = 0.02, 0.04


def test_coarse_graded_mesh_follows_the_reference_force() -> None:
    found = against_reference(COARSE_GRADED, "stick", 5 * KHZ)
    assert found.of_peak < COARSE_TOLERANCE


def test_coarse_meshes_lose_little_of_the_outline() -> None:
    # not asked of 16 x 22: an eighth of an element's size, and a guard against drifting away
    for grid in (COARSE, COARSE_GRADED):
        assert outline_errors(simulate(grid), "stick").max() < 40e-6


@pytest.mark.parametrize("grid", FINE, ids=str)
def test_refined_meshes_follow_the_reference_force(grid: Grid) -> None:
    assert against_reference(grid, "stick", 5 * KHZ).of_peak < FINE_TOLERANCE
    assert against_reference(grid, "slip", 5 * KHZ).of_peak < FINE_TOLERANCE


@pytest.mark.parametrize("side", ["stick", "slip"])
def test_higher_cutoffs_on_a_refined_mesh(side: str) -> None:
    grid = Grid(48, 66)
    assert against_reference(grid, side, 10 * KHZ).of_peak < FINE_10_KHZ
    assert against_reference(grid, side, 20 * KHZ).of_peak < FINE_20_KHZ


@pytest.mark.parametrize(("side", "law"), [("stick", "bonded"), ("slip", "frictionless")])
def test_refined_outline_follows_the_reference(side: str, law: str) -> None:
    response = simulate(Grid(48, 66), law)
    assert outline_errors(response, side).max() < PROFILE_TOLERANCE


@pytest.mark.parametrize("grid", [COARSE, Grid(48, 66)], ids=str)
def test_energy_of_the_dynamic_case(grid: Grid) -> None:
    response = simulate(grid)
    assert response.completed.all()
    assert response.energy.imbalance()[0] < ENERGY_TOLERANCE


def test_final_energies_are_those_of_the_reference() -> None:
    wanted = reference("stick").energy
    assert wanted is not None
    found = final_energies(simulate(Grid(48, 66)))
    # half a per cent of the work: so well does the reference know its force
    np.testing.assert_allclose(found, wanted, rtol=0.0, atol=5e-3 * wanted[2])


@pytest.mark.slow
def test_small_strain_waves_converge_with_second_order() -> None:
    errors = [found.of_rms for found in against_finer(UNIFORM, FINEST, EARLY, scale=SMALL).values()]
    # Second order, seen a little steeper: 16 x 22 cannot carry the waves at all, and the finest mesh of the
    # comparison has an error of its own, (48/96)^2 of the finest in the series.
    assert_order([1.0 / grid.across for grid in UNIFORM], errors, 2.0, 0.4, at_least=True)


@pytest.mark.slow
def test_the_time_step_is_not_the_error_of_the_coarse_mesh() -> None:
    assert half_step().of_peak < 2e-3  # a tenth of what separates 16 x 22 from the reference


@pytest.mark.slow
def test_damping_of_the_paper_brings_the_coarse_mesh_within_two_per_cent() -> None:
    # 64 x 88 elements for the page's 96 x 132: their error is a sixteenth of that of the coarse mesh.
    found = against_finer((COARSE, COARSE_GRADED), Grid(64, 88), END, beta=BETA)
    assert found[COARSE].of_peak < 0.01
    assert found[COARSE_GRADED].of_rms < 0.02
