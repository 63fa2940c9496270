"""Tables of README.md, from the stored results: ``python docs/_ext/first_page.py`` writes them into it."""

import re
from functools import cache
from pathlib import Path

from hbvm_bench.report.page import gather
from hbvm_bench.store.store import PACKED, Store
from hbvm_bench.summaries import cost_ratio
from hbvm_bench.summaries.frame import Frame
from hbvm_bench.summaries.goals import digits
from hbvm_bench.summaries.rows import seconds

ROOT = Path(__file__).parents[2]
README = ROOT / "README.md"
MARKED = re.compile(r"(<!-- (\w+): docs/_ext/first_page.py -->\n\n).*?(\n\n<!-- end -->)", re.DOTALL)

RESTRICTED = "restricted to AVX2"
PEERS = {"heyoka": "Taylor"} | {name: name for name in ("IAS15", "WHFast", "SABA", "DOP853")}
DEFAULT = (
    "Outer Solar System",
    "Sitnikov's problem",
    "Kepler's problem, e = 0.6",
    "Hénon–Heiles",
    "Pendulum",
    "Double pendulum",
    "Restricted three-body problem",
)
LOST = {
    "Decays (DETEST C1)": "(DETEST C1)",
    "Decays (C2)": "(DETEST C2)",
    "Heat equation (C3)": "(DETEST C3)",
    "Heat equation (C4)": "(DETEST C4)",
}


@cache
def frame(place: str) -> Frame:
    """Return the results table of a folder in ``reports``."""
    return gather(Store(ROOT / "reports" / place / PACKED).runs()).frame


@cache
def raced(at: str = "") -> Frame:
    """Return the ratios of the race, at the errors that its problems ask for or at several."""
    return cost_ratio.ratios(frame("speed/race"), at, equal_settings=True)


def by_width(found: Frame) -> tuple[Frame, Frame]:
    """Return what was measured last with all vector instructions, and what was with AVX2 only."""
    restricted = found.processor.str.endswith(RESTRICTED)
    wide, narrow = found[~restricted], found[restricted]
    return tuple(part[part.processor == part.processor.iloc[-1]] for part in (wide, narrow))


def headline() -> str:
    """Return the range of heyoka's times relative to the fastest of HBVM and Gauss, by vector width."""
    heyoka = raced()[(raced().family == "Taylor") & raced().ratio.notna()]
    wide, narrow = (part.ratio for part in by_width(heyoka))
    return (
        f"**At a relative energy error of 1e-13 heyoka takes {wide.min():.2g} to {wide.max():.2g} times as "
        "long as the fastest\n"
        f"of HBVM and Gauss with AVX-512 ({len(wide)} smooth problems), "
        f"and {narrow.min():.2g} to {narrow.max():.2g} times with AVX2 ({len(narrow)} of them).**"
    )


def default() -> str:
    """Return the table of `HBVM()` beside heyoka: time, evaluations, and ratios for both vector widths."""
    cases = frame("speed/automatic")
    found = cost_ratio.ratios(cases, no_worse=("energy_max", "position_mean"))
    lines = ["| problem | time | evaluations | AVX-512 | AVX2 |", "| :-- | --: | --: | --: | --: |"]
    for name in DEFAULT:
        (wide,), (narrow,) = (
            part[part.problem == name].itertuples() for part in by_width(found[found.problem.isin(DEFAULT)])
        )
        ours = cases[(cases.title == name) & (cases.processor == wide.processor) & (cases.role == "ours")]
        less = f" ({wide.why})" if wide.why else ""
        cells = (f"{name}{less}", seconds(wide.ours_seconds), f"{int(ours.evaluations.iloc[0]):,}")
        lines.append(f"| {' | '.join(cells)} | {digits(wide.ratio)} | {digits(narrow.ratio)} |")
    return "\n".join(lines)


def race() -> str:
    """Return the table of the race with evaluations and heyoka with AVX2, and below it what is lost."""
    head = ("problem", "fastest", "time", "evaluations", "heyoka", "heyoka, AVX2", *list(PEERS)[1:])
    lines = [f"| {' | '.join(head)} |", f"| :-- | :-- |{' --: |' * (len(head) - 2)}"]
    cases, found = frame("speed/race"), raced()
    wide, restricted = by_width(found)
    for problem, here in wide.groupby("problem", sort=False):
        first, family = here.iloc[0], here.set_index("family").ratio
        narrow = restricted[(restricted.problem == problem) & (restricted.family == "Taylor")]
        ours = cases[
            (cases.title == problem) & (cases.processor == first.processor) & (cases.method == first.ours)
        ]
        others = [family.get(name, float("nan")) for name in PEERS.values()]
        numbers = [others[0], narrow.ratio.iloc[0] if len(narrow) else float("nan"), *others[1:]]
        count = f"{int(ours.evaluations.iloc[0]):,}"
        cells = (
            _short(problem),
            f"`{first.ours}`",
            seconds(first.ours_seconds),
            count,
            *map(_ratio, numbers),
        )
        lines.append(f"| {' | '.join(cells)} |")
    general = cost_ratio.ratios(frame("general"), "position error")
    tight = general[(general.level == "1e-12") & (general.family == "Taylor")]
    for name, key in LOST.items():
        (ratio,) = tight[tight.problem.str.endswith(key)].ratio
        lines.append(f"| {name} | heyoka | – | – | {_ratio(ratio)} | – |{' – |' * (len(PEERS) - 1)}")
    loose = raced("energy and position error")
    here = loose[(loose.level == "1e-08, 1e-05") & loose.problem.str.startswith("Outer")]
    row = here[here.processor == here.processor.iloc[-1]].set_index("family").ratio
    cells = (_ratio(row["Taylor"]), "–", *(_ratio(row[name]) for name in list(PEERS)[1:]))
    best = f"WHFast512: {_ratio(row['WHFast512'])}"
    return "\n".join([*lines, f"| Outer Solar System, ≤ 1e-5 | {best} | – | – | {' | '.join(cells)} |"])


def _ratio(value: float) -> str:
    return "–" if value != value else digits(value)


def _short(title: str) -> str:
    parts = title.split(", ")
    return ", ".join(parts[:2]) if "chain" in parts[0] else parts[0]


def filled(text: str) -> str:
    """Return a page with its tables drawn anew."""
    makers = {"headline": headline, "default": default, "race": race}
    return MARKED.sub(lambda found: f"{found[1]}{makers[found[2]]()}{found[3]}", text)


if __name__ == "__main__":
    README.write_text(filled(README.read_text(encoding="utf-8")), encoding="utf-8")
