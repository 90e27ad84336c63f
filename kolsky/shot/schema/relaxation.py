"""[relaxation] of shot.toml: what relaxes beside the quasi-static law, its constants held or free."""

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, model_validator

from kolsky.base.relaxation import MOST_BRANCHES, NETWORK_DEFAULTS, Relaxation, prony_names
from kolsky.shot.schema import fields as f
from kolsky.shot.schema.section import Section
from kolsky.shot.schema.uncertainty import UncertaintySection

_PRONY = ("strengths", "times", "sigma_strengths", "sigma_times")
_CONSTANTS = ("ratio", "resistance", "exponent", "chain_exponent", "first_creep")
_NETWORK = (*_CONSTANTS, "sigma_ratio", "sigma_resistance")
_EXAMPLES = {"strengths": "[0.3]", "times": '["400 us"]', "ratio": "0.5", "resistance": '"10 kPa"'}


def _numbers(values: object) -> tuple[float, ...]:
    if not isinstance(values, list | tuple) or not 1 <= len(values) <= MOST_BRANCHES:
        raise f.problem("is not a list of 1 to 3 numbers", cure="write e.g. [0.3], a number a branch")
    return tuple(f.number(value) for value in values)


def _times(values: object) -> tuple[float, ...]:
    if not isinstance(values, list | tuple) or not 1 <= len(values) <= MOST_BRANCHES:
        raise f.problem("is not a list of 1 to 3 times", cure='write e.g. ["400 us"], a time a branch')
    return tuple(f.seconds(value) for value in values)


class RelaxationSection(Section):
    """[relaxation]: a Prony series or the network of Bergstrom and Boyce, relative to the long-term law."""

    kind: Literal["prony", "bergstrom_boyce"]
    free: bool = False
    strengths: Annotated[tuple[float, ...], BeforeValidator(_numbers)] | None = None
    times: Annotated[tuple[float, ...], BeforeValidator(_times)] | None = None
    sigma_strengths: Annotated[tuple[float, ...], BeforeValidator(_numbers)] | None = None
    sigma_times: Annotated[tuple[float, ...], BeforeValidator(_times)] | None = None
    ratio: f.Number | None = None
    resistance: f.Stress | None = None
    exponent: f.Number | None = None
    chain_exponent: f.Number | None = None
    first_creep: f.Number | None = None
    sigma_ratio: f.Number | None = None
    sigma_resistance: f.Stress | None = None

    @model_validator(mode="after")
    def _complete(self) -> "RelaxationSection":
        own, other = (_PRONY, _NETWORK) if self.kind == "prony" else (_NETWORK, _PRONY)
        for name in other:
            if getattr(self, name) is not None:
                raise f.problem(
                    f'is given, but kind = "{self.kind}" does not have it, so it would have no effect',
                    key=name,
                    cure=f"remove it; the keys here are {', '.join(own)}",
                )
        for name in own[:2]:
            if getattr(self, name) is None:
                raise f.problem(
                    f'is missing; kind = "{self.kind}" needs it, free or not: a search starts there',
                    key=name,
                    cure=f"add e.g. {name} = {_EXAMPLES[name]}",
                )
        self._lengths()
        self._possible()
        return self

    def _lengths(self) -> None:
        if self.kind != "prony" or self.strengths is None:
            return
        for name in ("times", "sigma_strengths", "sigma_times"):
            given = getattr(self, name)
            if given is not None and len(given) != len(self.strengths):
                raise f.problem(
                    f"has {len(given)} entries, strengths has {len(self.strengths)}",
                    key=name,
                    cure="give one a branch",
                )

    def _possible(self) -> None:
        """Refuse constants that the solver's own laws refuse, and uncertainties that are none."""
        from explicit.relaxation import BergstromBoyce, PronySeries

        record = self.declared()
        values = list(record.values.values())
        try:
            if record.kind == "prony":
                PronySeries(tuple(values[: record.branches]), tuple(values[record.branches :]))
            else:
                BergstromBoyce(*values)
        except ValueError as error:
            key = "strengths" if "strength" in str(error) else "times"
            if record.kind != "prony":
                key = next((name for name in _CONSTANTS if str(error).startswith(name)), "ratio")
            raise f.problem(f"is not allowed: {error}", key=key) from None
        for name, sigma in record.sigmas.items():
            if not sigma >= 0.0:
                raise f.problem(
                    f"is not allowed: the standard uncertainty of {name} is {sigma:g}",
                    allowed=">= 0",
                    cure="write 0 for a constant that is exact",
                )

    def declared(self) -> Relaxation:
        """The record that a shot holds."""
        if self.kind == "prony":
            strengths, times = self.strengths or (), self.times or ()
            names = prony_names(len(strengths))
            sigmas: dict[str, float] = {}
            if self.sigma_strengths is not None:
                sigmas |= zip(names, self.sigma_strengths, strict=False)
            if self.sigma_times is not None:
                sigmas |= zip(names[len(strengths) :], self.sigma_times, strict=False)
            return Relaxation("prony", dict(zip(names, (*strengths, *times), strict=True)), sigmas, self.free)
        given = {
            "creep_ratio": self.ratio,
            "creep_resistance": self.resistance,
            "creep_exponent": self.exponent,
            "creep_chain_exponent": self.chain_exponent,
            "creep_first": self.first_creep,
        }
        values = {name: NETWORK_DEFAULTS[name] if x is None else x for name, x in given.items()}
        own = {"creep_ratio": self.sigma_ratio, "creep_resistance": self.sigma_resistance}
        sigmas = {name: sigma for name, sigma in own.items() if sigma is not None}
        return Relaxation("bergstrom_boyce", values, sigmas, self.free)


def declared_relaxation(
    section: RelaxationSection | None, uncertainty: UncertaintySection | None
) -> dict[str, Any]:
    """Fields `relaxation` and `uncertainty` of a shot: its constants' sigmas stand with the others."""
    known = {} if uncertainty is None else uncertainty.for_identify()
    if section is None:
        return {"relaxation": None, "uncertainty": known}
    record = section.declared()
    return {"relaxation": record, "uncertainty": {**known, **record.sigmas}}
