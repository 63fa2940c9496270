"""Tables of README.md, from the stored results: ``python docs/_ext/first_page.py`` writes them into it."""

import re
from functools import cache
from pathlib import Path

from pandas import Series

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
PEERS = {"heyoka": "Taylor"} | {name: name for name in ("IAS15", "WHFast", "WHFast512", "SABA", "DOP853")}
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
    return cost_ratio.ratios(frame("speed/race"), at)


def by_width(found: Frame) -> tuple[Frame, Frame]:
    """Return what was measured with all vector instructions, and what was with AVX2 only."""
    restricted = found.processor.str.endswith(RESTRICTED)
    return found[~restricted], found[restricted]


def defaults() -> Frame:
    """Return the ratios of heyoka's settings to `HBVM()`, and where that is less accurate."""
    return cost_ratio.ratios(frame("speed/automatic"), no_worse=("energy_max", "position_mean"))


def headline() -> str:
    """Return the range of heyoka's times relative to the fastest of HBVM and Gauss, and to `HBVM()`."""
    compared = by_width(raced())[0]
    heyoka = compared.query("family == 'Taylor'").ratio.dropna()
    whfast = compared.query("family == 'WHFast512' and problem.str.startswith('Solar')").ratio.min()
    both = by_width(defaults().query("why == ''"))
    counts = both[0].problem.nunique(), defaults().problem.nunique()
    wide, narrow = (_between(part.ratio) for part in both)
    return (
        "**At energy errors of 1e-13 and position errors of 1e-10 to 1e-8 heyoka takes "
        f"{_between(heyoka)} times as\n"
        f"long as the fastest of HBVM and Gauss ({len(heyoka)} smooth problems, AVX-512), and REBOUND's "
        f"WHFast512 {digits(whfast)} times\n"
        f"on the eight planets. Beside `HBVM()`, without settings, heyoka takes {wide} times as long, with "
        f"AVX2 {narrow}\n"
        f"times, on {counts[0]} of {counts[1]} problems; on the others `HBVM()` is less accurate.**"
    )


def _between(ratios: Series) -> str:
    return f"{ratios.min():.2g} to {ratios.max():.2g}"


def default() -> str:
    """Return the table of `HBVM()` beside heyoka: time, evaluations, and ratios for both vector widths."""
    cases, found = frame("speed/automatic"), defaults()
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
    """Return the table of the race with evaluations, and below it what is lost."""
    head = ("problem", "fastest of HBVM and Gauss", "time", "evaluations", *PEERS)
    lines = [f"| {' | '.join(head)} |", f"| :-- | :-- |{' --: |' * (len(head) - 2)}"]
    cases, found = frame("speed/race"), raced()
    for problem, here in by_width(found)[0].groupby("problem", sort=False):
        first, family = here.iloc[0], here.set_index("family").ratio
        ours = cases[
            (cases.title == problem) & (cases.processor == first.processor) & (cases.method == first.ours)
        ]
        numbers = [family.get(name, float("nan")) for name in PEERS.values()]
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
        (row,) = tight[tight.problem.str.endswith(key)].itertuples()
        ours = f"`{row.ours}` | {seconds(row.ours_seconds)}"
        lines.append(f"| {name} | {ours} | – | {_ratio(row.ratio)} |{' – |' * (len(PEERS) - 1)}")
    loose = raced("energy and position error")
    here = loose[(loose.level == "1e-08, 1e-05") & loose.problem.str.startswith("Outer")]
    row = by_width(here)[0].set_index("family")
    cells = " | ".join(_ratio(row.ratio[name]) for name in PEERS.values())
    ours = f"`{row.ours.iloc[0]}` | {seconds(row.ours_seconds.iloc[0])}"
    return "\n".join([*lines, f"| Outer Solar System, ≤ 1e-5 | {ours} | – | {cells} |"])


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
