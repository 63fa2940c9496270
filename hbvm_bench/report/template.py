"""A page's text, ``page.md``: a jinja template in Markdown with the prose, and which blocks stand where.

``{{ block("cost_ratio", "race", at="position error") }}`` on a line of its own is a block, here of the
results called ``race`` and with an option. For numbers in sentences ``frame("race")`` and ``ratios("race")``
are data frames, of which ``latest`` leaves the processor measured last; ``value("./blocks.py:counts")`` is
what a function of a study's own returns, ``rms("race", METHOD)`` an energy error at the end.

``# `` begins the title, ``## `` a section, ``### `` one in it, ``- `` an item, ``> `` a note, four spaces a
command. ``<details><summary>...</summary>`` and ``</details>``, each on a line of its own, fold what is
between them. A list of links alone leads to other pages.
"""

import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined, TemplateError, nodes

from hbvm_bench.report.document import Block, Commands, Details, Items, Links, Note, Section, attempt
from hbvm_bench.report.figures.ratios import shortened
from hbvm_bench.summaries.goals import digits
from problems.errors import InputError

NAME = "page.md"
SHIPPED = Path(__file__).parent / "templates" / NAME
MARK = re.compile(r"\[\[block (\d+)\]\]")
FOLD = -1  # the level of a fold, in which headings are its own
TEXTS = ("title", "description")  # of a campaign
LINK = re.compile(r"- \[([^\]]+)\]\((\S+)\) ?(.*)")


def environment(folder: Path) -> Environment:
    """Return where the templates of a folder and those that ship are found."""
    loader = FileSystemLoader([folder, SHIPPED.parent])
    made = Environment(loader=loader, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    made.globals |= {"shortened": shortened, "number": digits}
    return made


def named_blocks(path: Path) -> list[tuple[str, str | None]]:
    """Return the blocks that a page names, each with the results that it is of.

    Raises
    ------
    problems.errors.InputError
        If it is no template.
    """
    try:
        parsed = environment(path.parent).parse(path.read_text(encoding="utf-8"))
    except (TemplateError, OSError, UnicodeDecodeError) as error:
        raise InputError(f"cannot read the page {str(path)!r}: {' '.join(str(error).split())}.") from None
    calls = [
        call
        for call in parsed.find_all(nodes.Call)
        if isinstance(call.node, nodes.Name) and call.node.name == "block"
    ]
    given = [[arg.value for arg in call.args if isinstance(arg, nodes.Const)] for call in calls]
    return [
        (str(arguments[0]), arguments[1] if len(arguments) > 1 else None) for arguments in given if arguments
    ]


def rendered(
    path: Path, make: Callable[..., Callable[[], Any]], values: dict[str, Any]
) -> tuple[str, list[str], list[Block]]:
    """Return the title, the paragraphs before all else, and the blocks of a page.

    ``make`` returns what makes a block from its name, its results and its options; a text that it makes
    stands where it is asked for, so that it may be part of a sentence.

    Raises
    ------
    problems.errors.InputError
        If the template uses what is not there.
    """
    made: list[list[Block]] = []

    def block(name: str, *results: str, **options: Any) -> str:
        blocks = attempt((name, make(name, *results, **options)))
        if len(blocks) == 1 and isinstance(blocks[0], str):
            return blocks[0]
        made.append(blocks)
        return f"[[block {len(made) - 1}]]"

    for name in TEXTS:  # may be a stranger's: nothing in them is markup
        made.append([" ".join(str(values.get(name, "")).split())])
        values = {**values, name: f"[[block {len(made) - 1}]]"}
    try:
        template = environment(path.parent).from_string(path.read_text(encoding="utf-8"))
        text = template.render(block=block, **values)
    except (TemplateError, LookupError, AttributeError, TypeError, ValueError) as error:
        raise InputError(f"the page {str(path)!r} cannot be made: {' '.join(str(error).split())}.") from error
    return parsed(text, made)


def parsed(text: str, made: list[list[Block]]) -> tuple[str, list[str], list[Block]]:
    """Return the title, the lead and the blocks of Markdown in which marks stand for blocks."""
    title, lead, blocks = "", [], []
    open_: list[tuple[int, list[Block]]] = [(0, blocks)]  # the sections and folds around, with their levels
    closing: list[Callable[[list[Block]], Block]] = [lambda _: ""]

    def close_last() -> None:
        _, inner = open_.pop()
        open_[-1][1].append(closing.pop()(inner))

    def close(level: int) -> None:
        while open_[-1][0] >= level:
            close_last()

    for part in paragraphs(text):
        head, _, rest = part.partition(" ")
        found = MARK.fullmatch(part)
        plain = made[int(found[1])] if found else [part]
        if head == "#":
            mark = MARK.fullmatch(rest)
            title = str(made[int(mark[1])][0]) if mark else rest
        elif re.fullmatch("#{2,4}", head):
            close(len(head))
            key = re.sub(r"\W+", "-", rest.lower()).strip("-")
            nav = rest if len(head) == 2 else ""
            open_.append((len(head), []))
            closing.append(lambda inner, rest=rest, key=key, nav=nav: Section(rest, inner, key, nav=nav))
        elif fold := re.fullmatch(r"<details><summary>(.*)</summary>", part):
            open_.append((FOLD, []))
            closing.append(lambda inner, summary=fold[1]: Details(summary, inner))
        elif part == "</details>" and any(level == FOLD for level, _ in open_):
            close(1)
            close_last()
        elif len(open_) == 1 and not blocks and _is_prose(plain):
            lead.extend(str(text) for text in plain if text)
        elif found:
            open_[-1][1].extend(plain)
        else:
            open_[-1][1].append(_block(part))
    while len(open_) > 1:
        close_last()
    return title, lead, blocks


def paragraphs(text: str) -> list[str]:
    """Return the paragraphs of Markdown; headings, folds and marks are paragraphs without blank lines too."""
    apart = re.sub(r"^(#{1,4} .*|</?details>.*|\[\[block \d+\]\])$", r"\n\1\n", text, flags=re.MULTILINE)
    return [part.strip("\n").rstrip() for part in re.split(r"\n\s*\n", apart) if part.strip()]


def _is_prose(blocks: Sequence[Block]) -> bool:
    return all(isinstance(text, str) and not text.startswith(("- ", "> ", "    ")) for text in blocks)


def _block(part: str) -> Block:
    if part.startswith("    "):
        return Commands("\n".join(line.strip() for line in part.split("\n")))
    if part.startswith("> "):
        return Note(re.sub(r"\n?> ", " ", part).strip())
    if part.startswith("- "):
        items = re.split(r"\n(?=- )", part)
        links = [LINK.fullmatch(" ".join(item.split())) for item in items]
        if all(links):
            return Links([(link[1], link[3], link[2]) for link in links if link])
        return Items([item.removeprefix("- ") for item in items])
    return part
