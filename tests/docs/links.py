"""Links of the built site: ``python -m tests.docs.links docs/_build/html`` prints the broken ones."""

import sys
from functools import cache
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit


class Page(HTMLParser):
    """What a page of the site links to, and the names of its places."""

    def __init__(self, path: Path):
        super().__init__()
        self.targets: list[str] = []
        self.places: set[str] = set()
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note the attributes of a tag that are addresses or names."""
        for name, value in attrs:
            if name == "id" or (name == "name" and tag == "a"):
                self.places.add(value or "")
            elif value and (name == "src" or (name == "href" and tag in ("a", "link"))):
                self.targets.append(value)


_page = cache(Page)


def broken(site: Path) -> list[str]:
    """Return ``page: target`` of every link inside a built site that has no file or no place in it."""
    site = site.resolve()
    found = []
    for path in sorted(site.rglob("*.html")):
        if "_static" in path.parts:  # templates of the theme
            continue
        for target in dict.fromkeys(_page(path).targets):
            parts = urlsplit(target)
            if parts.scheme or parts.netloc:
                continue
            goal = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            goal = goal / "index.html" if goal.is_dir() else goal
            place = unquote(parts.fragment)
            known = not place or goal.suffix != ".html"
            if not goal.is_file() or not (known or place in _page(goal).places):
                found.append(f"{path.relative_to(site)}: {target}")
    return found


if __name__ == "__main__":
    lines = broken(Path(sys.argv[1]))
    print("\n".join([*lines, f"{len(lines)} broken links"]))
    sys.exit(bool(lines))
