"""The tables of the F-bar page."""

import dynamic_bonded as dynamic
import fbar_checks as checks
import fbar_runs as runs
import numpy as np
import patch
import static_bonded as static
from fbar_checks import Result
from fbar_runs import ELEMENTS, MESHES
from scene import table

NAMES = {"one_point": "one-point", "fbar": "F-bar"}
"""Elements as the page calls them."""


def single_table(result: Result) -> str:
    """Checks of one element by itself."""
    rows = []
    for name in patch.TOLERANCE:
        allowed = f"{patch.TOLERANCE[name]:.0e}"
        both = [result.single[element] for element in ELEMENTS]
        rows.append(
            [f"interior force of the patch test / corner force, {name}"]
            + [f"{one.interior[name]:.0e}" for one in both]
            + [allowed]
        )
        rows.append(
            [f"face force of the patch test against the closed form, {name}"]
            + [f"{one.face[name]:.0e}" for one in both]
            + [allowed]
        )
        rows.append(
            [f"force of a rigid shift with a rigid velocity / (mu R^2), {name}"]
            + [f"{one.rigid[name]:.0e}" for one in both]
            + [allowed]
        )
    both = [result.single[element] for element in ELEMENTS]
    rows.append(
        ["power of the damping stress in uniform stretching, minus 1"]
        + [f"{one.rate_power:.0e}" for one in both]
        + ["1e-13"]
    )
    rows.append(
        ["corner force against the central difference of the energy, best step"]
        + [f"{one.gradient.min():.0e}" for one in both]
        + ["1e-8"]
    )
    for kind in ("deviatoric", "full"):
        rows.append(
            [f"energy imbalance, impact with friction, bar and {kind} damping [%]"]
            + [f"{100 * one.imbalance[kind]:.4f}" for one in both]
            + ["0.1"]
        )
    rows.append(
        ["frictionless compression, force against the closed form [%]"]
        + [f"{100 * one.frictionless:.2f}" for one in both]
        + ["0.3"]
    )
    return table(["quantity", *NAMES.values(), "allowed"], rows)


def bounds_table(result: Result) -> str:
    """Step bounds over what they bound."""
    rows = [
        [
            f"{nu:g}",
            damping,
            *(
                f"{one.least:.3f}, {one.median:.3f}, {one.most:.2f}"
                for one in (result.bounds[element, nu, damping] for element in ELEMENTS)
            ),
        ]
        for nu in checks.POISSON
        for damping in ("none", "deviatoric", "full")
    ]
    return table(["ν", "damping", *NAMES.values()], rows)


def static_table() -> str:
    """Errors of slow compression on every mesh."""
    wanted = static.reference()
    rows = []
    for element in ELEMENTS:
        forces, radii = runs.static_forces(element), runs.static_radii(element)
        for mesh, force, radius in zip(MESHES, forces, radii, strict=True):
            found = static.compress(mesh, element=element)
            outline = static.outline_error(found, "stick")[0]
            rows.append(
                [f"{NAMES[element]}, {mesh[0]} × {mesh[1]}"]
                + [f"{100 * e:+.2f}" for e in force / wanted.force - 1.0]
                + [f"{1e6 * np.abs(radius - wanted.radius).max():.1f}", f"{1e6 * outline[2:].max():.1f}"]
            )
    percent = [f"{100 * e:.0f} %" for e in static.COMPRESSION]
    return table(["element, mesh", *percent, "radius [µm]", "outline [µm]"], rows)


def common_limits_table() -> str:
    """One limit and one order for both elements, against the reference."""
    wanted = static.reference()
    rows = []
    both = zip(runs.common_forces(), runs.common_radii(), strict=True)
    for k, (force, radius) in enumerate(both):
        scale = 100 / wanted.force[k]
        rows.append(
            [
                f"{100 * static.COMPRESSION[k]:.0f} %",
                f"{wanted.force[k]:g} ± {scale * wanted.sigma[k]:.2f} %",
                f"{force.value:.4f}",
                f"{scale * (force.value - wanted.force[k]):+.2f}",
                f"{force.order:.2f}",
                f"{scale * force.deviation:.3f}",
                f"{1e3 * radius.value:.4f}",
                f"{1e6 * (radius.value - wanted.radius[k]):+.1f}",
                f"{1e6 * radius.deviation:.1f}",
            ]
        )
    force_columns = ["limit [N]", "− reference [%]", "order", "deviation [%]"]
    radius_columns = ["radius [mm]", "− reference [µm]", "deviation [µm]"]
    return table(["compression", "reference [N]", *force_columns, *radius_columns], rows)


