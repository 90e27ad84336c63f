"""Numbers and tables of a page of docs/verification or docs/validation.

In the page's text ``{{ expression:format }}`` is a number or a table. The text that it becomes stands in
values.json of the page's folder, from where the documentation takes it (docs/_ext/made_tables.py).
"""

import json
import sys
from pathlib import Path
from typing import Any

DOCS = Path(__file__).resolve().parents[2] / "docs"
sys.path.append(str(DOCS / "_ext"))
import made_tables  # noqa: E402


def evaluated(page: Path, names: dict[str, Any]) -> dict[str, str | list[str]]:
    """By expression, its text: lines if there are several."""
    texts = {one: eval(f'f"""{{{one}}}"""', names) for one in made_tables.expressions(page)}
    return {one: text.split("\n") if "\n" in text else text for one, text in texts.items()}


def stored(page: Path) -> dict[str, str | list[str]]:
    """The same as committed."""
    return dict(json.loads(page.with_name("values.json").read_text("utf-8"))[page.stem])


def store(page: Path, names: dict[str, Any]) -> None:
    """Evaluate a page's expressions with these names, and write them to values.json."""
    path = page.with_name("values.json")
    values = json.loads(path.read_text("utf-8")) | {page.stem: evaluated(page, names)}
    path.write_text(json.dumps(values, ensure_ascii=False, indent=1) + "\n", "utf-8")
    print(page)
