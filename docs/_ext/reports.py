"""The reports as pages of the site: their texts, and beside it their own pages with all rows."""

import os
import re
import shutil
from pathlib import Path

from sphinx import addnodes
from sphinx.application import Sphinx
from sphinx.transforms.post_transforms import SphinxPostTransform

REPORTS = Path(__file__).parents[2] / "reports"
FIGURE = re.compile(r"^!\[(.*)\]\((figures/[^)]+)\)$", re.MULTILINE)
WIDE = r"```{{figure}} ../../reports/{name}/\2\n:figclass: wide\n:alt: \1\n```"  # scrolls on a phone
RESULTS = re.compile(r"\]\(((?:[\w-]+/)?)results\.sqlite\.xz\)")
TABLES = "rows"
"""The folder of the built site with the reports' own pages, which `hbvm-bench report` draws."""

BRAND = '<span class="brand">hbvm-bench</span>'
WAYS = """<a class="brand" href="../../index.html">hbvm-bench</a>
<nav aria-label="Site">
<a href="../../reports.html">All reports</a>
<a href="../../howto/reading_a_report.html">How to read a report</a>
</nav>"""
FILES = ("*.svg", "*.xz")


def texts() -> dict[str, Path]:
    """Return the text of each report by the name of its folder."""
    return {path.parent.name: path for path in sorted(REPORTS.glob("*/report.md"))}


def _write(app: Sphinx) -> None:
    """Write a page of the site for each report."""
    folder = Path(app.srcdir) / "reports"
    folder.mkdir(exist_ok=True)
    for name, path in texts().items():
        title, _, rest = path.read_text(encoding="utf-8").partition("\n")
        if (path.parent / "index.html").is_file():
            page = f"../{TABLES}/{name}/index.html"
            title += f'\n\n<a href="{page}">Sortable tables, all figures and all rows of this report</a>'
        text = FIGURE.sub(WIDE.format(name=name), f"{title}\n{rest}")
        text = RESULTS.sub(rf"](../../reports/{name}/\1results.sqlite.xz)", text)
        page = folder / f"{name}.md"
        if not page.is_file() or page.read_text(encoding="utf-8") != text:  # else Sphinx reads it again
            page.write_text(text, encoding="utf-8")


class Reports(SphinxPostTransform):
    """Turn a link to a report's text into one to its page, before MyST looks for a page of the site."""

    default_priority = 5

    def run(self, **_: object) -> None:
        for node in self.document.findall(addnodes.pending_xref):
            if node.get("refdomain") == "doc":
                text = Path(os.path.normpath(Path(self.env.srcdir, f"{node['reftarget']}.md")))
                if text in texts().values():
                    node["reftarget"] = f"reports/{text.parent.name}"


def _copy(app: Sphinx, error: Exception | None) -> None:
    """Put the reports' own pages, with links to the site, into it, and the files beside them."""
    if error or app.builder.format != "html":
        return
    for name, path in texts().items():
        folder = Path(app.outdir) / TABLES / name
        folder.mkdir(parents=True, exist_ok=True)
        for page in path.parent.rglob("*.html"):  # a report may be composed of others, below it
            below = page.relative_to(path.parent)
            (folder / below).parent.mkdir(parents=True, exist_ok=True)
            ways = WAYS.replace('href="', 'href="' + "../" * (len(below.parts) - 1))
            text = page.read_text(encoding="utf-8").replace(BRAND, ways, 1)
            (folder / below).write_text(text, encoding="utf-8")
        for file in (file for pattern in FILES for file in path.parent.rglob(pattern)):
            (folder / file.relative_to(path.parent)).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(file, folder / file.relative_to(path.parent))


def setup(app: Sphinx) -> dict[str, bool]:
    """Act before Sphinx looks for pages, at links, and after the build."""
    app.connect("builder-inited", _write)
    app.add_post_transform(Reports)
    app.connect("build-finished", _copy)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
