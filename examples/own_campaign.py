"""A problem of one's own, swing/swing.py, in a campaign, swing/swing.toml: with references and a report."""

import tempfile
from pathlib import Path

from hbvm_bench import cli
from hbvm_bench.measure import reading
from hbvm_bench.store.store import Store

CAMPAIGN = Path(__file__).parent / "swing" / "swing.toml"


def main() -> None:
    """Do what `hbvm-bench run swing.toml --report report` does, and read a number of the results."""
    with tempfile.TemporaryDirectory() as folder:
        run, report = Path(folder) / "run", Path(folder) / "report"
        code = cli.main(["run", str(CAMPAIGN), "--out", str(run), "--report", str(report)])
        print("exit code:", code, "report:", (report / "index.html").is_file())
        for record in reading.records(Store(run)):
            position = record.result.metrics["position_end"].value
            print(f"{record.case.method} on {record.case.problem}: position {position:.1e}")


if __name__ == "__main__":
    main()
