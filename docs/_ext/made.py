"""Pages that are generated from the package at every build: commands, metrics, gallery and others."""

import ast
import re
from pathlib import Path

import typer.cli
import typer.main
from sphinx.application import Sphinx

from hbvm_bench.campaign.file import load, shipped
from hbvm_bench.commands import app, listing
from hbvm_bench.measure.metrics import METRICS

EXAMPLES = Path(__file__).parents[2] / "examples"
FIELDS = {
    "Celestial mechanics": (
        "bodies", "long_run", "long_runs", "encounters", "star_cluster", "radial_velocities", "geodesics",
    ),
    "Molecules": ("molecular_dynamics", "molecular_dynamics_sizes", "water"),
    "Lattices and partial differential equations": ("lattice", "grids"),
    "Mechanics": (
        "own_system", "linkages", "rattle", "squeezer", "mass_matrix", "impacts", "bouncing_ball",
        "measured_forcing", "fit",
    ),
    "Chaos": ("section", "exponents", "chaos_map", "ensemble", "short"),
    "Stiff chemistry": ("stiff",),
    "Programs": ("plugin", "solution", "scaling", "campaign", "own_campaign"),
}  # fmt: skip

REPORT = re.compile(r"^## \[(.+)\]\((\S+)\)$")
THUMBNAIL = re.compile(r'^<a href="[^"]*"><img src="([^"]*)".*$')
PROBLEM = re.compile(r"^# (\w+)\n\n!\[([^]]*)\]\(\w+\.svg\)\n\n([^\n]+)$", re.MULTILINE)


def commands() -> str:
    """Return what every command says of itself under ``--help``."""
    app.attach()
    command = typer.main.get_command(app.app)
    context = command.make_context("hbvm-bench", [], resilient_parsing=True)
    text = typer.cli.get_docs_for_click(obj=command, ctx=context, name="hbvm-bench", title="Commands")
    return text.replace("```console", "```sh")


def metrics() -> str:
    """Return the one table of metrics, as `hbvm-bench list metrics` prints it."""
    rows = [
        f"| `{metric.key}` | {metric.unit or '–'} | {metric.better or '–'} | {metric.description} |"
        for metric in METRICS.values()
    ]
    return "\n".join(["| metric | unit | better | what |", "|:--|:--|:--|:--|", *rows, ""])


def campaigns() -> str:
    """Return a table of the campaigns that come with the package."""
    rows = [f"| `{name}` | {load(name).title} |" for name in shipped()]
    return "\n".join(["| campaign | what it compares |", "|:--|:--|", *rows, ""])


def citations() -> str:
    """Return how authors ask to be cited, as `hbvm-bench cite` prints it."""
    return "\n\n".join(["```bibtex", *listing.citations(()), "```", ""])


def examples() -> str:
    """Return the scripts in `examples`, by field, with what each says of itself."""
    made = []
    for field, names in FIELDS.items():
        made.append(f"## {field}\n")
        for name in names:
            text = ast.get_docstring(ast.parse((EXAMPLES / f"{name}.py").read_text(encoding="utf-8"))) or ""
            made.append(
                f"- [{name}.py](../../examples/{name}.py): {' '.join(text.partition(chr(10) * 2)[0].split())}"
            )
        made.append("")
    return "\n".join(made)


def reports() -> str:
    """Return the list of reports in `reports/README.md`, with links from a page of the site's root."""
    text = (Path(__file__).parents[2] / "reports" / "README.md").read_text(encoding="utf-8")
    made, title, place = [], "", ""
    for line in text.splitlines():
        if found := REPORT.match(line):
            title, place = found[1], f"../reports/{found[2]}"
            made.append(f"## [{title}]({place})")
        elif found := THUMBNAIL.match(line):
            picture = f":width: 560px\n:alt: {title}\n:target: reports/{place.split('/')[2]}.html"
            made.append(f"```{{image}} ../reports/{found[1]}\n{picture}\n```")
        elif title:  # what is before the first report says how the list itself is made
            made.append(re.sub(r"\[text\]\(\S+\)( · )?", "", line))
    return "\n".join(line for line in made if not line.startswith("This list:")) + "\n"


def gallery() -> str:
    """Return a card for each problem, with its picture and the first sentence of its page."""
    pages = sorted((Path(__file__).parents[1] / "problems").glob("*.md"))
    cards = [
        f":::{{grid-item-card}} {name}\n:link: ../problems/{name}.html\n:link-type: url\n"
        f":img-top: ../problems/{name}.svg\n:img-alt: {alternative}\n\n{summary}\n:::"
        for page in pages
        for name, alternative, summary in PROBLEM.findall(page.read_text(encoding="utf-8"))
    ]
    return "\n\n".join(["::::{grid} 1 2 3 3\n:gutter: 3", *cards, "::::", ""])


def _write(app: Sphinx) -> None:
    made = Path(app.srcdir) / "reference" / "made"
    made.mkdir(parents=True, exist_ok=True)
    for make in (commands, metrics, campaigns, citations, examples, reports, gallery):
        path, text = made / f"{make.__name__}.md", make()
        if not path.is_file() or path.read_text(encoding="utf-8") != text:  # else Sphinx reads it again
            path.write_text(text, encoding="utf-8")


def setup(app: Sphinx) -> dict[str, bool]:
    """Write the pages before Sphinx looks for them."""
    app.connect("builder-inited", _write)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
