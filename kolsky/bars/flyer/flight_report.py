"""Flight of a flyer from its pictures: velocity, direction, tilt, end of symmetry (the paper's Fig. 6)."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dic.outcome import FrameOutcome
from dic.result import StereoResult
from kolsky.bars.flyer.flight import Flight, SymmetryEnd, fit_flight, symmetry_end
from kolsky.base.arrays import FloatArray
from kolsky.base.hdf5 import adding_to, data, put
from kolsky.base.records import FlyerMotion

SHARE = 0.05
"""Part of the velocity across the first direction from which on symmetry has ended [-]: a twentieth, 3°."""
SPAN = 0.1
"""Displacement that gives the first direction, over the length of the specimen [-]. As long another direction
must last: warm air moves a flyer to and fro in the pictures by hundredths of a pixel, which over less travel
is another direction too."""
FEWEST_IN_ROW = 3
"""Successive frames, at least, that must show another direction."""


@dataclass(frozen=True)
class FlightOfSpecimen:
    """The flight of a shot's flyer."""

    flight: Flight
    """The flyer's smooth paths."""
    time: FloatArray
    """Frame times from rest on [s], shape [n]."""
    length: float
    """Length of the specimen at rest [m]."""
    posed: float = -np.inf
    """Time of the first moving frame whose pose is known [s]: before it, directions and tilt are not."""
    separation: float = np.nan
    """Time of its greatest velocity, from which on nothing pushes it but the specimen [s]."""
    symmetry: SymmetryEnd | None = None
    """End of symmetry by its direction; None if that is not known."""

    @property
    def known(self) -> NDArray[np.bool_]:
        """Times at which direction and tilt are known, shape [n]."""
        return np.asarray(self.time >= self.posed)

    @property
    def end(self) -> float | None:
        """Time at which symmetry ends [s], None if it does not."""
        if self.symmetry is None or self.symmetry.row is None:
            return None
        return float(self.time[self.symmetry.row])


def flight_of(result: StereoResult, length: float) -> FlightOfSpecimen | str:
    """The flight of the flyer in a stereo result, or why it is not known.

    Separation is the time of the greatest velocity toward the specimen. The first direction is that of the
    displacement over a tenth of the specimen's length after it, from where on the velocity across is known to
    `SHARE` of the speed. A direction that is never known so well gives no end of symmetry.

    Parameters
    ----------
    result
        What the pictures gave.
    length
        Length of the specimen at rest [m].
    """
    if result.axial_displacement is None or result.motion is None:
        return "its travel or its poses are not known"
    start = float(result.t[result.static][-1])
    travel = result.axial_displacement
    try:
        flight = fit_flight(
            result.motion,
            result.t,
            start=start,
            toward=FlyerMotion(travel.t, travel.displacement, travel.sigma),
        )
    except ValueError as error:
        return str(error)
    last = min(path.end for path in (flight.toward, *flight.lateral, *flight.turn))
    time = result.t[(result.t >= start) & (result.t <= last)]
    velocity, sigma = flight.velocity(time)
    fastest = int(np.argmax(velocity[:, 0] - 2.0 * sigma[:, 0]))  # not the one of the largest noise
    speed = float(velocity[fastest, 0])
    poses = result.t[(result.motion.outcome == FrameOutcome.VALID) & (result.t >= start)]
    posed = float(poses[0]) if poses.size else np.inf
    known = np.flatnonzero((time >= max(posed, time[fastest])) & np.all(sigma[:, 1:] < SHARE * speed, axis=1))
    symmetry = None
    if speed > 0.0 and known.size and time[known[0]] + SPAN * length / speed <= last:
        over = SPAN * length / speed
        symmetry = symmetry_end(
            flight,
            time,
            separation=float(time[known[0]]),
            over=over,
            share=SHARE,
            times_in_row=frames_in(over, time),
        )
    return FlightOfSpecimen(flight, time, length, posed, float(time[fastest]), symmetry)


def frames_in(span: float, time: FloatArray) -> int:
    """Successive frames that cover a span, at least `FEWEST_IN_ROW`.

    Parameters
    ----------
    span
        Time to be covered [s].
    time
        Frame times [s], shape [n].
    """
    return max(FEWEST_IN_ROW, 1 + int(np.ceil(span / float(np.median(np.diff(time))) - 1e-9)))


