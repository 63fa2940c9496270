"""The documentation as its sources are: which pages there are, where their links lead, what their cells run."""

import re
import subprocess
import sys
from pathlib import Path
from types import ModuleType

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
MADE = ("_build", "made", "api")  # folders that a build of the site writes

FENCE = re.compile(r"^(`{3,}|~{3,})(.*?)^\1[ \t]*$", re.MULTILINE | re.DOTALL)
CELL = re.compile(r"^```\{code-cell\}[^\n]*\n(?:---\n.*?\n---\n|(?::[^\n]*\n)+)?(.*?)^```[ \t]*$", re.MULTILINE | re.DOTALL)
TOCTREE = re.compile(r"^```\{toctree\}\n(.*?)^```", re.MULTILINE | re.DOTALL)
CARD = re.compile(r"^:link: (\S+)$", re.MULTILINE)
DOC = re.compile(r"\{doc\}`(?:[^`<]*<)?([^`>]+)>?`")
LINK = re.compile(r"\]\(<?([^)\s>]+)>?\)|(?:href|src)=\"([^\"]+)\"")
HEADING = re.compile(r"^#{1,6} +(.*?) *$", re.MULTILINE)


def sources() -> list[Path]:
    """Return the pages that are written by hand or kept, in the repository."""
    found = [path for path in DOCS.rglob("*.md") if not set(path.relative_to(DOCS).parts) & set(MADE)]
    return sorted([*found, ROOT / "README.md", ROOT / "CONTRIBUTING.md"])


def prose(path: Path) -> str:
    """Return a page without its code."""
    return re.sub(r"`[^`\n]*`", "", FENCE.sub("", path.read_text(encoding="utf-8")))


def links(path: Path) -> list[str]:
    """Return where the links and pictures of a page lead, as they are written, without those to other sites."""
    found = [a or b for a, b in LINK.findall(prose(path))]
    return [target for target in found if not re.match(r"[a-z]+:", target)]


def anchors(path: Path) -> set[str]:
    """Return the names that headings have in addresses."""
    found: dict[str, int] = {}
    made = set()
    for heading in HEADING.findall(FENCE.sub("", path.read_text(encoding="utf-8"))):
        words = re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", heading).lower()
        slug = re.sub(r"[^\w\- ]", "", words).replace(" ", "-")
        seen = found[slug] = found.get(slug, -1) + 1
        made.add(f"{slug}-{seen}" if seen else slug)
    return made


def clicks(path: Path) -> set[Path]:
    """Return the pages that one click on a page opens: links, cards, the tables of contents."""
    text = path.read_text(encoding="utf-8")
    lines = [line for block in TOCTREE.findall(text) for line in block.splitlines() if not line.startswith(":")]
    named = [f"{line.strip()}.md" for line in [*lines, *CARD.findall(text), *DOC.findall(text)] if line.strip()]
    written = [target.partition("#")[0] for target in links(path)]
    opened = [(path.parent / target).resolve() for target in [*named, *written] if target]
    return {target for target in opened if target.suffix == ".md" and target.is_file() and DOCS in target.parents}


def cells(path: Path) -> list[str]:
    """Return the code of a page's cells, in order."""
    return CELL.findall(path.read_text(encoding="utf-8"))


def run(path: Path) -> None:
    """Run the cells of a page in order, in one name space, as a notebook does."""
    module = sys.modules["page"] = ModuleType("page")  # where pickle finds what the page defines
    vars(module).update(_shell=shell, _write=write)
    try:
        for number, cell in enumerate(cells(path), 1):
            exec(compile(plain(cell), f"{path.name}, cell {number}", "exec"), vars(module))  # noqa: S102
    finally:
        del sys.modules["page"]


def shell(line: str) -> None:
    """Run a line of a page that is for a shell, and print what it prints."""
    program = f"'{sys.executable}' -m hbvm_bench.cli"
    done = subprocess.run(
        re.sub(r"^hbvm-bench\b", lambda _: program, line),
        shell=True, check=False, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
    )  # fmt: skip
    print(done.stdout)
    assert done.returncode == 0, f"{line}: exit code {done.returncode}\n{done.stdout}"


def write(name: str, text: str) -> None:
    """Write a file that a cell of a page writes."""
    Path(name).write_text(text, encoding="utf-8")


def plain(cell: str) -> str:
    """Return a cell in plain Python: files and lines for a shell by functions, without settings of notebooks."""
    first, _, rest = cell.partition("\n")
    if first.startswith("%%writefile "):
        return f"_write({first.split()[1]!r}, {rest!r})"
    lines = [line for line in cell.splitlines() if not line.startswith("%")]
    return "\n".join(f"_shell({line[1:]!r})" if line.startswith("!") else line for line in lines)
