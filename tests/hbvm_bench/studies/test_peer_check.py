"""Every peer through the bench beside its library alone: the same steps to the same end."""

from dataclasses import replace

import msgspec
import numpy as np
import pytest

import integrators.registry
from hbvm_bench import cli
from hbvm_bench.campaign.file import Case, load, name_of
from hbvm_bench.campaign.identity import make_method, make_problem, resolve
from hbvm_bench.campaign.shorter import chosen
from hbvm_bench.campaign.spec import Spec, parse_spec
from hbvm_bench.measure import batch
from hbvm_bench.store.records import Compile, Counters, Record, Result, Timing, TimingRound
from hbvm_bench.store.store import Store
from hbvm_bench.studies.peers import alone, blocks
from hbvm_bench.studies.peers.blocks import ALONE, Pair
from hbvm_bench.summaries.rows import Task
from integrators.protocol import Status
from problems.errors import InputError

for library in ("heyoka", "rebound", "diffrax"):
    pytest.importorskip(library)

CAMPAIGN = load("peers")
# Of diffrax's methods, which share their code and compile for seconds, two are enough.
SLOW = ("LeapfrogMidpoint", "ReversibleHeun", "Dopri8(h=", "Kvaerno5", "Tsit5")
SHARE = 0.020033  # of the span: some fifty steps and more, but of the short ones, the last one shortened
SHORT = (
    "cr3bp",
    "kepler(e=0.6, t_end=30.0)",
    "kepler(e=0.6, t_end=6.0)",
    "kepler(e=0.6, t_end=12.0)",
    "kepler(e=0.6, t_end=600.0)",
    "outer_solar_system(t_end=1200.0)",
    "kepler(e=0.6, t_end=300.0)",
    "outer_solar_system(t_end=600.0)",
)


def pairs():
    cases = [case for case in CAMPAIGN.cases() if case.ensemble is None]
    there = {(case.problem, case.method) for case in cases}
    for problem, method in sorted(there):
        if (problem, ALONE + method) in there:
            marks = [pytest.mark.slow] if method.startswith(SLOW) else []
            yield pytest.param(problem, method, marks=marks, id=f"{method} on {problem}")


def test_every_peer_that_is_registered_is_compared():
    registered = {
        name
        for name in integrators.registry.names()
        if integrators.registry.get(name).library != "hbvm-bench"
    }
    names = {parse_spec(case.method).name for case in CAMPAIGN.cases()}
    assert registered == set(alone.METHODS) == {name for name in names if not name.startswith(ALONE)}
    assert {ALONE + name for name in registered} == {name for name in names if name.startswith(ALONE)}


@pytest.mark.parametrize(("problem", "method"), list(pairs()))
def test_the_bench_takes_the_library_s_steps_to_its_end(problem, method):
    whole = make_problem(problem)
    if not problem.startswith(SHORT):
        spec = parse_spec(problem)
        t_end = SHARE * whole.t_end
        if method.startswith("WHFast512"):  # which ends with a whole step only
            t_end = np.floor(t_end / (h := make_method(method).h)) * h
        whole = make_problem(str(Spec(spec.name, spec.arguments | {"t_end": float(t_end)})))
    ends, steps = [], []
    for text in (method, ALONE + method):
        made = make_method(text)
        if reason := made.accepts(whole):
            assert method.startswith("WHFast512")
            pytest.skip(reason)
        stepper = made.compile(whole.system).start(whole.y0, whole.par, whole.t0)
        samples = stepper.advance(np.array([whole.t_end]), sample=made.to_end)
        assert samples.status is Status.FINISHED
        ends.append(samples.y[-1])
        steps.append(stepper.stats.steps)
    assert min(steps) >= 50
    assert steps[0] == steps[1] or "nbody" in method  # in momenta and in velocities
    # 0 but for REBOUND's fixed steps, whose clock we set anew: there 2e-12, from the last, shortened step
    assert np.abs(ends[0] - ends[1]).max() <= 1e-10 * np.abs(ends[1]).max()


