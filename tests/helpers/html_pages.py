"""What a browser would load, link and name in a page, and its text without the figures."""

import re
from html.parser import HTMLParser


class Page(HTMLParser):
    """What a browser would load, link and name."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.tags: set[str] = set()
        self.ids: list[str] = []
        self.references: list[str] = []
        self.loads: list[str] = []
        self.inside_svg = 0
        self.text = ""
        self.feed(html)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.add(tag)
        self.inside_svg += tag in ("svg", "style")
        for key, value in attrs:
            value = value or ""
            if key == "id":
                self.ids.append(value)
            elif key in ("href", "xlink:href", "aria-labelledby"):
                self.references.append(value.removeprefix("#"))
            elif key in ("src", "srcset", "data", "action", "poster", "background") or key.startswith("on"):
                self.loads.append(f"{tag} {key}={value}")
            self.references += re.findall(r"url\(#([^)]*)\)", value)
            assert not re.search(r"url\((?!#)", value)

    def handle_endtag(self, tag: str) -> None:
        self.inside_svg -= tag in ("svg", "style")

    def handle_data(self, data: str) -> None:
        if not self.inside_svg:
            self.text += data + " "
