"""The list of the reports in a directory, with a picture of each."""

import re
from dataclasses import dataclass
from html import escape
from pathlib import Path

from hbvm_bench.report.markdown import plain
from hbvm_bench.store.files import atomic, ensure_writable
from problems.errors import InputError

DOCUMENTS = ("README.md", "report.md")  # what a report is read from
WIDTH = 360  # pixels of a thumbnail
LONGEST = 400  # characters of a description


@dataclass(frozen=True)
class Entry:
    """One report.

    Attributes
    ----------
    folder : str
        Its directory's name.
    title, text : str
        Its heading and its first paragraph.
    command : str
        What makes it.
    picture : str
        Path of its first figure from the list; empty without one.
    documents : list of (str, str)
        Words and paths of what can be opened.
    """

    folder: str
    title: str
    text: str
    command: str
    picture: str
    documents: list[tuple[str, str]]


def write_index(directory: Path) -> Path:
    """Write ``README.md`` in a directory of reports and return its path.

    Raises
    ------
    problems.errors.InputError
        If the directory holds no report, or cannot be written.
    """
    if not directory.is_dir():
        raise InputError(f"the directory {str(directory)!r} does not exist; write a report there first.")
    found = [entry for child in sorted(directory.iterdir()) if (entry := read(child)) is not None]
    if not found:
        raise InputError(f"the directory {str(directory)!r} holds no report; write one there first.")
    ensure_writable(directory)
    target = directory / "README.md"
    with atomic(target) as path:
        path.write_text(text(found, directory), encoding="utf-8")
    return target


def read(folder: Path) -> Entry | None:
    """Read what the list says of a report from the report itself; ``None`` where there is none."""
    name = next((name for name in DOCUMENTS if (folder / name).is_file()), None)
    if name is None:
        return None
    lines = (folder / name).read_text(encoding="utf-8").splitlines()
    title = next((line[2:].strip() for line in lines if line.startswith("# ")), folder.name)
    paragraphs = [line for line in lines if line and line[0] not in "#|!-*<>` \t"]
    first = paragraphs[0] if paragraphs else ""
    if len(first) > LONGEST:
        first = first[: first.rfind(" ", 0, LONGEST)].rstrip(" ,;:") + " …"
    pictures = re.findall(r"!\[[^\]]*\]\(([^)\s]+)\)", "\n".join(lines))
    command = next((line.strip("` ") for line in lines if re.match(r"[` ]*hbvm-bench ", line)), "")
    documents = [("page", f"{folder.name}/index.html")] if (folder / "index.html").is_file() else []
    return Entry(
        folder=folder.name,
        title=title,
        text=first,
        command=command,
        picture=f"{folder.name}/{pictures[0]}" if pictures else "",
        documents=[*documents, ("text", f"{folder.name}/{name}")],
    )


def text(entries: list[Entry], directory: Path) -> str:
    """Return the list as markdown; titles and texts are markdown already."""
    parts = ["# Reports", "Every report is written by the command that it names; nothing in it is by hand."]
    for entry in entries:
        parts.append(f"## [{entry.title}]({entry.documents[-1][1]})")
        if entry.picture:
            size = f'width="{WIDTH}"'
            alt = escape(re.sub(r"\\(.)", r"\1", entry.title), quote=True)
            parts.append(
                f'<a href="{entry.documents[-1][1]}"><img src="{entry.picture}" {size} alt="{alt}"></a>'
            )
        if entry.text:
            parts.append(entry.text)
        links = " · ".join(f"[{words}]({path})" for words, path in entry.documents)
        made_by = f" · made by `{entry.command}`" if entry.command else ""
        parts.append(f"{links}{made_by}")
    again = f"hbvm-bench report --index {plain(directory.resolve().name)}"
    parts.append(f"This list: `{again}`.")
    return "\n\n".join(parts) + "\n"