def static_limits_table() -> str:
    """Each element extrapolated alone with the order of linear theory, against the reference."""
    wanted = static.reference()
    limits = {element: runs.static_limits(element) for element in ELEMENTS}
    rows = []
    for k, e in enumerate(static.COMPRESSION):
        cells = [f"{100 * e:.0f} %"]
        for element in ELEMENTS:
            force, _ = limits[element]
            error = 100 * (force.value[k] / wanted.force[k] - 1)
            cells.append(f"{error:+.2f} ({100 * force.deviation[k] / wanted.force[k]:.2f})")
        for element in ELEMENTS:
            _, radius = limits[element]
            error = 1e6 * (radius.value[k] - wanted.radius[k])
            cells.append(f"{error:+.1f} ({1e6 * radius.deviation[k]:.1f})")
        cells += [f"{1e6 * runs.static_outline_limit(element)[k]:.1f}" for element in ELEMENTS]
        rows.append(cells)
    quantities = ("force [%]", "radius [µm]", "outline [µm]")
    return table(["compression", *(f"{q}, {NAMES[e]}" for q in quantities for e in ELEMENTS)], rows)


def impact_table() -> str:
    """Errors of the impact on every mesh."""
    rows = []
    for element in ELEMENTS:
        errors = np.array([runs.impact_errors(element, cutoff) for cutoff in dynamic.CUTOFFS])
        outlines = runs.impact_outlines(element)
        for k, mesh in enumerate(MESHES):
            rows.append(
                [f"{NAMES[element]}, {mesh[0]} × {mesh[1]}"]
                + [f"{100 * e:.2f}" for e in errors[:, k]]
                + [" ".join(f"{1e6 * d:.0f}" for d in outlines[k])]
            )
    return table(["element, mesh", "5 kHz", "10 kHz", "20 kHz", "outline [µm] at 0.25 to 1.5 ms"], rows)


def impact_limits_table() -> str:
    """Differences of the extrapolated impact forces."""
    rows = [
        [f"{1e-3 * cutoff:g} kHz, to {1e3 * until:g} ms"]
        + [f"{100 * d:.2f}" for d in runs.limit_differences(cutoff, until)]
        for cutoff in dynamic.CUTOFFS
        for until in (dynamic.EARLY, dynamic.END)
    ]
    header = ["", "one-point − reference", "F-bar − reference", "one-point − F-bar"]
    return table(header, rows)


def hourglass_tables() -> tuple[str, str]:
    """Slow compression of the cylinder and of the flat disc against the hourglass stiffness."""
    cylinder, flat = [], []
    wanted = static.reference().force
    for mesh in ((8, 11), (16, 22)):
        for chi in runs.CHI:
            found = static.compress(mesh, element="one_point", hourglass=chi)
            cylinder.append(
                [f"{mesh[0]} × {mesh[1]}, χ = {chi:g}"]
                + [f"{100 * (found.force / wanted - 1)[k]:+.1f}" for k in (0, 2, 5)]
                + [f"{100 * found.hourglass[k]:.2f}" for k in (0, 2, 5)]
            )
        found = static.compress(mesh, element="fbar")
        cylinder.append(
            [f"{mesh[0]} × {mesh[1]}, F-bar"]
            + [f"{100 * (found.force / wanted - 1)[k]:+.1f}" for k in (0, 2, 5)]
            + ["0"] * 3
        )
    for mesh in runs.DISC_MESHES:
        for chi in (*runs.CHI, None):
            one = runs.disc(mesh, "fbar") if chi is None else runs.disc(mesh, "one_point", chi)
            flat.append(
                [f"{mesh[0]} × {mesh[1]}, " + ("F-bar" if chi is None else f"χ = {chi:g}")]
                + [f"{one.force[k]:.2f}" for k in (0, 1, 3)]
                + [f"{1e3 * one.radius:.3f}"]
                + [f"{100 * one.hourglass[k]:.2f}" for k in (0, 1, 3)]
            )
    shares = ["share at 10 % [%]", "at 30 % [%]", "at 60 % [%]"]
    disc_shares = ["share at 10 % [%]", "at 20 % [%]", "at 40 % [%]"]
    return (
        table(["mesh", "10 %", "30 %", "60 %", *shares], cylinder),
        table(["mesh", "10 % [N]", "20 % [N]", "40 % [N]", "radius at 40 % [mm]", *disc_shares], flat),
    )


def disc_spread() -> float:
    """Spread of the disc's force at 40 % over χ on the coarse mesh, over the finest F-bar force [%]."""
    coarse = runs.DISC_MESHES[0]
    forces = [runs.disc(coarse, "one_point", chi).force[-1] for chi in runs.CHI]
    return float(100 * np.ptp(forces) / runs.disc(runs.DISC_MESHES[-1], "fbar").force[-1])
