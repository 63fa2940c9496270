"""What is made of the reports in a directory: the page of each, and their list with a picture of each."""

import re
from collections.abc import Iterator, Sequence
from html import escape
from pathlib import Path

from hbvm_bench.campaign.file import load, shipped
from hbvm_bench.measure import machine
from hbvm_bench.report import provenance
from hbvm_bench.report.html import pages
from hbvm_bench.report.markdown import plain, printed
from hbvm_bench.report.page import document
from hbvm_bench.store.files import write_all
from hbvm_bench.store.records import Record
from hbvm_bench.store.store import PACKED, Store
from hbvm_bench.store.stored_run import StoredRun
from hbvm_bench.summaries import outcomes
from hbvm_bench.summaries.table import Table
from problems.errors import InputError

DOCUMENTS = ("README.md", "report.md")  # what a report is read from
LEAD = (
    "Every report is written by the command that it names; nothing in it is written by hand. A text "
    "(`report.md` or "
    "`README.md`) with its figures is committed beside the results that it is made from. The pages, "
    "`NAME/index.html` with all figures and all rows, are drawn from these results by `make pages`, without "
    "running anything; git ignores them, except that of sitnikov."
)
WIDTH = 360  # pixels of a thumbnail
LONGEST = 400  # characters of a description
CHECKS = ("smoke",)  # campaigns that ask whether everything works, and have no report
RACE, AVX2 = "race", "-avx2"  # how the kind of a processor ends, where code was restricted to AVX2


def write_pages(directory: Path) -> Iterator[Path]:
    """Draw ``index.html`` of every report in a directory from its stored rows, and yield its path.

    Raises
    ------
    problems.errors.InputError
        If what is stored is damaged, or a directory cannot be written.
    """
    for folder in sorted(path for path in directory.iterdir() if path.is_dir()):
        if (folder / PACKED).is_file():
            path = folder / "index.html"
            files = pages(document(Store(folder / PACKED).runs(), folder), folder)
            write_all({folder / name: text.encode() for name, text in files.items()})
            yield path


def write_index(directory: Path) -> Path:
    """Write ``README.md`` in a directory of reports and return its path.

    Raises
    ------
    problems.errors.InputError
        If the directory holds no report, or cannot be written.
    """
    if not directory.is_dir():
        raise InputError(f"the directory {str(directory)!r} does not exist; write a report there first.")
    parts = [part for folder in sorted(directory.iterdir()) for part in _entry(folder)]
    if not parts:
        raise InputError(f"the directory {str(directory)!r} holds no report; write one there first.")
    again = f"hbvm-bench report --index {plain(directory.resolve().name)}"
    measured = ["## When and where each was measured", printed(conditions(directory))]
    if missing := not_measured(directory):
        measured += ["## Not measured", "\n".join(f"- {plain(item)}" for item in missing)]
    text = "\n\n".join(["# Reports", LEAD, *parts, *measured, f"This list: `{again}`."]) + "\n"
    write_all({directory / "README.md": text.encode()})
    return directory / "README.md"


def conditions(directory: Path) -> Table:
    """Return the date, the kernel, the processor and the other work of every report, from stored results.

    A report with results of several kinds of processor has a row for each.

    Raises
    ------
    problems.errors.InputError
        If what is stored is damaged.
    """
    rows = []
    for folder in sorted(path for path in directory.iterdir() if _document(path)):
        if not (folder / PACKED).is_file():
            rows.append((folder.name, *["not recorded"] * 5))
            continue
        runs = [run.records() for run in Store(folder / PACKED).runs()]
        rows += [(folder.name, *_measured(records)) for records in runs if records]
    return Table(
        "",
        ("report", "date", "processor", "kernel", "other processes", "host"),
        rows,
        "Kernel: the first digits of the digest of its sources, without comments. Other processes, host: "
        "the share of a core that they used while the times of each problem were taken, from the "
        "smallest to the largest.",
        words=range(6),
        key="conditions",
    )


def not_measured(directory: Path) -> list[str]:
    """Return the campaigns of the package without a report here, and the problems of the race without AVX2.

    Raises
    ------
    problems.errors.InputError
        If what is stored is damaged.
    """
    missing = [
        f"{name}: {load(name).title}"
        for name in shipped()
        if name not in CHECKS and not _document(directory / name)
    ]
    if _document(directory / RACE):
        everywhere, on_avx2 = _race_problems(directory / RACE / PACKED)
        without = [problem for problem in everywhere if problem not in on_avx2]
        if without or not on_avx2:
            which = f": {', '.join(without)}" if on_avx2 else ""
            missing.append(f"{RACE} --avx2: {load(RACE).title}, with AVX2 only{which}")
    return missing


def _race_problems(path: Path) -> tuple[list[str], list[str]]:
    """Return the problems with results in a report, without and with code restricted to AVX2."""
    problems: tuple[list[str], list[str]] = ([], [])
    for run in Store(path).runs() if path.is_file() else []:
        if records := run.records():
            restricted = machine.kind(StoredRun.machine_of(records)).endswith(AVX2)
            problems[restricted].extend(dict.fromkeys(record.case.problem for record in records))
    return problems


def _measured(records: Sequence[Record]) -> tuple[str, ...]:
    described = StoredRun.machine_of(records)
    names = dict.fromkeys((str(described.get("processor", "unknown")), machine.kind(described)))
    kernels = sorted({record.kernel[: provenance.DIGITS] for record in records if record.kernel})
    return (
        provenance.days(records),
        ", ".join(names),
        " and ".join(kernels) or "not recorded",
        *outcomes.shares(records),
    )


def _document(folder: Path) -> str:
    """Return the name of a report's text; empty where there is none."""
    return next((name for name in DOCUMENTS if (folder / name).is_file()), "")


def _entry(folder: Path) -> list[str]:
    """Return what the list says of a report, read from the report itself, as paragraphs of markdown."""
    if not (name := _document(folder)):
        return []
    lines = (folder / name).read_text(encoding="utf-8").splitlines()
    title = next((line[2:].strip() for line in lines if line.startswith("# ")), folder.name)
    first = next((line for line in lines if line and line[0] not in "#|!-*<>` \t"), "")
    if len(first) > LONGEST:
        first = first[: first.rfind(" ", 0, LONGEST)].rstrip(" ,;:") + " …"
    place = f"{folder.name}/{name}"
    lines_ = [f"## [{title}]({place})"]
    if pictures := re.findall(r"!\[[^\]]*\]\(([^)\s]+)\)", "\n".join(lines)):
        alt, source = escape(re.sub(r"\\(.)", r"\1", title), quote=True), f"{folder.name}/{pictures[0]}"
        lines_.append(f'<a href="{place}"><img src="{source}" width="{WIDTH}" alt="{alt}"></a>')
    command = next((line.strip("` ") for line in lines if re.match(r"[` ]*hbvm-bench ", line)), "")
    links = [f"[text]({place})", *([f"made by `{command}`"] if command else [])]
    return [*lines_, *([first] if first else []), " · ".join(links)]
