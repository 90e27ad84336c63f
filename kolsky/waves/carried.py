"""The waves at the faces with the dispersion of their bars, on the clock of those without it."""

from dataclasses import replace

from kolsky.waves.propagation import propagation
from kolsky.waves.records import BarSignal, FaceWaves, FloatArray
from kolsky.waves.records import Windows
from kolsky.waves.waveguide import ElasticWaveguide


def dispersed(plain: FaceWaves, incident: BarSignal, transmission: BarSignal, windows: Windows) -> FaceWaves:
    """Carry each pulse along its bar in the first mode of Pochhammer and Chree.

    Parameters
    ----------
    plain
        The waves shifted at c0: gives times, origin and length.
    incident, transmission
        The strains at the two stations.
    windows
        What belongs to each pulse; outside, it fades to zero.

    Returns
    -------
    FaceWaves
        On the times of `plain`, with the noise that is left after the way.
    """
    start = plain.origin + float(plain.time[0])
    samples = plain.time.size
    sigma = {}

    def carried(name: str, station: BarSignal, way: float) -> FloatArray:
        found = propagation(
            station.strain,
            ElasticWaveguide(station.bar),
            way * station.position,
            window=getattr(windows, name),
            start=start,
            samples=samples,
        )
        sigma[name] = found.signal.sigma
        return found.signal.value

    return replace(
        plain,
        incident=carried("incident", incident, 1.0),
        reflected=carried("reflected", incident, -1.0),
        transmitted=carried("transmitted", transmission, -1.0),
        sigma=sigma,
    )
