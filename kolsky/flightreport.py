"""What the pictures of a shot say of its flyer's flight: velocity, direction, tilt, and how long symmetry
lasts (the paper's Fig. 6)."""

from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np

from dic.result import StereoResult
from kolsky.flight import Flight, SymmetryEnd, fit_flight, symmetry_end
from kolsky.records import FloatArray, FlyerMotion

SHARE = 0.05
"""Part of the velocity across the first direction from which on symmetry has ended [-]: a twentieth, 3°."""
SPAN = 0.1
"""Displacement that gives the first direction, over the length of the specimen [-]."""


@dataclass(frozen=True)
class FlightOfSpecimen:
    """The flight of a shot's flyer."""

    flight: Flight
    """The flyer's smooth paths."""
    time: FloatArray
    """Frame times from rest on [s], shape [n]."""
    length: float
    """Length of the specimen at rest [m]."""
    separation: float = np.nan
    """Time of its greatest velocity, from which on nothing pushes it but the specimen [s]."""
    symmetry: SymmetryEnd | None = None
    """How its direction compares with the first; None if that is not known."""

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
    if result.travel is None or result.motion is None:
        return "its travel or its poses are not known"
    start = float(result.t[result.static][-1])
    travel = result.travel
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
    fastest = int(np.argmax(velocity[:, 0]))
    speed = float(velocity[fastest, 0])
    known = np.flatnonzero(
        (np.arange(time.size) >= fastest) & np.all(sigma[:, 1:] < SHARE * speed, axis=1)
    )
    symmetry = None
    if speed > 0.0 and known.size and time[known[0]] + SPAN * length / speed <= last:
        symmetry = symmetry_end(
            flight, time, separation=float(time[known[0]]), over=SPAN * length / speed, share=SHARE
        )
    return FlightOfSpecimen(flight, time, length, float(time[fastest]), symmetry)


def columns(found: FlightOfSpecimen) -> dict[str, FloatArray]:
    """The flight as columns with units, one row a frame from rest on."""
    t = found.time
    table = {"time (s)": t}

    def add(name: str, unit: str, value: FloatArray, sigma: FloatArray) -> None:
        table[f"{name} ({unit})"], table[f"sigma of {name} ({unit})"] = value, sigma

    velocity, spread = found.flight.velocity(t)
    for k, name in enumerate(("velocity toward the specimen", "velocity along x", "velocity along Z")):
        add(name, "m/s", velocity[:, k], spread[:, k])
    add("angle of the velocity to the axis", "rad", *found.flight.orientation(t))
    for what, unit, (value, sigma) in (
        ("rotation", "rad", found.flight.tilt(t)),
        ("angular velocity", "rad/s", found.flight.tilt_rate(t)),
    ):
        for k, axis in enumerate(("x", "Z")):
            add(f"{what} about {axis}", unit, value[:, k], sigma[:, k])
    if found.symmetry is not None:
        add("velocity across the first direction over the speed", "1", found.symmetry.share, found.symmetry.sigma)
    return {name: np.where(np.isfinite(value), value, 0.0) for name, value in table.items()}


def add_to(path: Path, found: FlightOfSpecimen) -> None:
    """Add the flight to the HDF5 file of a stereo result, as its group "flight".

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    with h5py.File(path, "r+") as file:
        group = file["entry"].create_group("flight")
        group.attrs["NX_class"] = "NXdata"
        group.attrs["signal"], group.attrs["axes"] = "velocity toward the specimen", ["time"]
        for name, values in columns(found).items():
            plain, unit = name.rsplit(" (", 1)
            group.create_dataset(plain, data=values).attrs["units"] = unit.rstrip(")")
        group.attrs["separation_s"], group.attrs["share"] = found.separation, SHARE
        if found.end is not None:
            group.attrs["symmetry_end_s"] = found.end


def summary(found: FlightOfSpecimen | str) -> dict[str, float | str | None]:
    """What a user wants to know of the flight: name and value, SI and JSON types."""
    if isinstance(found, str):
        return {"flight": f"not known: {found}"}
    at = np.array([found.separation])
    (velocity, _, _), (sigma, _, _) = (values[0] for values in found.flight.velocity(at))
    known = found.time if found.symmetry is None else found.time[found.symmetry.sigma < SHARE]
    angle, angle_sigma = found.flight.orientation(known)
    tilt, tilt_sigma = found.flight.tilt(known)
    rate, rate_sigma = found.flight.tilt_rate(known)
    middle = int(np.argsort(angle_sigma)[0]) if known.size else None
    if middle is None:
        return {"flyer_velocity_m_s": float(velocity), "flyer_velocity_sigma_m_s": float(sigma)}
    turned, turning = (np.unravel_index(np.argmax(np.abs(values)), values.shape) for values in (tilt, rate))
    return {
        "flyer_velocity_m_s": float(velocity),
        "flyer_velocity_sigma_m_s": float(sigma),
        "separation_s": found.separation,
        "velocity_angle_rad": float(np.median(angle)),
        "velocity_angle_sigma_rad": float(np.median(angle_sigma)),
        "largest_tilt_rad": float(np.abs(tilt[turned])),
        "largest_tilt_sigma_rad": float(tilt_sigma[turned]),
        "largest_tilt_rate_rad_s": float(np.abs(rate[turning])),
        "largest_tilt_rate_sigma_rad_s": float(rate_sigma[turning]),
        "symmetry_end_s": found.end,
    }
