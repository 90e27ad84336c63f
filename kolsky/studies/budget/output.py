"""A budget as a table, and as facts for a terminal."""

from pathlib import Path
from typing import Any

import numpy as np

from kolsky.base.files import write_table
from kolsky.studies.budget.campaign import Campaign
from kolsky.studies.budget.records import Budget


def write_budget(path: Path, result: Budget) -> Path:
    """Write one row a source: standard uncertainty of the source, what it does to the answer, its share."""
    sources = result.sources
    return write_table(
        path,
        {
            "source": [source.factor.words for source in sources],
            "key": [source.factor.key for source in sources],
            "standard uncertainty (SI)": [source.factor.sigma for source in sources],
            "slope (SI)": [source.slope for source in sources],
            "bias (SI)": [source.bias for source in sources],
            "u (SI)": [source.u for source in sources],
            "share (1)": [result.share(source) for source in sources],
            "share, 95 % from (1)": [source.share_interval[0] for source in sources],
            "share, 95 % to (1)": [source.share_interval[1] for source in sources],
            "share in all at once (1)": [source.joint_share for source in sources],
            "in all at once, 95 % from (1)": [source.joint_interval[0] for source in sources],
            "in all at once, 95 % to (1)": [source.joint_interval[1] for source in sources],
            "common to all shots (0/1)": [int(source.factor.shared) for source in sources],
            "refused": ["; ".join(source.refused) for source in sources],
        },
    )


def facts(result: Budget, campaign: Campaign | None = None) -> dict[str, Any]:
    """The budget in numbers, SI: the largest source first."""
    low, high = result.u_together_interval
    ordered = sorted(result.sources, key=lambda source: -np.nan_to_num(source.u))
    return {
        "test": result.name,
        "parameter": result.parameter,
        "truth": result.truth,
        "reference": result.reference,
        "u_sum": result.u_sum,
        "u_together": result.u_together,
        "u_together_low": low,
        "u_together_high": high,
        "sources_add_up": result.adds_up,
        "refused_together": len(result.refused),
        "together": result.together.tolist(),
        "closure": result.closure,
        "realisations": result.counts,
        "searched_whole": result.searched,
        "in_another_valley": result.elsewhere.tolist(),
        "unexplained": None if result.joint is None else result.joint.unexplained,
        "unexplained_interval": None if result.joint is None else list(result.joint.unexplained_interval),
        "sources": {
            source.factor.key: {
                "sigma": source.factor.sigma,
                "u": source.u,
                "bias": source.bias,
                "slope": source.slope,
                "share": result.share(source),
                "share_interval": list(source.share_interval),
                "joint_share": source.joint_share,
                "joint_interval": list(source.joint_interval),
                "refused": len(source.refused),
            }
            for source in ordered
        },
        **({} if campaign is None else _planned(campaign)),
    }


def made_with(
    analysis: tuple[int, int], refined: tuple[int, int], truth: tuple[int, int], draws: int, together: int
) -> dict[str, Any]:
    """What the numbers rest on: meshes of the identification and of the truth, numbers of draws."""
    return {
        "mesh": list(analysis),
        "refined_mesh": list(refined),
        "truth_mesh": list(truth),
        "draws": draws,
        "together": together,
    }


def _planned(campaign: Campaign) -> dict[str, Any]:
    return {
        "campaign_shots": campaign.shots,
        "campaign_rates": [float(campaign.rates[0]), float(campaign.rates[-1])],
        "campaign_sigma": campaign.sigma,
        "campaign_half_width": campaign.half_width,
    }


def printed(result: Budget, campaign: Campaign | None = None) -> dict[str, Any]:
    """The budget for a terminal: a line for each source with its expanded uncertainty and share."""
    said = facts(result, campaign)
    for name in ("together", "unexplained", "unexplained_interval", "closure", "realisations"):
        del said[name]
    elsewhere = said.pop("in_another_valley")
    words = {source.factor.key: source.factor.words for source in result.sources}
    lines = {
        f"U from {words[key]}": f"{2.0 * source['u']:.3g} ({100.0 * source['share']:.2g} %)"
        if np.isfinite(source["u"])
        else "not known: the test gave no answer"
        for key, source in said.pop("sources").items()
    }
    return {**{key: value for key, value in said.items() if not key.startswith("u_")}, **lines} | {
        "realisations": ", ".join(f"{n} {how}" for how, n in result.counts.items()),
        "in another valley": f"{len(elsewhere)} of {result.searched}"
        + (f", at {', '.join(f'{value:.4g}' for value in elsewhere)}" if elsewhere else ""),
        "U, added in quadrature": f"{2.0 * result.u_sum:.3g}",
        "U, all at once": f"{2.0 * result.u_together:.3g}",
    }
