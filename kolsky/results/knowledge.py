"""What the data tell beside the estimates, in the result's HDF5 file and its JSON object."""

from dataclasses import fields
from typing import Any

import h5py

from kolsky.inverse.result import Identification
from kolsky.inverse.uncertainty_results import (
    Declaration,
    PairMap,
    ParameterProfile,
    PosteriorSummary,
    Variation,
)
from kolsky.results.datasets import data, group, numbered, read, read_numbers, write, write_numbers
from kolsky.results.layout import Table

LIKELIHOOD: Table = {
    "name": ("", "", "t"),
    "values": ("SI", "values", "f"),
    "rise": ("1", "values", "f"),
    "points": ("SI", "values parameters", "f"),
    "level": ("1", "", "f"),
    "correlation": ("1", "", "f"),
    "interval": ("SI", "two", "f"),
    "alone": ("SI", "two", "f"),
    "verdict": ("", "", "t"),
    "text": ("", "", "t"),
    "error": ("1", "", "f"),
}
RIDGE: Table = {
    "names": ("", "two", "t"),
    "x": ("SI", "x", "f"),
    "y": ("SI", "y", "f"),
    "rise": ("1", "y x", "f"),
}
DECLARED: Table = {
    "key": ("", "", "t"),
    "sigma": ("SI", "", "f"),
    "unit": ("", "", "t"),
    "status": ("", "", "t"),
}
VARIATION: Table = {
    "key": ("", "", "t"),
    "value": ("s", "", "f"),
    "status": ("", "", "t"),
}
POSTERIOR: Table = {
    "names": ("", "coordinates", "t"),
    "samples": ("SI", "samples coordinates", "f"),
    "median": ("SI", "coordinates", "f"),
    "lower": ("SI", "coordinates", "f"),
    "upper": ("SI", "coordinates", "f"),
    "converged": ("1", "", "b"),
    "autocorrelation": ("1", "", "f"),
    "steps": ("1", "", "i"),
    "acceptance": ("1", "", "f"),
    "power": ("1", "", "f"),
    "prior": ("", "", "t"),
}


def write_knowledge(entry: h5py.Group, result: Identification) -> None:
    """Write profiles, ridge, declared uncertainties, other choices and posterior into a result's entry."""
    known = group(entry, "knowledge", "NXcollection")
    likelihoods = group(known, "profiles", "NXcollection")
    for number, profile in enumerate(result.profiles):
        write(data(likelihoods, str(number), "rise", "values"), LIKELIHOOD, vars(profile), {"two": 2})
    declared = group(known, "systematic", "NXcollection")
    for number, part in enumerate(result.systematic):
        place = group(declared, str(number), "NXcollection")
        write(place, DECLARED, vars(part), {})
        write_numbers(place, "shifts", part.shifts)
    others = group(known, "variations", "NXcollection")
    for number, other in enumerate(result.variations):
        place = group(others, str(number), "NXcollection")
        write(place, VARIATION, vars(other), {})
        write_numbers(place, "shifts", other.shifts)
    if result.ridge is not None:
        write(data(known, "ridge", "rise", "y", "x"), RIDGE, vars(result.ridge), {"two": 2})
    if result.posterior is not None:
        write(group(known, "posterior", "NXcollection"), POSTERIOR, vars(result.posterior), {})


def read_knowledge(file: h5py.File) -> dict[str, Any]:
    """The fields of an `Identification` that `write_knowledge` wrote.

    Raises
    ------
    kolsky.results.datasets.Refused
        If a dataset is missing or not as it was written.
    """
    place, dims = "entry/knowledge", {"two": 2}
    profiles = []
    for where in numbered(file, f"{place}/profiles"):
        values = read(file, where, LIKELIHOOD, {"two": 2})
        for name in ("interval", "alone"):
            values[name] = tuple(values[name].tolist())
        profiles.append(ParameterProfile(**values))
    known = file[place]
    ridge = PairMap(**read(file, f"{place}/ridge", RIDGE, dims)) if "ridge" in known else None
    posterior = None
    if "posterior" in known:
        posterior = PosteriorSummary(**read(file, f"{place}/posterior", POSTERIOR, {}))
    return {
        "profiles": tuple(profiles),
        "systematic": tuple(
            Declaration(**read(file, where, DECLARED, {}), shifts=read_numbers(file, f"{where}/shifts"))
            for where in numbered(file, f"{place}/systematic")
        ),
        "ridge": ridge,
        "posterior": posterior,
    }


def read_variations(file: h5py.File) -> tuple[Variation, ...]:
    """Other choices of the analyst, as `write_knowledge` wrote them.

    Raises
    ------
    kolsky.results.datasets.Refused
        If a dataset is missing or not as it was written.
    """
    return tuple(
        Variation(**read(file, where, VARIATION, {}), shifts=read_numbers(file, f"{where}/shifts"))
        for where in numbered(file, "entry/knowledge/variations")
    )


def knowledge_json(result: Identification) -> dict[str, Any]:
    """The same as JSON types: intervals, verdicts and shares, without curves, maps and samples."""
    posterior = None
    if result.posterior is not None:
        posterior = {f.name: getattr(result.posterior, f.name) for f in fields(PosteriorSummary)}
        del posterior["samples"]
    return {
        "profiles": {
            profile.name: {
                "interval": profile.interval,
                "interval_others_known": profile.alone,
                "level": profile.level,
                "verdict": profile.verdict,
                "text": profile.text,
                "error": profile.error,
            }
            for profile in result.profiles
        },
        "systematic": {
            part.key: {"sigma": part.sigma, "unit": part.unit, "shifts": part.shifts, "status": part.status}
            for part in result.systematic
        },
        "variations": [
            {"key": other.key, "value": other.value, "shifts": other.shifts, "status": other.status}
            for other in result.variations
        ],
        "posterior": posterior,
    }
