"""A test between bars for a materials database: one CSV, its metadata above the table.

Columns are named in words with their units behind them, in the terms of ISO 26203-1 (tests at high strain
rates by elastic bars): engineering and true strain, strain rate, stress, and their standard uncertainties.
"""

import csv
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from dic.files import text_cell
from kolsky.bars.result import WavesResult
from kolsky.base.arrays import FloatArray
from kolsky.base.files import replacing

MEGA = 1e-6
"""From Pa to MPa."""
FORMAT = "kolsky bar test, version 1"
"""First line of the metadata."""


def write_database(path: Path, result: WavesResult) -> Path:
    """Write metadata as lines "# key: value", then the table of the quoted analysis; returns the path.

    Parameters
    ----------
    path
        Where to; replaced atomically if it exists.
    result
        The reduced test.

    Raises
    ------
    OSError
        If the file cannot be written; an older one is then unchanged.
    """
    with replacing(Path(path)) as partial, partial.open("w", newline="", encoding="utf-8") as file:
        for key, value in metadata(result).items():
            file.write(f"# {_one_line(key)}: {_one_line(value)}\n")
        rows = csv.writer(file, lineterminator="\n")
        table = columns(result)
        rows.writerow(table)
        rows.writerows([f"{value:.9g}" for value in row] for row in zip(*table.values(), strict=True))
    return path


def columns(result: WavesResult) -> dict[str, FloatArray]:
    """Columns of the table by name, shape [n] each; compression, or tension, counts as `load_case` says."""
    r, way, extra = result.reduction, result.analysis, result.extra
    strain, rate, stress = r.strain[way], r.rate[way], r.stress[way]
    table = {
        "time_s": r.time,
        "engineering_strain": strain.value,
        "u_engineering_strain": strain.sigma,
        "engineering_strain_rate_per_s": rate.value,
        "u_engineering_strain_rate_per_s": rate.sigma,
        "engineering_stress_MPa": MEGA * stress.value,
        "u_engineering_stress_MPa": MEGA * stress.sigma,
    }
    if "true strain (1)" in extra:
        table |= {
            "true_strain": extra["true strain (1)"],
            "u_true_strain": extra["sigma of true strain (1)"],
            "true_stress_MPa": MEGA * extra["true stress (Pa)"],
            "u_true_stress_MPa": MEGA * extra["sigma of true stress (Pa)"],
        }
    return table | {
        "force_equilibrium": _inside(r.time, r.balanced),
        "valid": _inside(r.time, result.valid),
    }


def metadata(result: WavesResult) -> dict[str, str]:
    """Key -> value of the lines above the table."""
    first, second = result.incident.bar, result.transmission.bar
    said: dict[str, str] = {
        "format": FORMAT,
        "test_name": result.name,
        "test_type": "split Hopkinson (Kolsky) bar",
        "load_case": f"{result.load}, counted positive",
        "specimen_shape": "circular cylinder",
        "specimen_diameter_mm": f"{1e3 * result.specimen.diameter:.6g}",
        "specimen_length_mm": f"{1e3 * result.specimen.length:.6g}",
        "specimen_density_kg_per_m3": f"{result.specimen.density:.6g}",
    }
    for name, bar in (("incident_bar", first), ("transmission_bar", second)):
        said |= {
            f"{name}_diameter_mm": f"{1e3 * bar.diameter:.6g}",
            f"{name}_youngs_modulus_GPa": f"{1e-9 * bar.youngs_modulus:.6g}",
            f"{name}_density_kg_per_m3": f"{bar.density:.6g}",
            f"{name}_wave_speed_m_per_s": f"{bar.wave_speed:.6g}",
        }
    said |= {
        "analysis": result.analysis,
        "true_quantities": "by constancy of volume; barrelling and necking are not seen",
        "uncertainty": "u_: combined standard uncertainty, k = 1",
        "corrections_applied": _names(result, True),
        "corrections_left_out": _names(result, False),
        "force_equilibrium_s": _span(result.reduction.balanced),
        "validity": result.validity,
    }
    for name, (value, sigma, unit) in result.budget.results.items():
        said[f"{name.replace(' ', '_')}_{_UNITS.get(unit, unit)}".rstrip("_")] = _measured(value, sigma, unit)
    said |= {f"input_sha256 {name}": digest for name, digest in result.inputs.items()}
    for package in ("kolsky", "numpy", "scipy"):
        if package in result.settings:
            said[f"software {package}"] = result.settings[package]
    for number, remark in enumerate(result.remarks, start=1):
        said[f"remark_{number}"] = remark
    return said


_UNITS: Mapping[str, str] = {"Pa": "MPa", "1/s": "per_s", "1": ""}


def _measured(value: float, sigma: float, unit: str) -> str:
    factor = MEGA if unit == "Pa" else 1.0
    return f"{factor * value:.6g} (u = {factor * sigma:.2g})"


def _names(result: WavesResult, applied: bool) -> str:
    return ", ".join(dict.fromkeys(c.key for c in result.corrections if c.applied is applied)) or "none"


def _span(span: tuple[float, float] | None) -> str:
    return "none" if span is None else f"{span[0]:.6g} to {span[1]:.6g}"


def _inside(time: FloatArray, span: tuple[float, float] | None) -> FloatArray:
    """1 inside a span, 0 outside."""
    if span is None:
        return np.zeros(time.size)
    return ((time >= span[0]) & (time <= span[1])).astype(float)


def _one_line(text: str) -> str:
    """A text as one line that no spreadsheet takes for a formula."""
    return text_cell(" ".join(text.split()))
