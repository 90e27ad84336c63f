"""[incident_force]: the channel of the flyer's own transducer, for classical means and for simulations."""

from kolsky.base.units import in_us
from kolsky.shot.force import SMALLEST_BASELINE, channel_of, check_range, force_recording
from kolsky.shot.records import ForceChannel, IncidentForce
from kolsky.shot.schema.reading import ShotToml


def incident_channel(toml: ShotToml) -> ForceChannel | None:
    """The channel that a shot file declares; None if it declares none.

    Raises
    ------
    InputError
        If its file cannot be read, it is clipped, or its baseline holds too few samples.
    """
    declared = toml.declared.incident_force
    if declared is None:
        return None
    section = declared.completed(toml.declared.force)
    recording = force_recording(toml.path.parent / section.file, section)
    check_range(recording, section, "incident_force")
    channel = channel_of(recording, section)
    if channel.baseline_volts().size < SMALLEST_BASELINE:
        raise toml.error(
            "incident_force.baseline",
            f"holds {channel.baseline_volts().size} samples",
            allowed=f"{SMALLEST_BASELINE} or more",
            cure="widen it within the stretch before the test, on the shot's clock",
        )
    return channel


def compared_incident(toml: ShotToml, span: tuple[float, float]) -> dict[str, IncidentForce]:
    """The incident force of a shot that compares it, as a field of the shot; empty for one that does not.

    What acts on the flyer before the window, the pulse that sets it in motion, ends before it flies: the
    window begins at rest, so that such a shot's incident force is that of the specimen from its start on.

    Parameters
    ----------
    toml
        The shot file.
    span
        The window [s].

    Raises
    ------
    InputError
        As `incident_channel`; if the recording does not cover the window, or has another clock than [force].
    """
    declared = toml.declared.incident_force
    if declared is None or not declared.compared:
        return {}
    channel = incident_channel(toml)
    assert channel is not None  # it is declared
    time = channel.time
    if time[0] > span[0] or time[-1] < span[1]:
        raise toml.error(
            "incident_force.file",
            f"spans {in_us(time[0])} to {in_us(time[-1])}, the window {in_us(span[0])} to {in_us(span[1])} "
            "(shot's clock)",
            cure="shorten the window with window.end, or leave incident_force.compared out",
        )
    return {"incident": IncidentForce(channel, declared.mass)}
