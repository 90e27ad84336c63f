"""What the recording of the force must be, in range, zero and sign; anything else is refused."""

import numpy as np

from kolsky.base.arrays import FloatArray
from kolsky.base.errors import InputError
from kolsky.base.records import FlyerMotion, Recording
from kolsky.base.units import in_us
from kolsky.shot.schema.reading import ShotToml

SMALLEST_BASELINE = 20
"""Samples needed for the zero and the noise of the force."""


def clipping(scope: Recording, toml: ShotToml) -> None:
    """No sample at or beyond the recorder's full scale (with `bits`: at its first or last code)."""
    force = toml.declared.force
    limit = force.full_scale
    if force.bits is not None:
        # Codes run from -2^(b-1) to 2^(b-1) - 1; half a code less, since the volts are printed rounded.
        limit *= 1.0 - 1.5 / 2 ** (force.bits - 1)
    clipped = np.flatnonzero(np.abs(scope.value) >= limit)
    if clipped.size:
        row = int(clipped[0])
        raise InputError(
            scope.path,
            f"column '{scope.channel}' is clipped: {scope.value[row]:.6g} V in the first of {clipped.size}"
            f" samples at or beyond full scale (force.full_scale = {force.full_scale:g} V)",
            line=row + 2 if force.layout is None else None,
            cure="a clipped force is lost; repeat the test at a coarser range, or correct force.full_scale",
        )


def baseline(volts: FloatArray, rest: float, toml: ShotToml) -> None:
    """Enough samples before the flyer moves, with visible noise.

    Parameters
    ----------
    volts
        Samples in the baseline window [V], shape [n].
    rest
        Time of the last static frame on the shot's clock [s].
    toml
        The shot file.
    """
    if toml.declared.force.baseline[1] > rest:
        raise toml.error(
            "force.baseline",
            "overlaps the flyer's motion",
            allowed=f"before the last static frame at {in_us(rest)} (shot's clock)",
            cure="end it earlier",
        )
    if volts.size < SMALLEST_BASELINE:
        raise toml.error(
            "force.baseline",
            f"holds {volts.size} samples",
            allowed=f"a time span with at least {SMALLEST_BASELINE} samples",
            cure="choose a longer span inside the record, on the shot's clock",
        )
    if np.ptp(volts) == 0.0:
        raise toml.error(
            "force.baseline",
            f"holds the same value {volts[0]:.6g} V {volts.size} times, so the noise is unknown",
            cure="is force.voltage the right column, and was the channel connected?",
        )


def force_sign(
    force: FloatArray, scope_time: FloatArray, span: tuple[float, float], flyer: FlyerMotion, toml: ShotToml
) -> None:
    """A flyer that went far into the specimen has pushed it, not pulled.

    Parameters
    ----------
    force
        Compression-positive force at the scope samples [N], shape [n].
    scope_time
        Their times on the shot's clock [s], shape [n].
    span
        The window [s].
    flyer
        The flyer's motion.
    toml
        The shot file.
    """
    # A bonded face pulls in the first waves; only a good part of the compression decides the sign.
    inside = flyer.time <= span[1]
    if np.ptp(flyer.displacement[inside]) < 0.1 * toml.declared.specimen.length:
        return
    mean = float(force[(scope_time >= span[0]) & (scope_time <= span[1])].mean())
    if mean < 0.0:
        raise toml.error(
            "force.compression",
            f"contradicts the recording: with this sign the specimen pulls, by {-mean:.3g} N in the mean",
            cure="declare the other sign, or check force.voltage and force.baseline",
        )
