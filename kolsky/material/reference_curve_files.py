"""A baseline as tables for files, for a shot.toml, for the terminal and as JSON."""

from pathlib import Path
from typing import Any

import numpy as np

from kolsky.base.files import write_table
from kolsky.material.curves.apparent import apparent_modulus
from kolsky.material.reference_curve import ReferenceCurve

MODE = "mode"
"""How the columns of common uncertainties begin."""


def write_curve(path: Path, made: ReferenceCurve) -> None:
    """A table that `[curve]` of a shot.toml reads, strain and stress positive along the branch."""
    band = made.band
    modes = {
        f"{MODE} {number}: {name} (Pa)": row.tolist()
        for number, (name, row) in enumerate(zip(band.names, band.modes, strict=True), start=1)
    }
    write_table(
        path,
        {
            "nominal strain (1)": band.strain.tolist(),
            "nominal stress (Pa)": band.stress.tolist(),
            "independent sigma (Pa)": band.noise.tolist(),
            **modes,
        },
    )


def write_modulus(path: Path, made: ReferenceCurve) -> None:
    """E_a against strain and time with its k = 2 interval, and what the uncorrected curve would give."""
    modulus = made.modulus
    low, high = modulus.interval()
    apparent = apparent_modulus(made.apparent, compression=made.compression)
    time = {} if modulus.time is None else {"time since zero strain (s)": modulus.time.tolist()}
    write_table(
        path,
        {
            "nominal strain (1)": modulus.strain.tolist(),
            **time,
            "E_a (Pa)": modulus.modulus.tolist(),
            "low end, k = 2 (Pa)": low.tolist(),
            "high end, k = 2 (Pa)": high.tolist(),
            "E_a as if frictionless (Pa)": apparent.modulus.tolist(),
        },
    )


def curve_table(name: str, made: ReferenceCurve, conditioned: str | None) -> str:
    """The table `[curve]` for a shot.toml that reads the curve."""
    side = "compression" if made.compression else "tension"
    lines = [
        "[curve]",
        f'file = "{name}"',
        'strain = { column = "nominal strain (1)", unit = "1" }',
        'stress = { column = "nominal stress (Pa)", unit = "Pa" }',
        f'convention = "{side} positive"',
        f'branch = "{side}"',
        'sigma = { column = "independent sigma (Pa)", unit = "Pa" }',
        *([f'modes = {{ prefix = "{MODE} ", unit = "Pa" }}'] if made.band.names else []),
        *([] if conditioned is None else [f'conditioned = "{conditioned}"']),
    ]
    return "\n".join(lines) + "\n"


def in_words(made: ReferenceCurve, before: str) -> dict[str, Any]:
    """What the terminal shows, by name; `before` stands before every name."""
    modulus, friction = made.modulus, made.friction
    strain = made.band.strain
    rows: dict[str, Any] = {
        f"{before}tests": len(made.tests),
        f"{before}strains": f"{strain[0]:.4g} to {strain[-1]:.4g}",
        f"{before}mean E_a": f"{modulus.mean / 1e3:.4g} ± {2.0 * modulus.mean_sigma / 1e3:.2g} kPa (k = 2)",
    }
    offsets = [one.offset for one in made.tests]
    if any(offsets):
        rows[f"{before}zero of strain"] = f"{min(offsets):.4g} to {max(offsets):.4g}"
    if friction is not None:
        ratio = friction.ratio
        rows[f"{before}stiffer by end friction"] = f"{ratio.min():.3f} to {ratio.max():.3f} times"
        if friction.coefficient is not None:
            sigma = f" ± {2.0 * friction.sigma:.2g} (k = 2)" if friction.sigma > 0.0 else ""
            rows[f"{before}friction"] = f"{friction.coefficient:.3g}{sigma}"
        closure = f"{100.0 * friction.closure:.2g} % from the tests (rms)"
        rows[f"{before}corrected curve simulated"] = closure
        rows[f"{before}kinetic over elastic energy"] = f"{friction.slow.kinetic_share:.1e} at most"
    return rows


def summary(made: ReferenceCurve) -> dict[str, Any]:
    """What the JSON object says of one curve (SI)."""
    modulus, friction = made.modulus, made.friction
    parts = {name: float(np.max(part / made.band.stress)) for name, part in made.band.parts().items()}
    return {
        "tests": len(made.tests),
        "strain_range": [float(made.band.strain[0]), float(made.band.strain[-1])],
        "mean_E_a": {"value": modulus.mean, "sigma": modulus.mean_sigma, "unit": "Pa"},
        "zero_of_strain": [one.offset for one in made.tests],
        "largest_relative_sigma": parts,
        "friction": None
        if friction is None
        else {
            "coefficient": friction.coefficient,
            "sigma": friction.sigma,
            "ratio": [float(friction.ratio.min()), float(friction.ratio.max())],
            "misfit": friction.misfit,
            "closure": friction.closure,
            "kinetic_share": friction.slow.kinetic_share,
            "face_difference": friction.slow.face_difference,
            "share_past_data": friction.slow.past_data,
        },
        "remarks": list(made.remarks),
    }
