"""What kind of processor times belong to, and numba's code restricted to another kind."""

import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import msgspec
import numpy as np
import pytest

from hbvm_bench.campaign.file import TimingPlan
from hbvm_bench.cli import main
from hbvm_bench.commands.publishing import report_on
from hbvm_bench.measure import machine, processor
from hbvm_bench.run import timing_pass
from hbvm_bench.store.records import Timing
from hbvm_bench.store.store import PACKED, Store, StoredRun, opened
from problems.errors import InputError
from tests.hbvm_bench.made_up_run import archived, record, timed
from tests.hbvm_bench.studies import made_up_studies
from tests.hbvm_bench.studies.made_up_studies import defaults as of

OLD = {"processor": "AMD EPYC", "cores": 2, "vector_instructions": "AVX-512"}
ZEN5 = OLD | {"llvm_processor": "znver5"}
ZEN4 = ZEN5 | {
    "llvm_processor": "znver4",
    "family": "AMD family 25, model 17",
    "vector_bits": 256,
    "clock_ghz": "3.7",
}


def test_this_machine_has_a_kind_with_measured_width_and_clock():
    here = machine.describe(measure=True)
    assert here["vector_bits"] in (64, 128, 256, 512)
    assert 0.5 < float(here["clock_ghz"]) < 10.0
    said = machine.sentence(here)
    for part in ("LLVM: ", "family", "-bit vector arithmetic", "GHz", str(here["llvm_processor"])):
        assert part in said


@pytest.mark.parametrize(("times", "bits"), [((2.0, 1.0), 0.5), ((1.0, 1.0), 1.0)])
def test_an_instruction_that_takes_two_of_half_the_width_is_not_taken_whole(times, bits, monkeypatch):
    wide, narrow = times
    taken = iter([wide, narrow, 1e-3] * processor.ROUNDS)
    monkeypatch.setattr(processor, "_time", lambda function: next(taken))
    processor.measured.cache_clear()
    try:
        assert processor.measured()["vector_bits"] == bits * processor._widest()
    finally:
        processor.measured.cache_clear()


def test_what_was_not_recorded_is_said_and_not_guessed():
    assert "width of the arithmetic not recorded" in machine.sentence(ZEN5)
    assert "znver5" in machine.sentence(ZEN5)
    assert "256-bit vector arithmetic, 3.7 GHz;" in machine.sentence(ZEN4)
    restricted = machine.sentence(ZEN4 | {"ours_built_for": "AVX2"})
    assert (
        "handed to REBOUND and SciPy) was restricted to AVX2, the code of the other libraries was not"
        in restricted
    )
    assert "not recorded" in machine.sentence({})


def test_a_kind_of_processor_is_said_once_with_the_range_of_its_clock():
    read = [ZEN4, ZEN4 | {"clock_ghz": "3.6"}, ZEN5, ZEN4 | {"clock_ghz": "3.65", "cores": 8}, ZEN5]
    first, second = machine.sentences(read)
    assert first == machine.sentence(ZEN4).replace("3.7 GHz", "3.6 to 3.7 GHz")
    assert second == machine.sentence(ZEN5)
    assert machine.sentences([ZEN4, ZEN4]) == [machine.sentence(ZEN4)]


def test_a_machine_is_itself_whatever_its_clock_says_today_and_what_older_results_lack():
    assert machine.same(ZEN4, ZEN4 | {"clock_ghz": "2.6", "vector_bits": 512})
    assert machine.same(OLD, ZEN4)
    assert not machine.same(ZEN5, ZEN4)
    assert not machine.same(ZEN4, ZEN4 | {"ours_built_for": "AVX2"})


PLAN = TimingPlan(rounds=2)


def test_the_timing_pass_goes_on_where_only_the_clock_differs():
    def is_timed(here):
        timing = Timing(plan=PLAN, machine=ZEN4, rounds=timed([1.0, 1.0]), process="1")
        return timing_pass._is_timed([record("HBVM()", timing=timing)], PLAN, here)

    assert is_timed(ZEN4 | {"clock_ghz": "2.6"})
    assert not is_timed(ZEN5)


RESTRICTED = """
from hbvm_bench.measure import machine
import problems
from integrators.kernel.native import binary
from tests.hbvm_bench.study_folders import module
assembly = module("costs", "budget").assembly
print(machine.describe().get("ours_built_for"))
print(machine.kind(machine.describe()))
print(assembly(problems.load("pendulum").system, "field", 8).count("zmm"))
print(binary.platform())
"""


