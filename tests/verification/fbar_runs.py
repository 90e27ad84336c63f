"""Both elements side by side: slow and fast compression, and where hourglass control matters."""

from dataclasses import dataclass
from functools import cache
from time import process_time

import dynamic_bonded as dynamic
import numpy as np
import static_bonded as static
from dynamic_bonded import Grid
from numpy.typing import NDArray
from order import FittedOrder, fitted_order
from outline import distances, rms
from richardson import CommonLimit, Limit, common_limit, corner_exponent, limit
from scene import DENSITY, LENGTH, RADIUS, shear_modulus, speed_after_rise

from explicit import Model, Samples, Sampling, cylinder, run
from explicit.materials import neo_hookean

FloatArray = NDArray[np.float64]

ELEMENTS = ("one_point", "fbar")
MESHES = ((16, 22), (24, 33), (32, 44), (48, 66))
"""Elements across the radius and along the length; multiples of 11 along it share 12 material heights."""
SIZES = np.array([1.0 / n for n, _ in MESHES])
"""Element size over the radius [-]."""
STATIC_ORDER = 2.0 * corner_exponent()
"""Order of force and shape with bonded edges in linear theory [-]: that of the edge's singularity."""
DYNAMIC_ORDER = 2.0
"""Order of the motion before the edges matter [-]: linear elements, lumped mass."""
CHI = (0.03, 0.1, 0.3, 1.0)
"""Hourglass stiffnesses of the study [-]."""
DISC = 1e-3
"""Thickness of the flat disc [m]."""
DISC_COMPRESSION = np.array([0.1, 0.2, 0.3, 0.4])
"""Compressions of the disc that are reported [-]."""
DISC_MESHES = ((16, 4), (32, 8), (48, 12))


def static_forces(element: str) -> FloatArray:
    """Slow bonded compression: force [N], shape [n_meshes, 6]."""
    return np.array([static.compress(mesh, element=element).force for mesh in MESHES])


def static_radii(element: str) -> FloatArray:
    """Slow bonded compression: radius at mid-height [m], shape [n_meshes, 6]."""
    return np.array([static.compress(mesh, element=element).radius for mesh in MESHES])


