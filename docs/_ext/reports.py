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
            target = Path(self.app.outdir) / address
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(page, target)
            _copy_what_it_links_to(page, target.parent)


def _copy_what_it_links_to(page: Path, folder: Path) -> None:
    """Put the files beside a report that its page links to, such as its results, beside the page's copy."""
    for name in set(LINK.findall(page.read_text(encoding="utf-8"))):
        source = (page.parent / name).resolve()
        if page.parent in source.parents and source.is_file() and source != page:
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source, folder / name)


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the transform."""
    app.add_post_transform(Reports)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
