"""The documentation as its sources are: its pages, where their links lead, what their cells are."""

import re
import subprocess
from pathlib import Path

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
MADE = {"_build", "made", "api", "reports"}  # folders that a build of the site writes

FENCE = re.compile(r"^(`{3,}|~{3,})(.*?)^\1[ \t]*$", re.MULTILINE | re.DOTALL)
SHOWN = r"(?::(?!tags: \[remove-cell\])[^\n]*\n)"  # an option of a cell that readers see
CELL = re.compile(
    rf"^```\{{code-cell\}}[^\n]*\n(?:---\n.*?\n---\n|{SHOWN}+\n?)?(?!:)(.*?)^```[ \t]*$",
    re.MULTILINE | re.DOTALL,
)
TOCTREE = re.compile(r"^```\{toctree\}\n(.*?)^```", re.MULTILINE | re.DOTALL)
TITLED = re.compile(r"^.* <(.*)>$")  # a page under another title
CARD = re.compile(r"^:link: (\S+)$", re.MULTILINE)
DOC = re.compile(r"\{doc\}`(?:[^`<]*<)?([^`>]+)>?`")
FIGURE = re.compile(r"^```\{figure\} (\S+)", re.MULTILINE)
LINK = re.compile(r"\]\(<?([^)\s>]+)>?\)|(?:href|src)=\"([^\"]+)\"")
HEADING = re.compile(r"^#{1,6} +(.*?) *$", re.MULTILINE)


def sources() -> list[Path]:
    """Return the pages that are in the repository."""
    found = [path for path in DOCS.rglob("*.md") if not MADE & set(path.relative_to(DOCS).parts)]
    return sorted([*found, ROOT / "README.md", ROOT / "CONTRIBUTING.md"])


def links(path: Path) -> list[str]:
    """Return where links and pictures of a page lead, as they are written, without other sites."""
    text = path.read_text(encoding="utf-8")
    prose = re.sub(r"`[^`\n]*`", "", FENCE.sub("", text))
    found = [markdown or html for markdown, html in LINK.findall(prose)] + FIGURE.findall(text)
    return [target for target in found if not re.match(r"[a-z]+:", target)]


def listed(path: Path) -> list[str]:
    """Return the pages that the tables of contents, the cards and the ``{doc}`` roles of a page name."""
    text = path.read_text(encoding="utf-8")
    lines = [
        line for block in TOCTREE.findall(text) for line in block.split("\n") if not line.startswith(":")
    ]
    named = [line.strip() for line in [*lines, *CARD.findall(text), *DOC.findall(text)] if line.strip()]
    named = [name for name in named if not name.endswith("*")]  # pages that a build of the site writes
    return [TITLED.sub(r"\1", name) for name in named]


def page(name: str, source: Path) -> Path:
    """Return the page that another one names, from its own folder, or from the top after a slash."""
    return (DOCS / f"{name[1:]}.md" if name.startswith("/") else source.parent / f"{name}.md").resolve()


def clicks(path: Path) -> set[Path]:
    """Return the pages of the site that one click on a page opens."""
    opened = {page(name, path) for name in listed(path)}
    opened |= {(path.parent / target.partition("#")[0]).resolve() for target in links(path)}
    return {target for target in opened if target.suffix == ".md" and DOCS in target.parents}


def anchors(path: Path) -> set[str]:
    """Return the names that the headings of a page have in addresses."""
    seen: dict[str, int] = {}
    for heading in HEADING.findall(FENCE.sub("", path.read_text(encoding="utf-8"))):
        words = re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", heading).lower()
        slug = re.sub(r"[^\w\- ]", "", words).replace(" ", "-")
        seen[slug] = seen.get(slug, 0) + 1
    return {f"{slug}-{i}" if i else slug for slug, count in seen.items() for i in range(count)}


def cells(path: Path) -> list[str]:
    """Return the code of the cells of a page that readers see, in order."""
    return CELL.findall(path.read_text(encoding="utf-8"))


def plain(cell: str) -> str:
    """Return a cell in plain Python: files and shells by functions, without settings of notebooks."""
    first, _, rest = cell.partition("\n")
    if first.startswith("%%writefile "):
        return f"_write({first.split()[1]!r}, {rest!r})"
    lines = [line for line in cell.splitlines() if not line.startswith("%")]
    return "\n".join(f"_shell({line[1:]!r})" if line.startswith("!") else line for line in lines)


def shell(line: str) -> None:
    """Run a line for a shell, and print what it prints."""
    done = subprocess.run(
        line, shell=True, check=False, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT
    )
    print(done.stdout)
    assert done.returncode == 0, f"{line}: exit code {done.returncode}\n{done.stdout}"


def write(name: str, text: str) -> None:
    """Write a file that a cell of a page writes."""
    Path(name).write_text(text, encoding="utf-8")