def columns(found: FlightOfSpecimen) -> dict[str, FloatArray]:
    """The flight as columns with units, one row a frame from rest on; NaN where it is not known."""
    t = found.time
    table = {"time (s)": t}

    def add(name: str, unit: str, value: FloatArray, sigma: FloatArray, *, posed: bool = True) -> None:
        known = found.known & np.isfinite(sigma) if posed else np.ones(t.size, dtype=bool)
        table[f"{name} ({unit})"] = np.where(known, value, np.nan)
        table[f"sigma of {name} ({unit})"] = np.where(known, sigma, np.nan)

    velocity, spread = found.flight.velocity(t)
    add("velocity toward the specimen", "m/s", velocity[:, 0], spread[:, 0], posed=False)
    for k, name in ((1, "velocity along x"), (2, "velocity along Z")):
        add(name, "m/s", velocity[:, k], spread[:, k])
    add("angle of the velocity to the axis", "rad", *found.flight.orientation(t))
    for what, unit, (value, sigma) in (
        ("rotation", "rad", found.flight.tilt(t)),
        ("angular velocity", "rad/s", found.flight.tilt_rate(t)),
    ):
        for k, axis in enumerate(("x", "Z")):
            add(f"{what} about {axis}", unit, value[:, k], sigma[:, k])
    if found.symmetry is not None:
        add(
            "velocity across the first direction over the speed",
            "1",
            found.symmetry.share,
            found.symmetry.sigma,
        )
    return table


def add_to(path: Path, found: FlightOfSpecimen) -> None:
    """Add the flight to the HDF5 file of a stereo result, as its group "flight".

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    with adding_to(path) as entry:
        group = data(entry, "flight", "velocity toward the specimen", "time")
        for name, values in columns(found).items():
            plain, unit = name.rsplit(" (", 1)
            put(group, plain, values, unit.rstrip(")"))
        group.attrs["separation_s"], group.attrs["share"] = found.separation, SHARE
        if found.end is not None:
            group.attrs["symmetry_end_s"] = found.end


def printed(found: FlightOfSpecimen | str) -> dict[str, str]:
    """The same as lines for a terminal."""
    rows = summary(found)
    table = {}
    if "flyer_velocity_m_s" in rows:
        table["flyer's velocity"] = (
            f"{rows['flyer_velocity_m_s']:.4f} ± {2 * rows['flyer_velocity_sigma_m_s']:.4f} m/s (k = 2), the "
            f"greatest, at {1e3 * rows['separation_s']:.4f} ms"
        )
    if "flight" in rows:
        return {**table, "flyer's flight": rows["flight"]}
    angle, spread = (np.degrees(rows[f"velocity_angle{which}_rad"]) for which in ("", "_sigma"))
    table["flyer's direction"] = f"{angle:.2f} ± {2 * spread:.2f}° off the axis (median over time, k = 2)"
    table["flyer's tilt"] = (
        f"{1e3 * rows['largest_tilt_rad']:.2f} ± {2e3 * rows['largest_tilt_sigma_rad']:.2f} mrad at most, "
        f"{rows['largest_tilt_rate_rad_s']:.1f} ± {2 * rows['largest_tilt_rate_sigma_rad_s']:.1f} rad/s"
    )
    end = rows["symmetry_end_s"]
    table["symmetry"] = (
        "lasts to the last frame" if end is None else f"ends at {1e3 * end:.4f} ms"
    ) + f" (velocity across its first direction under {100.0 * SHARE:g} %)"
    return table


def summary(found: FlightOfSpecimen | str) -> dict[str, Any]:
    """Summary of the flight: name and value, SI and JSON types."""
    if isinstance(found, str):
        return {"flight": f"not known: {found}"}
    at = np.array([found.separation])
    (velocity, _, _), (sigma, _, _) = (values[0] for values in found.flight.velocity(at))
    speeds = {
        "flyer_velocity_m_s": float(velocity),
        "flyer_velocity_sigma_m_s": float(sigma),
        "separation_s": found.separation,
    }
    if found.symmetry is None:
        return {**speeds, "flight": "its direction is never known to a twentieth of its speed"}
    known = found.time[found.known & (found.time >= found.separation) & (found.symmetry.sigma < SHARE)]
    angle, angle_sigma = found.flight.orientation(known)
    tilt, tilt_sigma = found.flight.tilt(known)
    rate, rate_sigma = found.flight.tilt_rate(known)
    turned, turning = (np.unravel_index(np.argmax(np.abs(values)), values.shape) for values in (tilt, rate))
    return {
        **speeds,
        "velocity_angle_rad": float(np.median(angle)),
        "velocity_angle_sigma_rad": float(np.median(angle_sigma)),
        "largest_tilt_rad": float(np.abs(tilt[turned])),
        "largest_tilt_sigma_rad": float(tilt_sigma[turned]),
        "largest_tilt_rate_rad_s": float(np.abs(rate[turning])),
        "largest_tilt_rate_sigma_rad_s": float(rate_sigma[turning]),
        "symmetry_end_s": found.end,
    }
