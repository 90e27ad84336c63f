"""Results of a study of viscoelastic shots with known truth: counts with exact intervals, and their table.

`python -m populations.joint_coverage_counts SUMMARY ...` prints the table of a `summary.json`.
"""

from typing import Any

import numpy as np
from scipy.stats import binomtest

from populations.coverage_counts import ANSWERS, Each
from populations.driver import print_tables

PAIR = ("prony_strength_1", "prony_time_1")
NAMES = ("stiffness_factor", "poisson", "damping", *PAIR)
SYMBOLS = {
    "stiffness_factor": "$m$",
    "poisson": "$\\nu$",
    "damping": "$\\beta$",
    "prony_strength_1": "strength",
    "prony_time_1": "time",
}


def summary(each: Each) -> dict[str, Any]:
    """Counts of covered truths, correct pairs and required relaxation, and a short form of every draw. A
    rejected draw counts as not covering and without relaxation."""
    answered = [one for one in each if one["found"] is not None]
    choices = [one["found"]["model_choice"] for one in answered]
    return {
        "draws": len(each),
        "answered": len(answered),
        "relaxation asked for": share(sum(choice["asked_for"] for choice in choices), len(each)),
        "not decided": sum(choice["sentence"].startswith("not decided") for choice in choices),
        "pairs within 2 sigma": share(sum(pair_found(one) for one in answered), len(each)),
        "called identified": sum(called_identified(one) for one in answered),
        **{name: _parameter(name, answered, len(each)) for name in NAMES},
        "each": [_short(one) for one in each],
    }


def _parameter(name: str, answered: Each, of: int) -> dict[str, Any]:
    rows = [(one["truth"][name], one["found"]["estimates"][name]) for one in answered]
    inside = sum(e["interval_95"][0] <= true <= e["interval_95"][1] for true, e in rows)
    errors = np.array([(e["value"] - true) / e["sigma"] for true, e in rows])
    widths = [0.5 * (e["interval_95"][1] - e["interval_95"][0]) / true for true, e in rows]
    return {
        "held": share(inside, of),
        "misses, value too high and too low": [
            sum(true < e["interval_95"][0] for true, e in rows),
            sum(true > e["interval_95"][1] for true, e in rows),
        ],
        "error over sigma, mean and root mean square": (
            [float(errors.mean()), float(np.sqrt((errors**2).mean()))] if rows else None
        ),
        "median half width over the truth": float(np.median(widths)) if rows else None,
    }


def pair_found(one: dict[str, Any]) -> bool:
    """Whether strength and time are both within two standard uncertainties of the truth."""
    found, true = one["found"]["estimates"], one["truth"]
    return all(abs(found[name]["value"] - true[name]) <= 2.0 * found[name]["sigma"] for name in PAIR)


def called_identified(one: dict[str, Any]) -> bool:
    """Whether every verdict of a draw is an answer."""
    return all(e["outcome"] in ANSWERS for e in one["found"]["estimates"].values())


def share(count: int, of: int) -> dict[str, Any]:
    """A count with the exact 95 % interval of its proportion (Clopper and Pearson)."""
    ends = binomtest(count, of).proportion_ci(0.95, method="exact")
    return {"count": count, "of": of, "interval": [float(ends.low), float(ends.high)]}


def _short(one: dict[str, Any]) -> dict[str, Any]:
    """A draw without the data of its shots and tables."""
    found = one["found"]
    said = {"number": one["number"], "seconds": one["seconds"], "error": one["error"], "truth": one["truth"]}
    if found is None:
        return said
    kept, why = ("value", "sigma", "interval_95", "outcome"), ("aic", "probability", "asked_for", "sentence")
    return {
        **said,
        "estimates": {n: {key: e[key] for key in kept} for n, e in found["estimates"].items()},
        "scatter": found["scatter_between_shots"],
        "choice": {key: found["model_choice"][key] for key in why},
    }


def table(said: dict[str, Any]) -> str:
    """A study's `summary.json` as Markdown: the counts, and one column for each parameter."""
    study, asked = said["study"], said["relaxation asked for"]
    meshes = " → ".join(f"{study[key][0]} × {study[key][1]}" for key in ("mesh", "refined_mesh"))
    truth = " × ".join(map(str, study["truth_mesh"]))
    lines = [
        f"{said['draws']} draws of seed {study['seed']} (meshes {meshes}; truth {truth}, "
        f"{element_of(study)}, graded {study['truth_grading']:g} to 1), "
        f"{said['answered']} answered. Relaxation asked for: "
        f"{counted(asked)}; not decided: {said['not decided']}."
    ]
    names = NAMES[: -len(PAIR)] if study["elastic"] else NAMES  # elastic materials have no pair
    if not study["elastic"]:
        lines[0] += (
            " Strength and time both within two standard uncertainties: "
            f"{counted(said['pairs within 2 sigma'])}. Called identified: {said['called identified']}."
        )
    heads = " | ".join(SYMBOLS[name] for name in names)
    rows = [
        ("95 % intervals that hold the truth", [counted(said[name]["held"]) for name in names]),
        (
            "misses: too high, too low",
            [", ".join(map(str, said[name]["misses, value too high and too low"])) for name in names],
        ),
        ("error over standard uncertainty: mean, rms", [_errors(said[name]) for name in names]),
        ("median half width of the interval", [_width(said[name]) for name in names]),
    ]
    lines += ["", f"| | {heads} |", "| --- |" + " --- |" * len(names)]
    return "\n".join([*lines, *(f"| {words} | {' | '.join(cells)} |" for words, cells in rows)])


def element_of(study: dict[str, Any]) -> str:
    """Text: the element of a study's truths. A study without this entry used F-bar elements."""
    words = {"fbar": "F-bar", "one_point": "one point", "middle": "the middle of both elements"}
    return words[study.get("truth_element", "fbar")]


def counted(one: dict[str, Any]) -> str:
    low, high = (100.0 * end for end in one["interval"])
    return f"{one['count']} of {one['of']} ({low:.0f} to {high:.0f} %)"


def _errors(one: dict[str, Any]) -> str:
    both = one["error over sigma, mean and root mean square"]
    return "–" if both is None else f"{both[0]:+.2f}, {both[1]:.2f}".replace("-", "−")


def _width(one: dict[str, Any]) -> str:
    width = one["median half width over the truth"]
    return "–" if width is None else f"{100.0 * width:.2g} %"


if __name__ == "__main__":
    print_tables(table)
