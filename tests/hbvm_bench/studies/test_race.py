"""The race and its relatives: what they declare, and the commands that run them."""

import re
import signal
import subprocess
import sys
import time
from collections import Counter

import numpy as np
import pytest

from hbvm_bench.campaign.file import load, name_of
from hbvm_bench.campaign.identity import fixed_step, is_ours, make_method, make_problem, resolve
from hbvm_bench.campaign.shorter import QUICK_SHARE, chosen, quick_run
from hbvm_bench.cli import main
from hbvm_bench.reference import solutions
from hbvm_bench.summaries.frame import ADAPTIVE, FIXED, OURS, step_size_of
from hbvm_bench.summaries.points import PROJECTION, family_named
from problems.errors import UnknownNameError

DECLARED = load("race")
KEYS = [name_of(entry) for entry in DECLARED.entries()]
SETTINGS, QUICK_SETTINGS = 16, 6


def row_of(case):
    family = family_named(case.method)
    ours = is_ours(make_method(case.method)) and family != PROJECTION
    return OURS if ours else family, step_size_of(case.method)


def cases(key, *, quick=False):
    campaign = chosen(DECLARED, [key])
    return (quick_run(campaign) if quick else campaign).cases()


@pytest.mark.parametrize("key", KEYS)
def test_every_family_has_as_many_settings_half_of_either_kind_and_none_twice(key):
    here = cases(key)
    rows = Counter(map(row_of, here))
    families = Counter(row_of(case)[0] for case in here)
    assert set(families.values()) == {SETTINGS}
    of_both = [(family, kind) for family in (OURS, "IAS15") for kind in (FIXED, ADAPTIVE)]
    assert {rows[row] for row in of_both} == {SETTINGS // 2}
    assert len({resolve(case).id for case in here}) == len(here)
    of_kind = [{family for family, kind in rows if kind == one} for one in (FIXED, ADAPTIVE)]
    assert of_kind[0] & of_kind[1] == {OURS, "IAS15"}
    quick = cases(key, quick=True)
    assert set(Counter(row_of(case)[0] for case in quick).values()) == {QUICK_SETTINGS}
    assert {case.method for case in quick} <= {case.method for case in here}


@pytest.mark.parametrize("key", KEYS)
def test_the_problem_has_a_stored_reference_at_both_ends(key):
    (problem,) = {case.problem for case in cases(key)}
    (short,) = {case.problem for case in cases(key, quick=True)}
    whole, part = make_problem(problem), make_problem(short)
    for made in (whole, part):
        stored = solutions.find(made)
        assert stored is not None
        assert made.t_end in stored.t
        assert "check" in stored.provenance
        assert np.array_equal(stored.high[0], made.y0)
        assert np.max(np.abs(stored.low[0])) < 1e-30  # the 128-bit number was written in decimal
    assert part.t_end == pytest.approx(whole.t0 + QUICK_SHARE * (whole.t_end - whole.t0))


@pytest.mark.parametrize("key", ["outer_solar_system", "sitnikov", "kepler", "henon_heiles", "fput32"])
def test_a_fixed_step_divides_the_span(key):
    for case in cases(key):
        h = fixed_step(make_method(case.method))
        if h:
            steps = make_problem(case.problem).t_end / h
            assert abs(steps - round(steps)) < 1e-6


def test_samples_of_a_fixed_step_are_at_its_steps_and_end_at_the_end():
    case = cases("henon_heiles")[1]
    resolved = resolve(case)
    h = getattr(resolved.method, "h", 0.0)
    t = case.grid.times(resolved.problem, h)
    assert np.array_equal(t / h, np.rint(t / h))
    assert t[-1] == resolved.problem.t_end
    assert np.all(np.diff(t) > 0)
    assert t.size > 395  # of 400 cells: in few do two samples meet the same step


def test_samples_of_a_million_years_are_whole_years_with_the_powers_of_ten():
    (case, *_) = load("endure").cases()
    t = case.grid.times(resolve(case).problem)
    assert np.array_equal(t, np.rint(t))
    assert {1e4, 1e5, 1e6} <= set(t.tolist())
    assert np.all(np.diff(t) > 0)


def test_goals_are_about_families_that_run():
    for goal in DECLARED.goals:
        assert goal.only
        for key in goal.only:
            assert goal.against in {row_of(case)[0] for case in cases(key)}


def test_problems_are_chosen_in_the_order_of_declaration():
    assert [name_of(entry) for entry in chosen(DECLARED, ["kepler", "sitnikov"]).entries()] == [
        "sitnikov",
        "kepler",
    ]
    assert chosen(DECLARED, []).cases() == DECLARED.cases()
    with pytest.raises(UnknownNameError, match="kepler"):
        chosen(DECLARED, ["keppler"])


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["race", "--problem", "keppler"], "kepler"),
        (["race", "--rounds", "1"], "rounds"),
        (["race", "--out", "/proc/nowhere"], "cannot write"),
        (["race", "--speed"], "speed"),
        (["automatic", "-p", "keppler"], "did you mean 'kepler'"),
        (["endure", "--out", "/proc/nowhere"], "cannot write"),
    ],
)
def test_what_cannot_be_used_is_one_sentence_and_exit_code_2(arguments, words, capsys):
    assert main(arguments) == 2
    said = capsys.readouterr().err
    assert words in said
    assert said.count("\n") == 1


COMMAND = ["race", "--quick", "--problem", "kepler", "--rounds", "2"]


def stopped(directory, sent, sign):
    """Start a race, send a signal when so many of its cases have ended, and return its exit code."""
    command = [sys.executable, "-m", "hbvm_bench.cli", *COMMAND, "--out", str(directory)]
    with subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True) as race:
        assert race.stderr is not None
        for line in race.stderr:
            if re.search(sent, line):
                break
        race.send_signal(sign)
        begun = time.monotonic()
        said = race.stderr.read()
        code = race.wait(timeout=20)
    assert time.monotonic() - begun < 10
    assert "Traceback" not in said
    return code, said


def test_ctrl_c_ends_the_race_at_once_with_130(tmp_path):
    code, said = stopped(tmp_path, r"\[1/\d+\]", signal.SIGINT)
    assert code == 130
    assert "interrupted" in said


@pytest.mark.slow
def test_a_race_that_was_killed_goes_on_where_it_was(tmp_path, capsys):
    """Nothing is measured twice, whether it was measuring or timing."""
    pytest.importorskip("heyoka")
    stopped(tmp_path, r"\[3/\d+\]", signal.SIGKILL)
    code, _ = stopped(tmp_path, "round 1", signal.SIGKILL)
    assert code == -signal.SIGKILL
    assert main([*COMMAND, "--out", str(tmp_path)]) == 0
    assert "21, 21 already there" in capsys.readouterr().err
