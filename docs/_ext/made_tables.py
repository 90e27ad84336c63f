"""Tables of pages, made from the project's sources and results. They always agree with the project.

A line ``<!-- rooms -->`` of a page becomes the table of the rooms of `kolsky`. The test of imports also reads
its source, docs/rooms.toml. Other lines become these tables: ``<!-- public kolsky -->`` the public names of a
package, each with its first line, ``<!-- commands kolsky -->`` the commands of the command line, ``<!--
parameters kolsky -->`` rows of the parameters of a simulation, ``<!-- table laws -->`` (`contact_laws`,
`elements`) the members of a registry of the solver, ``<!-- causes kolsky -->`` the inputs that are tried as
causes of a misfit, ``<!-- wrong NAME -->`` the table of a study of wrong inputs, ``<!-- budget NAME -->``
that of an error budget, ``<!-- drawn NAME -->`` that of a population of drawn shots, ``<!-- answers NAME
-->`` answers of known shots, ``<!-- pooled NAME -->`` shots and their mean, ``<!-- coverage NAME -->`` a
study of coverage, ``<!-- meshed NAME -->`` the mesh errors of answers, ``<!-- ablated NAME -->`` and ``<!--
undiagnosed NAME -->`` answers without one mechanism, ``<!-- planted NAME -->`` and ``<!-- advised NAME -->``
synthetic shots with relaxation, ``<!-- rated NAME -->`` false alarms of a slope, ``<!-- gained NAME -->``
joint shots with one wrong sensitivity, ``<!-- equilibria NAME -->`` times of equilibria, ``<!-- killed NAME
-->``, ``<!-- soaked NAME -->`` and ``<!-- fuzzed NAME -->`` results of the tests with kills, long runs and
damaged files, ``<!-- solved NAME -->`` the solver's speed, ``<!-- priced NAME -->`` the cost of an answer,
``<!-- grown NAME -->`` the growth of the time with the size and ``<!-- campaigns NAME -->`` the time on
several workers. NAME is a file NAME.json of benchmarks/results or populations/results. ``<!-- named inputs
-->`` are inputs with separate tests (tests/fuzz/named.py). At any place of a line, ``<!-- names laws -->``
becomes the names of the registry.
"""

import importlib
import inspect
import json
import re
import statistics
import tomllib
from functools import partial
from pathlib import Path

DOCS = Path(__file__).resolve().parents[1]
VERIFICATION = DOCS / "verification" / "index.md"
NAMES = re.compile(r"<!-- names (\w+) -->")
TOPIC = re.compile(r"^\| \[[^]]+\]\((\w+)\.md\) .*$", re.MULTILINE)
"""Pattern of a topic's line in the index of the verification manual."""
NUMBER = re.compile(r"\{\{ (.+?) \}\}")


def rooms(package: str) -> str:
    """The rooms of a package in the order of their imports."""
    lines = ["| room | inside | holds |", "| --- | --- | --- |"]
    table = "room" if package == "kolsky" else package
    for room in tomllib.loads((DOCS / "rooms.toml").read_text("utf-8"))[table]:
        inside = ", ".join(f"`{name}`" for name in room.get("inside", []))
        page = f"api/generated/{package}.{room['name']}"
        lines.append(f"| {{doc}}`{room['name']} <{page}>` | {inside} | {room['does']} |")
    return "\n".join(lines)


def public(package: str) -> str:
    """Names of a package's ``__all__``, with their documented place and first line."""
    module = importlib.import_module(package)
    homes = getattr(module, "_HOME", {})
    lines = ["| name | what it is |", "| --- | --- |"]
    for name in sorted(module.__all__, key=str.casefold):
        value = getattr(module, name)
        # A name is documented where it is defined; a constant does not store this place.
        home = getattr(value, "__module__", None) if callable(value) else None
        home = home or homes.get(name, package)
        kind = "class" if inspect.isclass(value) else "func" if callable(value) else "data"
        own = inspect.getdoc(value) if kind != "data" else ""
        first = " ".join((own or "").partition("\n\n")[0].split()).replace("|", r"\|")
        lines.append(f"| {{py:{kind}}}`{package}.{name} <{home}.{name}>` | {first} |")
    return "\n".join(lines)


