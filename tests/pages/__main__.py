"""`python -m tests.pages OUT`: a page of every type in OUT, made by commands of tests and from synthetic
results.

`--audit FOLDER` looks at each of them, and at further pages that are named, in Chromium, light and dark, 390
and 1280 px wide and on A4: pictures in OUT, axe-core, html-validate, errors, overflow; exit 1 if anything is
found. FOLDER has `npm install axe-core html-validate puppeteer-core` behind it; CHROMIUM names the browser.
"""

import argparse
import os
import subprocess
import sys
from pathlib import Path

from tests.pages.made import RENDERED, by_commands


def main(words: list[str]) -> int:
    """Make the pages and audit them."""
    parser = argparse.ArgumentParser(prog="python -m tests.pages", description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("more", type=Path, nargs="*", help="pages that are there already")
    parser.add_argument("--audit", type=Path, help="folder with node_modules")
    parser.add_argument("--made", action="store_true", help="the pages are in OUT already")
    options = parser.parse_intermixed_args(words)
    options.out.mkdir(parents=True, exist_ok=True)
    if not options.made:
        for name, render in RENDERED.items():
            (options.out / f"{name}.html").write_text(render(), encoding="utf-8")
        by_commands(options.out)
    if options.audit is None:
        return 0
    pages = [*sorted(options.out.glob("*.html")), *options.more]
    node = {**os.environ, "NODE_PATH": str((options.audit / "node_modules").resolve())}
    script = Path(__file__).with_name("audit.js")
    return subprocess.run(["node", script, options.out, *pages], env=node, check=False).returncode


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
