"""Run the fourteen tasks, each in a process of its own, and write examples/measured.json and docs/tasks.md.

``python examples/run_all.py``; with ``--page`` the page alone, from what is stored.
"""

import json
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, replace
from datetime import UTC, datetime
from importlib import import_module
from multiprocessing import get_context
from pathlib import Path

from side_by_side import Comparison, Row

STORED = Path(__file__).parent / "measured.json"
PAGE = Path(__file__).parents[1] / "docs" / "tasks.md"
TASKS = (
    "own_system", "section", "long_runs", "campaign", "encounters", "stiff", "lattice", "star_cluster",
    "plugin", "exponents", "fit", "impacts", "short", "molecular_dynamics",
)  # fmt: skip
UNKNOWN_LOAD = ("campaign",)  # it does not wait for all that it starts: their work looks like others'
INTRODUCTION = """# Fourteen tasks, beside the library one would otherwise use

Each is a short script in [examples](../examples/side_by_side.py), which the tests run. Of every method the
same number of settings is tried, four where there is something to choose. The table has the fastest of
those whose error is at most the requested one, or the most accurate where none is. Right-hand sides and
Jacobians are compiled for every library; bodies in space are integrated with each library's own model of
them. "First call" contains compilation, unless the machine has compiled the same before; "time" is the
median of the others. Where other work took more than a tenth of a core, no time is shown, the choice of the
setting is preliminary and nothing is judged. This page is written by `make examples`.
"""


def compared(name: str) -> tuple[Comparison, tuple[float, float] | None]:
    """Return what a script measures, and what else the machine did: other processes, and steal time."""
    from hbvm_bench.measure.timing import busy, load_between

    before = busy()
    comparison = import_module(name).compare()
    load = None if name in UNKNOWN_LOAD else load_between(before, busy())
    return comparison, None if load is None else (load.others, load.steal)


def measure() -> None:
    """Run all, and store what they measure with the day, the kernel, the kind of machine and its load."""
    from hbvm_bench.campaign.identity import kernel_digest
    from hbvm_bench.measure import machine

    day, results, loads = datetime.now(UTC).date().isoformat(), {}, {}
    with ProcessPoolExecutor(1, mp_context=get_context("spawn"), max_tasks_per_child=1) as pool:
        for name in TASKS:
            results[name], loads[name] = pool.submit(compared, name).result()
            print(results[name], end="\n\n", flush=True)
    known = [load for load in loads.values() if load is not None]
    busiest = tuple(map(max, zip(*known, strict=True)))
    for name, load in loads.items():
        if judged(load or busiest):
            rows = results[name].rows
            results[name].rows = [replace(row, first=None, seconds=None) for row in rows]
    stored = {
        "machine": machine.sentence(machine.describe(measure=True)),
        "day": day,
        "kernel": kernel_digest(),
        "loads": {name: load for name, load in loads.items() if load is not None},
        "tasks": {name: asdict(result) for name, result in results.items()},
    }
    STORED.write_text(json.dumps(stored, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def judged(load: tuple[float, float]) -> str:
    """Return why times beside such a load are not judged; ``""`` where they are."""
    from hbvm_bench.store.records import Load

    return Load(others=load[0], steal=load[1]).verdict()


def page() -> str:
    """Return the page of what is stored."""
    from hbvm_bench.report.provenance import measured_on
    from hbvm_bench.store.records import Load

    stored = json.loads(STORED.read_text(encoding="utf-8"))
    lines = [INTRODUCTION, stored["machine"]]
    loads = [Load(others=others, steal=steal) for others, steal in stored["loads"].values()]
    lines.append(measured_on(stored["day"], stored["kernel"], loads))
    for name, fields in stored["tasks"].items():
        made = Comparison(**{**fields, "rows": [Row(**row) for row in fields["rows"]]})
        table = ["| | setting | time | first call | energy | error |", "|:--|:--|--:|--:|--:|--:|"]
        for row in made.rows:
            time = "–" if row.seconds is None else f"{1e3 * row.seconds:.3g} ms"
            first = "–" if row.first is None else f"{row.first:.2g} s"
            energy = "–" if row.energy is None else f"{row.energy:.1e}"
            table.append(
                f"| {row.library} | `{row.setting}` | {time} | {first} | {energy} | {row.error:.1e} |"
            )
        lines += [
            f"\n## {made.task}",
            f"[examples/{name}.py](../examples/{name}.py). Error: {made.error}, at most {made.asked:g}.",
            "\n".join(table),
            made.verdict().replace("none", "None", 1) + ".",
        ]
    return "\n\n".join(line.strip("\n") for line in lines) + "\n"


if __name__ == "__main__":
    if "--page" not in sys.argv:
        measure()
    PAGE.write_text(page(), encoding="utf-8")
