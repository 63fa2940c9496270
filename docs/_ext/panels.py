"""On a phone the panels of a figure stand below each other: views of the same file, column by column."""

import re
from itertools import pairwise
from pathlib import Path

from sphinx.application import Sphinx

BOX = re.compile(
    r'<clipPath id="[^"]*">\s*<rect x="([\d.]+)" y="([\d.]+)" width="([\d.]+)" height="([\d.]+)"'
)  # matplotlib clips what is drawn to the panel
SIZE = re.compile(r'viewBox="0 0 ([\d.]+) ([\d.]+)"')
IMAGE = re.compile(r'<img ([^>]*src="([^"]*_images/([^"/]+\.svg))"[^>]*)>')
GAP, LABELS = 6.0, 34.0  # from a panel to the labels of the next one; height of those below it
NARROW = 0.15  # part of the figure's width below which a panel is a scale of colours
LEGEND = 0.2  # part of the width or height beyond the panels that is a legend

View = tuple[float, float, float, float]


def views(drawing: str) -> list[View]:
    """Return left, top, width and height of each column of panels, and of the legend beside or below them."""
    size = SIZE.search(drawing)
    boxes = sorted({tuple(map(float, box)) for box in BOX.findall(drawing)})
    if size is None or not boxes:
        return []
    width, height = float(size[1]), float(size[2])
    rights: list[float] = []
    for left, _, wide, _ in boxes:
        if rights and (wide < NARROW * width or left < rights[-1]):
            rights[-1] = max(rights[-1], left + wide)
        elif wide >= NARROW * width:
            rights.append(left + wide)
    if len(rights) < 2:
        return []
    bottom = max(y + high for _, y, _, high in boxes) + LABELS
    below = height - bottom > LEGEND * height
    edges = [0.0, *(right + GAP for right in rights)]
    if width - rights[-1] < LEGEND * width:
        edges.pop()
    edges.append(width)
    found = [(a, 0.0, b - a, bottom if below else height) for a, b in pairwise(edges)]
    return [*found, (0.0, bottom, width, height - bottom)] if below else found


def _stack(app: Sphinx, error: Exception | None) -> None:
    """Put the views behind each figure with several columns, for the style sheet to choose."""
    if error or app.builder.format != "html":
        return
    found = {
        path.name: made
        for path in (Path(app.outdir) / "_images").glob("*.svg")
        if (made := views(path.read_text(encoding="utf-8")))
    }

    def stacked(image: re.Match[str]) -> str:
        if image[3] not in found:
            return image[0]
        shown = "".join(
            f'<img class="panel" alt="" loading="lazy" style="aspect-ratio: {w:.0f} / {h:.0f}" '
            f'src="{image[2]}#svgView(viewBox({x:.0f},{y:.0f},{w:.0f},{h:.0f}))">'
            for x, y, w, h in found[image[3]]
        )
        return f'<span class="whole">{image[0]}</span>{shown}'

    for path in Path(app.outdir).rglob("*.html"):
        page = path.read_text(encoding="utf-8")
        if "_images/" in page and 'class="panel"' not in page:
            path.write_text(IMAGE.sub(stacked, page), encoding="utf-8")


def setup(app: Sphinx) -> dict[str, bool]:
    """Act after the build."""
    app.connect("build-finished", _stack)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