def test_restricted_to_avx2_our_code_has_no_wide_registers_and_another_cache_key(tmp_path):
    if machine.describe()["vector_instructions"] != "AVX-512":
        pytest.skip("a processor without AVX-512 has nothing to be restricted")
    found, root = {}, Path(__file__).parents[3]
    for name, more in {"avx2": machine.restricted_to_avx2(), "all": {}}.items():
        environment = os.environ | {"HBVM_BENCH_CACHE": str(tmp_path)} | more
        ran = subprocess.run(
            [sys.executable, "-c", RESTRICTED],
            cwd=root,
            env=environment,
            capture_output=True,
            text=True,
            check=True,
        )
        found[name] = ran.stdout.splitlines()
    built, kind, wide, *key = found["avx2"]
    assert (built, wide) == ("AVX2", "0")
    assert kind.endswith("-avx2")
    _, _, others, *other = found["all"]
    assert int(others) > 0
    assert key != other


def test_a_processor_without_avx2_is_refused(monkeypatch, capsys):
    import llvmlite.binding as llvm

    monkeypatch.setattr(llvm, "get_host_cpu_features", dict)
    with pytest.raises(InputError, match="has no AVX2; leave --avx2 out"):
        machine.restricted_to_avx2()
    assert main(["race", "--quick", "--avx2"]) == 2
    assert "--avx2" in capsys.readouterr().err


def keep(run, directory):
    """Write the report of a run into a directory, as the command does."""
    with tempfile.TemporaryDirectory() as folder:
        store = Store(Path(folder))
        store.prepare()
        for one in run.records:
            store.save(one, {"t": np.arange(2.0), "y": np.zeros((2, 4))})
        store.write_index(run.index)
        return report_on([store], directory)


def text_in(directory):
    return (directory / "report.md").read_text(encoding="utf-8")


def test_results_of_several_kinds_lie_side_by_side(tmp_path):
    keep(of(ZEN4), tmp_path)
    keep(of(ZEN5, 3.0), tmp_path)
    keep(of(ZEN4, 1.25, "henon_heiles"), tmp_path)
    page = text_in(tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {PACKED, "report.md", "index.html", "figures"}
    goal = r"\| Kepler's problem, e = 0.6 \| time of Taylor .* \| .* \| ≥ 2 \| {}\.00× \(.*\) \| reached \|"
    assert all(re.search(goal.format(ratio), page) for ratio in (2, 3))
    assert "256-bit vector arithmetic" in page
    archived(tmp_path, msgspec.structs.replace(of(ZEN5), index=made_up_studies.race().index))
    with pytest.raises(InputError, match="has results of 'race'"):
        keep(of(ZEN4), tmp_path)


def test_a_number_stays_with_the_run_that_it_came_from(tmp_path):
    """Its machine, versions, command and date, when another problem is run on the same kind later."""
    first = of(ZEN4 | {"cores": 2})
    later = of(ZEN4 | {"cores": 64, "clock_ghz": "2.6"}, problem="henon_heiles")
    later = StoredRun(
        index=msgspec.structs.replace(later.index, command="hbvm-bench automatic henon_heiles"),
        records=[
            msgspec.structs.replace(one, versions={"numpy": "3"}, finished="2027-01-02T03:04:05+00:00")
            for one in later.records
        ],
    )
    keep(first, tmp_path)
    keep(later, tmp_path)
    assert [one.records() for one in opened([tmp_path])] == [first.records, later.records]
    page = text_in(tmp_path)
    assert "Measured on 2026-01-02 to 2027-01-02" in page
    assert "hbvm-bench automatic\n    hbvm-bench automatic henon_heiles" in page
    again = of(ZEN4)
    keep(again, tmp_path)
    assert [one.records() for one in opened([tmp_path])] == [later.records, again.records]


def test_arithmetic_of_another_width_is_another_kind():
    kinds = [machine.kind(ZEN5 | {"vector_bits": bits}) for bits in (512, 256)]
    assert kinds == ["znver5-512bit", "znver5-256bit"]
    assert [machine.words(kind) for kind in kinds] == ["Zen 5, 512-bit", "Zen 5, 256-bit"]
    restricted = machine.kind(ZEN4 | {"ours_built_for": "AVX2"})
    assert machine.words(restricted) == "Zen 4, 256-bit, restricted to AVX2"