def members(registry: str) -> dict:
    """A registry of the solver."""
    from explicit.contact import CONTACT_LAWS
    from explicit.elements import ELEMENTS
    from explicit.materials import LAWS

    return {"laws": LAWS, "contact_laws": CONTACT_LAWS, "elements": ELEMENTS}[registry]


def table(registry: str) -> str:
    """The members of a registry, one row each."""
    if registry != "laws":
        lines = ["| name | what it is |", "| --- | --- |"]
        return "\n".join(
            lines + [f"| `{name}` | {_first_line(type(item))} |" for name, item in members(registry).items()]
        )
    lines = [r"| name | $W$ | constants | $\mu_0$ |", "| --- | --- | --- | --- |"]
    for name, law in members(registry).items():
        formula = f"${law.FORMULA}$" if law.FORMULA else _first_line(law)
        modulus = f"${law.MODULUS}$" if law.MODULUS else ""
        constants = ", ".join(f"`{spec.name}`" for spec in law.PARAMETERS)
        lines.append(f"| `{name}` | {formula} | {constants} | {modulus} |")
    return "\n".join(lines)


def _first_line(thing: type) -> str:
    return " ".join((inspect.getdoc(thing) or "").partition("\n\n")[0].split()).replace("|", r"\|")


def commands(package: str = "kolsky") -> str:
    """The commands of a package in the order of ``--help``, each with its first line."""
    registry = importlib.import_module(f"{package}.cli.commandline").COMMANDS
    lines = ["| command | what it does |", "| --- | --- |"]
    for words, command in registry.items():
        first = (inspect.getdoc(command) or "").partition("\n\n")[0]
        lines.append(f"| `{package} {words}` | {' '.join(first.split())} |")
    return "\n".join(lines)


def parameters(package: str) -> str:
    """Rows of a table of the parameters of a simulation: symbol, name, unit, meaning."""
    records = importlib.import_module(f"{package}.inverse.parameters").PARAMETERS.values()
    return "\n".join(f"| ${p.tex}$ | `{p.name}` | {p.unit} | {p.words} |" for p in records)


def causes(package: str) -> str:
    """The inputs that are tried as causes of a misfit, one row each."""
    records = importlib.import_module(f"{package}.shot.inputs").causes()
    lines = ["| what is changed | what to do if it is named |", "| --- | --- |"]
    return "\n".join(lines + [f"| {c.words} (`{c.key}`) | {c.check} |" for c in records])


