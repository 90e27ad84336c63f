"""What a made shot truly did, before any instrument looks."""

from dataclasses import dataclass

from kolsky.base.arrays import FloatArray


@dataclass(frozen=True)
class SurfaceHistory:
    """Specimen and flyer at the true times of the frames, static ones included."""

    time: FloatArray
    """Times on the shot's clock [s], shape [n_frames]."""
    r: FloatArray
    """Radius of the side surface's nodes, transmission platen first [m], shape [n_frames, n_nodes]."""
    y: FloatArray
    """Their height above the transmission platen's initial plane [m], shape [n_frames, n_nodes]."""
    displacement: FloatArray
    """Of the flyer's centre toward the specimen [m], shape [n_frames]."""
    tilt: FloatArray
    """Pitch of the flyer in the cameras' plane, camera side ahead [rad], shape [n_frames]."""


@dataclass(frozen=True)
class Truth:
    """A made shot as it was."""

    surface: SurfaceHistory
    force_time: FloatArray
    """Times on the shot's clock, uniform [s], shape [n]."""
    transmitted: FloatArray
    """Force of the specimen on the transmission platen, compression-positive [N], shape [n]."""
    incident: FloatArray
    """Force of the flyer's platen on the specimen [N], shape [n]."""
    flyer_acceleration: FloatArray
    """Of the flyer toward the specimen [m/s^2], shape [n]."""
    support_acceleration: FloatArray
    """Of the transmission platen away from the specimen [m/s^2], shape [n]."""
    flyer_radius: float
    """Radius of the flyer's side that the cameras see [m]."""


class TruthError(Exception):
    """A simulation of a truth that did not reach its end; the message says why."""
