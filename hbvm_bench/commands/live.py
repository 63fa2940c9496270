"""What the command line shows while a run is under way."""

import time
from collections.abc import Sequence

from rich.console import Group, RenderableType
from rich.live import Live as RichLive
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from hbvm_bench.campaign.identity import Resolved
from hbvm_bench.report.terminal import console
from hbvm_bench.run.task import Request
from hbvm_bench.store.records import Record
from hbvm_bench.summaries.rows import seconds, status_of

SHOWN = 12  # running cases with a line of their own
EVERY = 30.0  # seconds between two lines on what runs where the output is a file


class Live:
    """A run as it goes: on a terminal what runs and what is left, elsewhere a line per case."""

    def __init__(self) -> None:
        self._console = console(stderr=True)
        self._start = time.monotonic()
        self._title = ""
        self._total = self._count = 0
        self._since: dict[str, tuple[Resolved | Request, float]] = {}
        self._told = self._start
        self._live = RichLive(
            get_renderable=self._render, console=self._console, transient=True, refresh_per_second=2
        )

    def __enter__(self) -> "Live":
        if self._console.is_terminal:
            self._live.start()
        return self

    def __exit__(self, *exc: object) -> None:
        if self._live.is_started:
            self._live.stop()

    def phase(self, title: str, left: int, done: int) -> None:
        """Begin a phase: with how many cases are to come, after those done."""
        self._title, self._total, self._count, self._since = title, left + done, done, {}
        kept = f", {done} already there" if done else " to do"
        self._console.print(f"{title}: {self._total}{kept}")

    def running(self, cases: Sequence[Request]) -> None:
        """Say which cases run now."""
        now = time.monotonic()
        self._since = {case.id: self._since.get(case.id, (case, now)) for case in cases}
        if not cases and self._count < self._total:
            self._say_sometimes("no worker is there; waiting for one")

    def case(self, record: Record) -> None:
        """Report a case that has ended."""
        self._count += 1
        self._since.pop(record.id, None)
        status = status_of(record)
        self._console.print(
            Text.assemble(
                f"  [{self._count}/{self._total}] {record.case.method}  ",
                (status, "green" if status == "ok" else "yellow"),
                (f"  {seconds(record.seconds)}", "dim"),
            )
        )
        self._say_sometimes(self._summary())

    def visit(self, resolved: Resolved) -> None:
        """Say whose cases are timed now: the first of its problem's."""
        self.visited()
        self._since = {resolved.id: (resolved, time.monotonic())}
        self._say_sometimes(self._summary())

    def visited(self) -> None:
        """Say that the visit under way has ended."""
        self._count += len(self._since)
        self._since = {}

    def say(self, words: str) -> None:
        """Print a sentence."""
        self._console.print(words)

    @property
    def elapsed(self) -> float:
        """Seconds since the start."""
        return time.monotonic() - self._start

    def _summary(self) -> str:
        return f"{self._count} of {self._total} done, {len(self._since)} running"

    def _say_sometimes(self, words: str) -> None:
        if not self._live.is_started and time.monotonic() - self._told > EVERY:
            self._told = time.monotonic()
            self._console.print(f"  {words}")

    def _render(self) -> RenderableType:
        if not self._title:
            return ""
        bar = ProgressBar(total=max(self._total, 1), completed=self._count, width=24)
        head = Table.grid(padding=(0, 1))
        minutes, rest = divmod(int(self.elapsed), 60)
        head.add_row(
            self._title, bar, Text.assemble(f"{self._summary()}  ", (f"{minutes}:{rest:02d}", "dim"))
        )
        lines = Table.grid(padding=(0, 2))
        now = time.monotonic()
        shown = sorted(self._since.values(), key=lambda item: item[1])
        for case, since in shown[:SHOWN]:
            ran = Text(f"{now - since:.0f} s", style="dim", justify="right")
            lines.add_row("  ", Text(case.case.method), Text(case.case.problem, style="dim"), ran)
        if len(shown) > SHOWN:
            lines.add_row("  ", f"and {len(shown) - SHOWN} more")
        return Group(head, lines)
