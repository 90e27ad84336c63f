"""Fine alignment: waves moved so that their observed arrivals meet at the specimen.

Distances and wave speeds say when the reflected and the transmitted pulse belong to the incident one. Where a
distance is wrong by a millimetre, or a specimen takes its time to load, the observed arrivals say something
else. Moving a wave by the difference is a correction like the others: off by default, listed with its size in
any case, and known no better than the two arrivals.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from math import hypot

from kolsky.bars.audit import Switches
from kolsky.bars.records import BarSignal, Quantity
from kolsky.bars.reduction.pulse_checks import PulseCheck
from kolsky.bars.reduction.windows import travel_time
from kolsky.bars.signals.arrival import Arrival

KEYS = {"reflected": "reflected alignment", "transmitted": "transmitted alignment"}
"""Switch of each wave."""


@dataclass(frozen=True)
class Alignment:
    """Observed arrival of one wave at its gauge."""

    wave: str
    """"reflected" or "transmitted"."""
    late: float
    """Observed less predicted arrival at the distances and wave speeds as declared [s]."""
    way: float
    """Predicted time from the incident pulse's arrival at its gauge, as declared [s]."""
    sigma: float
    """Standard uncertainty of the difference of the two arrivals [s]."""

    @property
    def quantity(self) -> Quantity:
        """What the alignment adds to the budget."""
        return Quantity(f"alignment, {self.wave} wave", 0.0, self.sigma, "s", "A")


def alignments(
    arrival: Arrival, checks: tuple[PulseCheck, PulseCheck], switches: Switches
) -> tuple[dict[str, Alignment], dict[str, str]]:
    """Alignment of each wave whose pulse was observed, and why another has none.

    Parameters
    ----------
    arrival
        Arrival of the incident pulse at its gauge.
    checks
        Predicted and observed arrival of the reflected and the transmitted pulse.
    switches
        An alignment that is on must be possible.

    Returns
    -------
    tuple of dict
        Wave -> alignment, applied or not, and wave -> reason.

    Raises
    ------
    ValueError
        If an alignment is switched on and its pulse was not found.
    """
    found, missing = {}, {}
    for (wave, key), check in zip(KEYS.items(), checks, strict=True):
        if check.observed is None:
            missing[wave] = f"no {wave} pulse is found: {check.reason}"
            if switches[key]:
                raise ValueError(
                    f"the {wave} wave cannot be aligned: {check.reason}. Cure: leave {key!r} off, or set "
                    "windows by hand"
                )
            continue
        sigma = hypot(arrival.sigma, check.observed.sigma)
        found[wave] = Alignment(wave, check.delay, check.predicted - arrival.time, sigma)
    return found, missing


def delays(
    aligned: Mapping[str, Alignment],
    incident: BarSignal,
    transmission: BarSignal,
    values: Mapping[str, float],
) -> tuple[float, float]:
    """Times by which the reflected and the transmitted wave are taken later than travel times say [s].

    An aligned wave stays where it was observed: a longer way or a slower bar changes what is predicted, not
    what was seen.

    Parameters
    ----------
    aligned
        The alignments that act, by wave.
    incident, transmission
        The stations, with the varied distances and wave speeds.
    values
        Values of the budget's quantities, by name.
    """
    ways = {
        "reflected": 2.0 * travel_time(incident),
        "transmitted": travel_time(incident) + travel_time(transmission),
    }
    late = {wave: 0.0 for wave in KEYS}
    for wave, found in aligned.items():
        late[wave] = found.late + found.way - ways[wave] + values.get(found.quantity.name, 0.0)
    return late["reflected"], late["transmitted"]