def test_heyoka_s_own_batch_comes_to_the_same_ends():
    problem = make_problem("henon_heiles(energy=0.125, q2=0.1, t_end=20.0)")
    starts = problem.y0 * (1.0 + 0.01 * np.linspace(-1.0, 1.0, 5)[:, None])
    ours, theirs = (
        batch.integrate(make_method(text).compile(problem.system), starts, problem)
        for text in ("Taylor()", f"{ALONE}Taylor()")
    )
    assert np.array_equal(ours.y, theirs.y)
    assert ours.steps == theirs.steps


def test_a_method_of_no_study_is_refused():
    with pytest.raises(InputError, match="there is no study 'nobody'"):
        make_method("nobody:Taylor()")
    with pytest.raises(
        InputError, match=r"unknown name in the methods of peers\.alone 'Tailor'; did you mean 'Taylor'"
    ):
        make_method(f"{ALONE}Tailor()")


def test_the_library_alone_is_a_case_of_its_own_with_the_library_s_version():
    ids = {resolve(Case(problem="kepler()", method=text)).id for text in ("Taylor()", f"{ALONE}Taylor()")}
    assert len(ids) == 2
    case = resolve(Case(problem="kepler()", method=f"{ALONE}Taylor()"))
    assert (case.case.method, case.method.library) == (f"{ALONE}Taylor()", "heyoka")


def made_up(ratio=1.0, steps=5, seconds=0.03, difference=0.0):
    def record(method, seconds, steps):
        rounds = [
            TimingRound(samples=[seconds], repeats=1, compile=Compile(seconds=0.0, cached=None), number=i)
            for i in range(3)
        ]
        return Record(
            id="0" * 64,
            case=Case(problem="kepler(e=0.6)", method=method),
            role="peer",
            library="heyoka",
            order=None,
            result=Result(outcome="ok", status="finished", counters=Counters(steps=steps)),
            timing=Timing(rounds=rounds),
        )

    bench, other = record("Taylor()", ratio * seconds, 5), record(f"{ALONE}Taylor()", seconds, steps)
    return Pair(Task.from_case(bench.case), bench, other, difference)


@pytest.mark.parametrize(
    ("pair", "beyond"),
    [
        (made_up(1.04), False),
        (made_up(1.06), True),
        (made_up(1.1, seconds=0.0001), False),  # ten microseconds, of a very short run
        (made_up(1.5, seconds=0.0001), True),
        (made_up(steps=6), False),  # a last step that is shortened
        (made_up(steps=7), True),
        (made_up(difference=1e-7), False),  # a clock that is added up
        (made_up(difference=1e-5), True),
    ],
)
def test_a_row_is_marked_where_the_bench_costs_too_much_or_steps_differ(pair, beyond):
    assert pair.beyond is beyond
    assert blocks.healthy([pair]) is not beyond
    assert ("(beyond)" in blocks.table([pair]).rows[0][2]) is beyond


def test_a_peer_that_did_not_run_is_named_and_not_healthy():
    failed = msgspec.structs.replace(made_up().bench, result=Result(outcome="refused", reason="no AVX-512"))
    pair = replace(made_up(), bench=failed)
    assert pair.failed == "refused: no AVX-512"
    assert not blocks.healthy([pair])
    assert blocks.table([pair]).rows == []
    assert not blocks.healthy([])


@pytest.mark.slow
def test_the_command_runs_the_campaign_and_writes_its_page(monkeypatch, tmp_path, capsys):
    short = chosen(CAMPAIGN, ["kepler-dop853"])
    short = msgspec.structs.replace(short, ensembles=[])
    assert [name_of(entry) for entry in short.entries()] == ["kepler-dop853"]
    monkeypatch.setattr("hbvm_bench.commands.doctor.load", lambda name: short)
    code = cli.main(["doctor", "--peers", "--rounds", "2", "--out", str(tmp_path / "run")])
    assert code in (0, 1)  # this machine may be busy
    assert "DOP853" in capsys.readouterr().out
    assert "bench / alone" in (tmp_path / "run" / "report" / "report.md").read_text()
    records = Store(tmp_path / "run").records()
    assert [len(one.timing.rounds) for one in records] == [2, 2]
    bench, library = (one.result.counters.steps for one in records)
    assert abs(bench - library) <= blocks.A_STEP
    assert library >= 50
