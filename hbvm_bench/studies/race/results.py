"""What a race shows, problem by problem, from the results of its campaign."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import msgspec

from hbvm_bench.campaign.file import Campaign, ProblemEntry, name_of
from hbvm_bench.campaign.file import load as load_campaign
from hbvm_bench.measure import machine
from hbvm_bench.measure.computation import VALUE, unpacked
from hbvm_bench.report.page import Results
from hbvm_bench.store.records import Record
from hbvm_bench.store.stored_run import StoredRun
from hbvm_bench.studies.race.families import OURS, FamilyRow, row_of
from hbvm_bench.studies.race.probe import KEY, Probe, probe
from hbvm_bench.summaries import standings
from hbvm_bench.summaries.goals import Verdict, verdicts
from hbvm_bench.summaries.points import number
from hbvm_bench.summaries.standings import SettingComparison
from problems.errors import InputError

NAME = "race"
ERRORS = ENERGY, POSITION = ("energy_max", "position_end")


@dataclass(frozen=True)
class Race:
    """One problem of a race.

    Attributes
    ----------
    entry : ProblemEntry
        What the campaign says of it.
    run : StoredRun
        The run it belongs to.
    records : list of Record
        One per setting, in the order of declaration.
    probes : list of Probe
        Compile times; empty where they were not measured.
    """

    entry: ProblemEntry
    run: StoredRun
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
        """Seconds of the calibration loop, round by round."""
        rounds = [round_ for record in self.records if record.timing for round_ in record.timing.rounds]
        seconds = {round_.number: round_.calibration[0] for round_ in rounds if round_.calibration}
        return [seconds[place] for place in sorted(seconds, key=lambda place: place or 0)]

    @property
    def machine(self) -> dict[str, str | int]:
        """Where it was timed."""
        return next(
            (record.timing.machine for record in self.records if record.timing), self.records[0].machine
        )

    @property
    def started(self) -> str:
        """When the first of its cases had ended."""
        return min(record.finished for record in self.records)

    @cached_property
    def rows(self) -> dict[FamilyRow, list[Record]]:
        """The settings by row, in the order of declaration."""
        records_of: dict[FamilyRow, list[Record]] = {}
        for record in self.records:
            records_of.setdefault(row_of(record.case), []).append(record)
        return records_of

    @property
    def families(self) -> list[str]:
        """The families in the order of declaration."""
        return list(dict.fromkeys(row.family for row in self.rows))

    @cached_property
    def competing(self) -> dict[str, list[Record]]:
        """The settings of each family that are compared with other families: as many of each.

        Of a family with a fixed and an adaptive step size, which has declared twice as many as the others,
        every second one of either kind takes part, counted in the order of declaration.
        """
        rows: dict[str, list[list[Record]]] = {}
        for row, records in self.rows.items():
            rows.setdefault(row.family, []).append(records)
        single = max((len(mine[0]) for mine in rows.values() if len(mine) == 1), default=0)
        every = {family: len(mine) if sum(map(len, mine)) > single else 1 for family, mine in rows.items()}
        return {
            family: [record for records in mine for record in records[:: every[family]]]
            for family, mine in rows.items()
        }

    @property
    def goals(self) -> list[Verdict]:
        """The verdicts on what was asked for."""
        compared = [record for records in self.competing.values() for record in records]
        return verdicts(self.run.index.campaign, compared)

    def settings(self, who: str | FamilyRow) -> list[Record]:
        """Return all settings of a family, or of one of its rows."""
        return self.rows.get(who, []) if isinstance(who, FamilyRow) else standings.among(self.records, who)

    def best(self, who: str | FamilyRow, energy: float, position: float) -> Record | None:
        """Return the fastest setting with errors at most these, if there is one.

        Of a row it is chosen from all settings, of a family from those that compete.
        """
        able = self.settings(who) if isinstance(who, FamilyRow) else self.competing.get(who, [])
        return standings.best(able, {ENERGY: energy, POSITION: position})

    def at(self, family: str, energy: float, position: float) -> SettingComparison:
        """Compare the best settings of a peer and of HBVM and Gauss at one accuracy."""
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


def races_of(results: Results) -> list[Race]:
    """Return the contests of the processor that was measured last, in the order of declaration."""
    return by_kind(results)[machine.kind(results.runs[-1].machine)]


def by_kind(results: Results) -> dict[str, list[Race]]:
    """Return the contests by the kind of processor, in the order of declaration."""
    return {kind: _contests(runs, probes(results)) for kind, runs in results.by_processor.items()}


def probes(results: Results) -> list[Probe]:
    """Return the compile times that are stored beside the cases.

    Raises
    ------
    problems.errors.InputError
        If they are something else.
    """
    try:
        stored = [arrays for key, (_, arrays) in results.computed.items() if key.startswith(KEY)]
        return [entry for arrays in stored for entry in unpacked(arrays[VALUE], probe)]
    except (msgspec.MsgspecError, LookupError) as error:
        raise InputError(f"the compile times of the race are damaged: {error}.") from None


def _contests(runs: Sequence[StoredRun], measured: Sequence[Probe]) -> list[Race]:
    races = {
        name_of(entry): Race(
            entry, run, records, [probe for probe in measured if probe.problem == name_of(entry)]
        )
        for run in runs
        for entry, records in standings.entries(run.index.campaign, run.records)
        if records
    }
    order = [name_of(entry) for entry in declared().entries()]
    return sorted(races.values(), key=lambda race: order.index(race.key) if race.key in order else len(order))
