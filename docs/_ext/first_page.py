"""Tables of README.md, from those of the reports: ``python docs/_ext/first_page.py`` writes them into it."""

import re
from pathlib import Path

from stored import Stored, tables

README = Path(__file__).parents[2] / "README.md"
MARKED = re.compile(r"(<!-- (\w+): docs/_ext/first_page.py -->\n\n).*?(\n\n<!-- end -->)", re.DOTALL)

FASTEST, BY_PROCESSOR = "The fastest setting, and the time", "The same ratios by kind of processor"
SETTINGS = "The fastest settings with energy error"
DEFAULT = {
    "Outer Solar System": "outer_solar_system(",
    "Sitnikov's problem": "sitnikov(",
    "Kepler's problem, e = 0.6": "kepler(e=0.6",
    "Hénon–Heiles": "henon_heiles(",
    "Pendulum": "pendulum(q",
    "Double pendulum": "double_pendulum(",
    "Restricted three-body problem": "cr3bp(",
}
"""Parts of the cells that name a problem in the report `automatic`."""

LOST = {
    "Decays (DETEST C1)": "(C1)",
    "Decays (C2)": "(C2)",
    "Heat equation (C3)": "(C3)",
    "Heat equation (C4)": "(C4)",
}


def headline() -> str:
    """Return the range of heyoka's times relative to the fastest of HBVM and Gauss, by vector width."""
    head, *rows = ([cell.strip() for cell in line.split("|")[1:-1]] for line in race().splitlines())
    raced = [dict(zip(head, row, strict=True)) for row in rows[1:] if row[1].startswith("`")]
    ranges = []
    for column in ("heyoka", "heyoka, AVX2"):
        found = [float(row[column]) for row in raced if row[column] != "–"]
        ranges.append((f"{min(found):.2g}", f"{max(found):.2g}", len(found)))
    (low, high, many), (narrow_low, narrow_high, few) = ranges
    return (
        f"**At a relative energy error of 1e-13 heyoka takes {low} to {high} times as long as the fastest\n"
        f"of HBVM and Gauss with AVX-512 ({many} smooth problems), "
        f"and {narrow_low} to {narrow_high} times with AVX2 ({few} of them).**"
    )


def default() -> str:
    """Return the table of `HBVM()` beside heyoka: time, steps, and ratios for both vector widths."""
    lines = ["| problem | time | steps | AVX-512 | AVX2 |", "| :-- | --: | --: | --: | --: |"]
    for name, call in DEFAULT.items():
        row = _row("automatic", "Errors and times", call)
        ratios = [
            _row("automatic", "against", call)[column] for column in ("znver5-512bit", "znver5-512bit-avx2")
        ]
        less = " (less accurate)" if "less accurate" in ratios[0] else ""
        numbers = " | ".join(ratio.partition("×")[0] for ratio in ratios)
        lines.append(f"| {name}{less} | {row['time']} | {_grouped(row['steps'])} | {numbers} |")
    return "\n".join(lines)


def race() -> str:
    """Return the table of the race with evaluations and heyoka with AVX2, and below it what is lost."""
    ((_, head, rows),) = (table for table in tables("race") if FASTEST in table[0])
    shown = [*head[:3], "evaluations", *head[3:6], "heyoka, AVX2", *head[6:]]
    lines = [f"| {' | '.join(shown)} |", f"| :-- | :-- |{' --: |' * (len(shown) - 2)}"]
    for row in rows:
        evaluations = {
            cells[head.index("evaluations")]
            for above, head, cases in tables("race")
            for cells in cases
            if SETTINGS in above and cells[1:3] and row[1] in cells[1] and cells[2].startswith(row[2])
        }
        narrow = [
            dict(zip(head, cells, strict=True))["znver4-256bit-avx2"].partition("×")[0]
            for above, head, cases in tables("race")
            for cells in cases
            if BY_PROCESSOR in above and cells[0].startswith(row[0]) and cells[1] == "heyoka"
        ]
        (count,) = evaluations
        narrow = [number for number in narrow if number != "not run"] or ["–"]
        cells = [row[0], f"`{row[1]}`", row[2], _grouped(count), *row[3:6], *narrow, *row[6:]]
        lines.append(f"| {' | '.join(cells)} |")
    empty = ["–"] * (len(shown) - 8)
    for name, key in LOST.items():
        ratio = 1.0 / float(Stored()("general", "by position error", f"{key} | 1e-12", "Taylor"))
        lines.append(f"| {' | '.join([name, 'heyoka', '–', '–', f'{ratio:.1f}', '–', '1', '–', *empty])} |")
    loose = _row("race", "At other accuracies", "1e-08, 1e-05")  # the outer Solar System is the first
    relative = {
        name.partition(" × ")[0]: float(cell.partition("×")[0]) for name, cell in loose.items() if "×" in cell
    }
    best = relative["WHFast512"]
    others = {name: f"{ratio / best:.3g}" for name, ratio in relative.items()}
    row = ["Outer Solar System, position ≤ 1e-5", "WHFast512", "–", "–", "–", f"{1 / best:.3g}"]
    row += [others["heyoka"], "–", *(others[name] for name in shown[8:])]
    return "\n".join([*lines, f"| {' | '.join(row)} |"])


def _grouped(number: str) -> str:
    """Return a whole number with commas."""
    return number.replace(" ", ",").replace("\N{NO-BREAK SPACE}", ",")


def _row(report: str, table: str, part: str) -> dict[str, str]:
    """Return the first row of a report's table that has a cell beginning with ``part``."""
    return next(
        dict(zip(head, cells, strict=True))
        for above, head, rows in tables(report)
        for cells in rows
        if (table in above or table in head) and cells[0].startswith(part)
    )


def filled(text: str) -> str:
    """Return a page with its tables drawn anew."""
    makers = {"headline": headline, "default": default, "race": race}
    return MARKED.sub(lambda found: f"{found[1]}{makers[found[2]]()}{found[3]}", text)


if __name__ == "__main__":
    README.write_text(filled(README.read_text(encoding="utf-8")), encoding="utf-8")
