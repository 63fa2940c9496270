"""Pages that are made from the package itself at every build: commands, metrics, campaigns, citations."""

from pathlib import Path

import typer.cli
import typer.main
from sphinx.application import Sphinx

from hbvm_bench.campaign.file import load, shipped
from hbvm_bench.commands import app, listing
from hbvm_bench.measure.metrics import METRICS


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


def _write(app: Sphinx) -> None:
    made = Path(app.srcdir) / "reference" / "made"
    made.mkdir(parents=True, exist_ok=True)
    for make in (commands, metrics, campaigns, citations):
        path, text = made / f"{make.__name__}.md", make()
        if not path.is_file() or path.read_text(encoding="utf-8") != text:  # else Sphinx reads it again
            path.write_text(text, encoding="utf-8")


def setup(app: Sphinx) -> dict[str, bool]:
    """Write the pages before Sphinx looks for them."""
    app.connect("builder-inited", _write)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