def wrong(name: str) -> str:
    """The table of a study of wrong inputs; one sentence if there is no result yet."""
    made = _results(name)
    if made is None:
        return _not_yet(name)
    lines = [
        "| wrong input | shots | ended | called identified | error of $m$, median | corrected | evidence |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for row in made["rows"]:
        ends = ", ".join(f"{count} {end}" for end, count in row["ends"].items())
        errors, evidence = row["errors"], [x for x in row["evidence"] if x is not None]
        error = f"{100.0 * statistics.median(errors):+.2f} %" if errors else ""
        after = [x for x in row["corrected errors"] if x is not None]
        corrected = f"{100.0 * statistics.median(after):+.2f} %" if after else ""
        span = f"{min(evidence):.0f} to {max(evidence):.0f}" if evidence else ""
        cells = [row["row"], row["shots"], ends, row["identified"], error, corrected, span]
        lines.append(f"| {' | '.join(map(str, cells))} |")
    if "summary" in made:
        of = made["summary"]
        lines += [
            "",
            f"Of {of['wrong']} wrong shots that matter {100.0 * of['first']:.1f} % have the right cause "
            f"first, {100.0 * of['first two']:.1f} % among the first two; {of['confident']} answers are "
            f"confident and wrong. Of {of['right']} right shots {of['alarms']} raise an alarm.",
        ]
    return "\n".join(lines)


def _results(name: str) -> dict | None:
    """A study's results; None if there are none yet."""
    for folder in ("benchmarks", "populations"):
        path = DOCS.parent / folder / "results" / f"{name}.json"
        if path.exists():
            return json.loads(path.read_text("utf-8"))
    return None


def budget(name: str) -> str:
    """The sources of an error budget as `kolsky budget --json` prints it, the largest first."""
    made = _results(name)
    if made is None:
        return _not_yet(name)
    from kolsky.studies.budget.realisation import Factor

    one = made["budgets"][0]
    other = made.get("against")
    head = "| source | its u (SI) | U of the answer (k = 2) | share |"
    rule = "| --- | --- | --- | --- |"
    lines = [head, rule] if other is None else [f"{head} {other['words']} |", f"{rule} --- |"]
    for key, source in one["sources"].items():
        known = source["u"] is not None
        size = "" if key == "noise" else f"{source['sigma']:.3g}"
        u, share = (f"{2.0 * source['u']:.4f}", f"{100.0 * source['share']:.2g} %") if known else ("", "")
        if known and None not in (ends := source.get("share_interval", [None])):
            share += f" ({100.0 * ends[0]:.2g} to {100.0 * ends[1]:.2g} %)"
        row = f"| {Factor(key, 0.0).words} | {size} | {u} | {share} |"
        if other is not None:
            row += f" {_of(source['u'], other['U'])} |" if known else " |"
        lines.append(row)
    last = "" if other is None else f" {_of(one['u_sum'], other['U'])} |"
    lines.append(f"| added in quadrature | | {2.0 * one['u_sum']:.4f} | |{last}")
    if one["u_together"] is not None:
        low, high = 2.0 * one["u_together_low"], 2.0 * one["u_together_high"]
        last = "" if other is None else f" {_of(one['u_together'], other['U'])} |"
        lines.append(f"| all at once | | {2.0 * one['u_together']:.4f} ({low:.4f} to {high:.4f}) | |{last}")
    if "realisations" in one:
        counts = ", ".join(f"{n} {how}" for how, n in one["realisations"].items())
        jumps = one["in_another_valley"]
        where = f", at {', '.join(f'{value:.3f}' for value in jumps)}" if jumps else ""
        lines += ["", f"Realisations: {counts}. Whole searches in another valley: {len(jumps)} of "]
        lines[-1] += f"{one['searched_whole']}{where}."
    if "made_with" in made:
        how = made["made_with"]
        meshes = [" × ".join(map(str, how[key])) for key in ("mesh", "refined_mesh", "truth_mesh")]
        lines += [
            "",
            f"Searched on {meshes[0]} elements, answered on {meshes[1]}, truths on {meshes[2]}; "
            f"{how['draws']} draws of the noise, {how['together']} of all errors at once.",
        ]
    return "\n".join(lines)


def _of(u: float, U: float) -> str:
    """Share of a squared expanded uncertainty that a standard uncertainty explains."""
    return f"{100.0 * (2.0 * u / U) ** 2:.2g} %"


def drawn(name: str) -> str:
    """The shots of a population: true and found value, uncertainty, error, verdict, time."""
    made = _results(name)
    if made is None:
        return _not_yet(name)
    kinds = ("right", "answered, beyond 1 %", "refused", "confidently wrong", "stopped by a fault")
    counts = ", ".join(f"{made[kind]} {kind}" for kind in kinds if kind in made)
    if made.get("scatter") is not None:
        counts += (
            f"; errors of the answered over their standard uncertainties: {made['scatter']:.2f} root mean "
            f"square, {made['largest']:.1f} at most"
        )
    whose = f" (seed {made['seed']})" if "seed" in made else ""
    lines = [
        *([f"Of {len(made['answers'])} shots{whose}: {counts}.", ""] if counts else []),
        "| shot | true $m$ | $m$ | U (k = 2) | error | verdict | counts as | time | with a cure |",
        "| --- | --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for one in made["answers"]:
        known = one["value"] is not None
        value, U = (f"{one['value']:.4f}", f"{2.0 * one['sigma']:.4f}") if known else ("", "")
        error = f"{100.0 * (one['value'] / one['truth'] - 1.0):+.2f} %" if known else ""
        cured = [again for again in one.get("cured", []) if again["answered"]]
        off = [f"{100.0 * abs(again['value'] / again['truth'] - 1.0):.2f} %" for again in cured]
        cells = [
            one["name"],
            f"{one['truth']:.4f}",
            value,
            U,
            error,
            one["verdict"],
            one.get("kind", ""),
            f"{one['seconds']:.0f} s",
            f"{cured[0]['cure']}: off by {off[0]}" if cured else ("none" if one.get("cured") else ""),
        ]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def _not_yet(name: str) -> str:
    return f"There is no result `{name}.json`: the study was not run yet."


def answers(name: str) -> str:
    """Answers of known shots and their true values, as `populations.answers` prints them."""
    from populations.answers import table

    made = _results(name)
    return _not_yet(name) if made is None else table({one["name"]: one for one in made["answers"]})


STUDIES = {
    "pooled": "populations.pooled_shots:table",
    "coverage": "populations.coverage:table",
    "meshed": "populations.mesh_errors:table each",
    "ablated": "populations.ablation:table each",
    "undiagnosed": "populations.ablation:diagnosis_table each",
    "planted": "populations.joint_coverage:table",
    "rated": "populations.rate_sets:table",
    "gained": "populations.joint_gains:table",
    "advised": "populations.branch_advice:table",
    "equilibria": "benchmarks.equilibrium_table:table",
    "killed": "benchmarks.kills:table",
    "soaked": "benchmarks.soak:table",
    "solved": "benchmarks.table:page_table",
    "priced": "benchmarks.identify:summary",
    "grown": "benchmarks.growth:table",
    "campaigns": "benchmarks.campaign:table",
}
"""Name of a table -> function that makes it, and the entry of the result that it takes, if only one."""


def study(kind: str, name: str) -> str:
    """A table of `STUDIES`, as its study or benchmark prints it."""
    made = _results(name)
    if made is None:
        return _not_yet(name)
    place, _, entry = STUDIES[kind].partition(" ")
    module, _, function = place.partition(":")
    return getattr(importlib.import_module(module), function)(made[entry] if entry else made)


def fuzzed(name: str) -> str:
    """The corpus of damaged files, as `python -m tests.fuzz` counted it."""
    made = _results(name)
    if made is None:
        return _not_yet(name)
    lines = ["| files | cases | refused | read | answered wrongly |", "| --- | --- | --- | --- | --- |"]
    for group, counts in made["groups"].items():
        wrong = sum(n for verdict, n in counts.items() if verdict not in ("refused", "accepted"))
        read = counts.get("accepted", 0)
        lines.append(f"| {group} | {sum(counts.values())} | {counts.get('refused', 0)} | {read} | {wrong} |")
    return "\n".join(lines)


def named(what: str) -> str:
    """Inputs with separate tests, each with its tests."""
    from tests.fuzz.named import table

    if what != "inputs":
        raise KeyError(what)
    return table()


TABLES = {
    **{kind: partial(study, kind) for kind in STUDIES},
    "named": named,
    "fuzzed": fuzzed,
    "answers": answers,
    "budget": budget,
    "drawn": drawn,
    "causes": causes,
    "wrong": wrong,
    "rooms": rooms,
    "public": public,
    "commands": commands,
    "parameters": parameters,
    "table": table,
}
LINE = re.compile(rf"^<!-- ({'|'.join(TABLES)}) (\w+) -->$", re.MULTILINE)
"""Pattern of a line that requests a table."""


def expressions(page: Path) -> list[str]:
    """What a page, and its line of the index of the verification manual, show of its values."""
    index = VERIFICATION.read_text("utf-8") if page.parent == VERIFICATION.parent else ""
    lines = [line[0] for line in TOPIC.finditer(index) if line[1] == page.stem]
    return NUMBER.findall(page.read_text("utf-8") + "".join(lines))


def with_values(page: Path, text: str) -> str:
    """A page's text with its numbers and tables."""
    if page == VERIFICATION:
        return TOPIC.sub(lambda line: with_values(page.with_name(f"{line[1]}.md"), line[0]), text)
    values = json.loads(page.with_name("values.json").read_text("utf-8")).get(page.stem, {})
    lines = {one: text if isinstance(text, str) else "\n".join(text) for one, text in values.items()}
    return NUMBER.sub(lambda found: lines[found[1]], text)


def fill(app, name, source) -> None:
    """Insert the tables that a page requests."""
    if name.startswith(("verification/", "validation/")):
        source[0] = with_values(DOCS / f"{name}.md", source[0])
    source[0] = LINE.sub(lambda found: TABLES[found[1]](found[2]), source[0])
    source[0] = NAMES.sub(lambda found: ", ".join(f"`{member}`" for member in members(found[1])), source[0])


def setup(app):
    """Register with Sphinx: every page is processed before it is read."""
    app.connect("source-read", fill)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
