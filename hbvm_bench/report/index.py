"""The reports in a directory: the page of each, drawn from what is stored, and their list."""

import re
from collections.abc import Iterator, Sequence
from html import escape
from pathlib import Path

from jinja2 import TemplateError

from hbvm_bench.campaign.file import load, shipped
from hbvm_bench.measure import machine
from hbvm_bench.report import provenance
from hbvm_bench.report.markdown import plain, printed
from hbvm_bench.report.page import page_in
from hbvm_bench.report.template import NAME, environment
from hbvm_bench.report.write import TEXT, write
from hbvm_bench.store.files import write_all
from hbvm_bench.store.records import Record, machine_of
from hbvm_bench.store.store import PACKED, Store
from hbvm_bench.summaries import outcomes
from hbvm_bench.summaries.table import Table
from problems.errors import InputError

PLAIN = "# Reports\n\n{% for name in names %}{{ entry(name) }}\n\n{% endfor %}"
WIDTH = 560  # pixels of a figure
LONGEST = 600  # characters of what the list says of a report, in whole sentences
CHECKS = ("smoke", "outer-solar-system")  # campaigns that have no report


def write_pages(directory: Path) -> Iterator[Path]:
    """Draw every report in a directory from its stored rows, and yield the path of its page.

    A folder in a report's with results that the report is composed of has a page with all of its rows.
    """
    for folder in sorted({path.parent for name in (PACKED, NAME) for path in directory.glob(f"**/{name}")}):
        if folder != directory:
            yield write(page_in(folder), folder)[1]


def write_index(directory: Path) -> Path:
    """Write ``README.md`` in a directory of reports and return its path.

    ``page.md`` there is its template, in which ``{{ entry("NAME") }}`` is what is said of a report; without
    one all reports are listed.

    Raises
    ------
    problems.errors.InputError
        If the directory holds no report, or cannot be written.
    """
    if not directory.is_dir():
        raise InputError(f"the directory {str(directory)!r} does not exist; write a report there first.")
    names = [folder.name for folder in sorted(directory.iterdir()) if (folder / TEXT).is_file()]
    if not names:
        raise InputError(f"the directory {str(directory)!r} holds no report; write one there first.")
    page = directory / NAME
    text = page.read_text(encoding="utf-8") if page.is_file() else PLAIN
    try:
        template = environment(directory).from_string(text)
        made = template.render(names=names, entry=lambda name: _entry(directory / name)).strip()
    except (TemplateError, OSError) as error:
        raise InputError(f"the list {str(page)!r} cannot be made: {' '.join(str(error).split())}.") from error
    parts = [made, "## When and where each was measured", printed(conditions(directory))]
    if missing := not_measured(directory):
        parts += ["## Not measured", "\n".join(f"- {plain(item)}" for item in missing)]
    again = f"hbvm-bench report --index {plain(directory.resolve().name)}"
    write_all({directory / "README.md": ("\n\n".join([*parts, f"This list: `{again}`."]) + "\n").encode()})
    return directory / "README.md"


def conditions(directory: Path) -> Table:
    """Return the date, the kernel, the processor and the other work of all stored results.

    Results of several kinds of processor have a row for each.
    """
    rows = []
    for path in sorted(directory.glob(f"**/{PACKED}")):
        runs = [run.records() for run in Store(path).runs()]
        name = path.parent.relative_to(directory).as_posix()
        rows += [(name, *_measured(records)) for records in runs if records]
    return Table(
        "",
        ("results", "date", "processor", "kernel", "other processes", "host"),
        rows,
        "Kernel: the first digits of the digest of its sources, without comments. Other processes, host: "
        "the share of a core that they used while the times of each problem were taken, from the "
        "smallest to the largest.",
        words=range(6),
        key="conditions",
    )


def not_measured(directory: Path) -> list[str]:
    """Return the campaigns of the package without results here."""
    there = {path.parent.name for path in directory.glob(f"**/{PACKED}")}
    return [f"{name}: {load(name).title}" for name in shipped() if name not in CHECKS and name not in there]


def _measured(records: Sequence[Record]) -> tuple[str, ...]:
    described = machine_of(records)
    names = dict.fromkeys((str(described.get("processor", "unknown")), machine.kind(described)))
    kernels = sorted({record.kernel[: provenance.DIGITS] for record in records if record.kernel})
    return (
        provenance.days(records),
        ", ".join(names),
        " and ".join(kernels) or "not recorded",
        *outcomes.shares(records),
    )


def _entry(folder: Path) -> str:
    """Return what the list says of a report, as Markdown: its title, its first figure and paragraph."""
    lines = (folder / TEXT).read_text(encoding="utf-8").splitlines()
    title = next((line[2:].strip() for line in lines if line.startswith("# ")), folder.name)
    first = next((line for line in lines if line and line[0] not in "#|!-*<>` \t"), "")
    if len(first) > LONGEST:
        first = first[: max(first.rfind(". ", 0, LONGEST), first.find(". ")) + 1] + " …"
    place = f"{folder.name}/{TEXT}"
    parts = [f"## [{title}]({place})"]
    if pictures := re.findall(r"!\[[^\]]*\]\(([^)\s]+)\)", "\n".join(lines)):
        alt, source = escape(re.sub(r"\\(.)", r"\1", title), quote=True), f"{folder.name}/{pictures[0]}"
        parts.append(f'<a href="{place}"><img src="{source}" width="{WIDTH}" alt="{alt}"></a>')
    return "\n\n".join([*parts, first] if first else parts)
