"""What a race leaves behind, problem by problem; its pages are drawn from it without running anything.

::

    DIR/race.json                the records, with all timing samples
    DIR/compile_times.json       what fresh processes pay
    DIR/campaign.json, cases/    the store of the run, as every campaign has it
"""

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from hbvm_bench.campaign.file import Campaign, ProblemEntry, name_of
from hbvm_bench.campaign.file import load as load_campaign
from hbvm_bench.measure import machine
from hbvm_bench.store import kept
from hbvm_bench.store.kept import Kept
from hbvm_bench.store.records import Record
from hbvm_bench.studies.race.families import OURS, Row, row_of
from hbvm_bench.studies.race.probe import PROBES, Probe, load_probes
from hbvm_bench.summaries import standings
from hbvm_bench.summaries.goals import Verdict, verdicts
from hbvm_bench.summaries.points import number
from hbvm_bench.summaries.standings import Comparison
from problems.errors import InputError

NAME = "race"
FILE = "race.json"
ERRORS = ENERGY, POSITION = ("energy_max", "position_end")


@dataclass(frozen=True)
class Race:
    """One problem of a race.

    Attributes
    ----------
    entry : ProblemEntry
        What the campaign says of it.
    run : Kept
        The run it belongs to.
    records : list of Record
        One per setting, in the order of declaration.
    probes : list of Probe
        Compile times; empty where they were not measured.
    """

    entry: ProblemEntry
    run: Kept
    records: list[Record]
    probes: list[Probe] = field(default_factory=list)

    @property
    def key(self) -> str:
        """Its name, for files."""
        return name_of(self.entry)

    @property
    def title(self) -> str:
        """Its name, for readers."""
        return standings.title_of(self.entry)

    @property
    def asked(self) -> tuple[float, float]:
        """The errors of energy and position at which times are compared first."""
        return self.entry.within[ENERGY], self.entry.within[POSITION]

    @property
    def quick(self) -> bool:
        """Whether it was the short run."""
        return self.run.index.campaign.quick

    @property
    def calibration(self) -> list[float]:
        """Seconds of a fixed computation, round by round."""
        rounds = [one for record in self.records if record.timing for one in record.timing.rounds]
        found = {one.number: one.calibration[0] for one in rounds if one.calibration}
        return [found[place] for place in sorted(found, key=lambda place: place or 0)]

    @property
    def machine(self) -> dict[str, str | int]:
        """Where it was timed."""
        return next((one.timing.machine for one in self.records if one.timing), self.records[0].machine)

    @property
    def started(self) -> str:
        """When the first of its cases had ended."""
        return min(one.finished for one in self.records)

    @cached_property
    def rows(self) -> dict[Row, list[Record]]:
        """The settings by row, in the order of declaration."""
        found: dict[Row, list[Record]] = {}
        for record in self.records:
            found.setdefault(row_of(record.case), []).append(record)
        return found

    @property
    def families(self) -> list[str]:
        """The families in the order of declaration."""
        return list(dict.fromkeys(row.family for row in self.rows))

    @property
    def goals(self) -> list[Verdict]:
        """The verdicts on what was asked for."""
        found = verdicts(self.run.index.campaign, self.run.records)
        return [one for one in found if name_of(one.entry) == self.key]

    def of(self, who: str | Row) -> list[Record]:
        """Return the settings of a family, with fixed and with own steps, or of one of its rows."""
        return self.rows.get(who, []) if isinstance(who, Row) else standings.among(self.records, who)

    def best(self, who: str | Row, energy: float, position: float) -> Record | None:
        """Return the fastest setting of a family or a row with errors at most these, if there is one."""
        return standings.best(self.of(who), {ENERGY: energy, POSITION: position})

    def at(self, family: str, energy: float, position: float) -> Comparison:
        """Compare the best settings of a peer and of ours at one accuracy."""
        ours, theirs = (self.best(who, energy, position) for who in (OURS, family))
        return standings.compare(ours, theirs, chosen=True)


def counts(record: Record) -> bool:
    """Whether a setting may be compared: finished, on the trajectory that was asked for, and timed."""
    return standings.accurate(record, {}) and all(
        number(record, key) is not None for key in (*ERRORS, standings.TIME)
    )


def declared() -> Campaign:
    """Return the whole race, as it is declared."""
    return load_campaign(NAME)


def load(directory: Path) -> list[Race]:
    """Read the results in a directory, in the order of declaration.

    Raises
    ------
    problems.errors.InputError
        If there are none, or a file is not a result.
    """
    found = _in(directory)
    if not found:
        raise InputError(
            f"there is no result of a race in {str(directory)!r}; run: hbvm-bench race --out DIR."
        )
    return found


def by_kind(directory: Path) -> dict[str, list[Race]]:
    """Read the results in a directory and in the directories in it, by the kind of processor.

    Several kinds lie side by side as ``DIR`` and ``DIR/<kind>``. Of two results of
    one problem on one kind the outer directory's counts.

    Raises
    ------
    problems.errors.InputError
        If a file is not a result.
    """
    found: dict[str, list[Race]] = {}
    for folder in [directory, *sorted(path for path in directory.glob("*") if path.is_dir())]:
        for race in _in(folder):
            of_kind = found.setdefault(machine.kind(race.machine), [])
            if race.key not in {one.key for one in of_kind}:
                of_kind.append(race)
    return found


def _in(directory: Path) -> list[Race]:
    probes = load_probes(directory / PROBES)
    found = {
        name_of(entry): Race(entry, run, records, [one for one in probes if one.problem == name_of(entry)])
        for run in kept.load(directory / FILE, NAME)
        for entry, records in standings.entries(run.index.campaign, run.records)
        if records
    }
    order = [name_of(entry) for entry in declared().entries()]
    return sorted(found.values(), key=lambda race: order.index(race.key) if race.key in order else len(order))
