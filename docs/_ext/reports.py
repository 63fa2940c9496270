"""Links to the reports of the repository: to their pages, which are put beside the site."""

import os
import re
import shutil
from pathlib import Path

from docutils import nodes
from sphinx import addnodes
from sphinx.application import Sphinx
from sphinx.transforms.post_transforms import SphinxPostTransform
from sphinx.util.osutil import relative_uri

BRAND = '<span class="brand">hbvm-bench</span>'
WAYS = """<a class="brand" href="../../index.html">hbvm-bench</a>
<nav aria-label="Site">
<a href="../../reports.html">All reports</a>
<a href="../../howto/reading_a_report.html">How to read a report</a>
</nav>"""
OUT = re.compile(r'<nav class="ways" aria-label="All reports">.*?</nav>', re.DOTALL)  # of local pages
LINK = re.compile(r'href="([\w./-]+)"')


class Reports(SphinxPostTransform):
    """Turn a link to a report's text into one to its page, before MyST looks for a page of the site."""

    default_priority = 5
    formats = ("html",)

    def run(self, **_: object) -> None:
        for node in list(self.document.findall(addnodes.pending_xref)):
            if node.get("refdomain") != "doc":
                continue
            page = Path(os.path.normpath(Path(self.env.srcdir, node["reftarget"]))).parent / "index.html"
            top = Path(self.env.srcdir).parent
            if top / "reports" not in page.parents or not page.is_file():
                continue
            address = page.relative_to(top)
            here = self.app.builder.get_target_uri(self.env.docname)
            link = nodes.reference("", "", *node.children, refuri=relative_uri(here, address.as_posix()))
            node.replace_self(link)
            _copy(page, (Path(self.app.outdir) / address).parent, set())


def _copy(page: Path, folder: Path, done: set[Path]) -> None:
    """Put a report's page, with links to the site, into a folder, and the files beside it that it uses."""
    done.add(page)
    folder.mkdir(parents=True, exist_ok=True)
    text = OUT.sub("", page.read_text(encoding="utf-8"), count=1)
    (folder / page.name).write_text(text.replace(BRAND, WAYS, 1), encoding="utf-8")
    for name in set(LINK.findall(text)):
        source = (page.parent / name).resolve()
        if source.parent != page.parent or not source.is_file() or source in done:
            continue
        if source.suffix == ".html":
            _copy(source, folder, done)
        else:
            shutil.copyfile(source, folder / name)


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the transform."""
    app.add_post_transform(Reports)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