def static_outline_limit(element: str) -> FloatArray:
    """Rms distance of the extrapolated surface points to the reference's outline [m], shape [6]."""
    points = [static.compress(mesh, element=element).outline[:, :: mesh[1] // 11] for mesh in MESHES]
    extrapolated = limit(SIZES, points, STATIC_ORDER).value
    lines = static.reference().outline["stick"]
    return np.array([rms(distances(p, line)) for p, line in zip(extrapolated, lines, strict=True)])


def static_limits(element: str) -> tuple[Limit, Limit]:
    """Extrapolated force [N] and radius at mid-height [m], each of shape [6]."""
    return (
        limit(SIZES, static_forces(element), STATIC_ORDER),
        limit(SIZES, static_radii(element), STATIC_ORDER),
    )


def common_forces() -> list[CommonLimit]:
    """One limit [N] and order for the static forces of both elements, at each of the 6 compressions."""
    forces = [static_forces(element) for element in ELEMENTS]
    return [common_limit(SIZES, [force[:, k] for force in forces]) for k in range(6)]


def common_radii() -> list[CommonLimit]:
    """One limit [m] and order for the radii at mid-height of both elements, at each of the 6 compressions."""
    radii = [static_radii(element) for element in ELEMENTS]
    return [common_limit(SIZES, [radius[:, k] for radius in radii]) for k in range(6)]


def impact_force(element: str, mesh: tuple[int, int], cutoff: float) -> FloatArray:
    """Low-passed transmitted force of the bonded impact [N], shape [3001]."""
    response = dynamic.simulate(Grid(*mesh), element=element)
    return dynamic.low_pass(dynamic.transmitted(response), cutoff)


def impact_errors(element: str, cutoff: float) -> FloatArray:
    """Rms difference from the reference over its peak [-], shape [n_meshes]."""
    wanted = dynamic.low_pass(dynamic.reference("stick").transmission, cutoff)
    found = [impact_force(element, mesh, cutoff) for mesh in MESHES]
    return np.array([rms(force - wanted) for force in found]) / wanted.max()


def impact_outlines(element: str) -> FloatArray:
    """Rms distance of the surface nodes to the reference's outline [m], shape [n_meshes, 6 times]."""
    runs = [dynamic.simulate(Grid(*mesh), element=element) for mesh in MESHES]
    return np.array([dynamic.outline_errors(response, "stick") for response in runs])


def impact_limit(element: str, cutoff: float) -> FloatArray:
    """Extrapolated history of the low-passed force [N], shape [3001]."""
    series = [impact_force(element, mesh, cutoff) for mesh in MESHES]
    return limit(SIZES, series, DYNAMIC_ORDER).value


def limit_differences(cutoff: float, until: float) -> FloatArray:
    """Rms differences over the reference's peak [-]: each limit from the reference, and from each other."""
    wanted = dynamic.low_pass(dynamic.reference("stick").transmission, cutoff)
    last = round(until / 5e-7) + 1
    one, four = (impact_limit(element, cutoff) for element in ELEMENTS)
    pairs = ((one, wanted), (four, wanted), (one, four))
    return np.array([rms((a - b)[:last]) for a, b in pairs]) / wanted.max()


@cache
def small_order(element: str) -> FittedOrder:
    """Order of the 5 kHz force at small strain up to 1 ms, toward the finest mesh of `dynamic_bonded`."""

    def force(grid: Grid) -> FloatArray:
        return dynamic.transmitted(dynamic.simulate(grid, scale=dynamic.SMALL, element=element))

    finest = force(dynamic.FINEST)
    errors = [dynamic.difference(force(Grid(*m)), finest, 5e3, until=dynamic.EARLY) for m in MESHES]
    return fitted_order(SIZES, [error.of_rms for error in errors])


@dataclass(frozen=True)
class Disc:
    """Slow bonded compression of a flat disc, at `DISC_COMPRESSION`."""

    force: FloatArray
    """Mean of both face forces [N], shape [4]."""
    hourglass: FloatArray
    """Hourglass over elastic energy [-], shape [4]."""
    radius: float
    """Largest radius at the end [m]."""


@cache
def disc(mesh: tuple[int, int], element: str, hourglass: float = 0.3) -> Disc:
    """Compress a disc of 1 mm, bonded, by 40 % in 10 ms with a drag that stills its waves."""
    duration, rise, stroke = 10e-3, 1e-3, 0.41
    speed = stroke * DISC / (duration - 0.5 * rise)
    times = 0.5 * rise + DISC_COMPRESSION * DISC / speed
    model = Model(
        cylinder(RADIUS, DISC, n_radial=mesh[0], n_axial=mesh[1]),
        DENSITY,
        (neo_hookean(shear_modulus(0.495)),),
        (speed_after_rise(speed, rise, end=duration, n_knots=4001),),
        element=element,
        hourglass=hourglass,
    )
    response = run(model, Samples.of(poisson=0.495, mass_damping=2000.0), Sampling(times, times))
    return Disc(
        force=0.5 * (response.force_flyer + response.force_transmission)[0],
        hourglass=(response.energy.hourglass / response.energy.elastic)[0],
        radius=float(response.surface_r[0, -1].max()),
    )


@cache
def cost(element: str, n_samples: int = 1) -> float:
    """Processor time of one element in one step of one simulation [s]: long minus short run, best of 3."""
    mesh = cylinder(RADIUS, LENGTH, n_radial=24, n_axial=33)
    best = []
    for end in (0.25e-3, 1.25e-3):
        motion = speed_after_rise(2.6, 50e-6, end=end)
        law = neo_hookean(shear_modulus(0.495))
        model = Model(mesh, DENSITY, (law,), (motion,), element=element)
        times = np.array([end])
        samples = Samples.of(poisson=np.full(n_samples, 0.495))
        seconds = np.inf
        for _ in range(3):
            start = process_time()
            response = run(model, samples, Sampling(times, times), threads=1)
            seconds = min(seconds, process_time() - start)
        best.append((seconds, int(response.steps[0])))
    (short, few), (long, many) = best
    return (long - short) / (many - few) / (mesh.n_elements * n_samples)
