"""What is wrong in a campaign file: one sentence that names the file, before anything runs."""

import re

import pytest

from hbvm_bench import cli
from hbvm_bench.campaign import file as campaign
from hbvm_bench.run import checked, loop
from problems.errors import InputError

from .fault import Fault, is_met, sentence

PROBLEMS = 'problems = ["kepler()"]'
METHODS = 'methods = [{use = "HBVM(k=4,s=2,h=0.1)"}]'
WORDS = {
    "RIGHT": f'name = "x"\\n{PROBLEMS}\\n{METHODS}',  # what follows is wrong
    "BOTH": f'name = "x"\\n{PROBLEMS}\\nmethods = [{{use = ["HBVM()", "Taylor(tol=1e-15)"]}}]',
    "METHODS": f'name = "x"\\n{PROBLEMS}',  # the methods follow
    "PROBLEMS": f'name = "x"\\n{METHODS}',
    "ENSEMBLE": 'problem = "kepler()"\\nmethods = [{use = "Gauss(s=2,h=0.1)"}]',
    "MANY": str(list(range(1, 1001))),
    "DEEP": "[" * 3000,
}

TABLE = r"""
                                                             => Object missing required field `name`
name                                                         => not valid TOML: Expected '=' after a key in a
name =                                                       => not valid TOML: Invalid value (at end of
[[[                                                          => not valid TOML: Invalid initial character for
x = DEEP                                                     => lists or tables are nested too deep, for a
name = "x"                                                   => campaign 'x' has no problems; give at least
METHODS                                                      => campaign 'x' has no methods; give at least
PROBLEMS                                                     => campaign 'x' has no problems; give at least
problems = ["kepler()"]\nmethods = [{use = "HBVM(k=4,s=2,h=0.1)"}] => Object missing required field `name`
RIGHT\nnmae = "y"                                            => unknown key 'nmae'; did you mean 'name' or
RIGHT\ntitle = 3                                             => Expected `str`, got `int`, at `title`
RIGHT\ndescription = []                                      => Expected `str`, got `array`, at `description`
name = 3\nproblems = ["kepler()"]\nmethods = [{use = "HBVM(k=4,s=2,h=0.1)"}] => Expected `str`, got `int`, at
name = ""\nproblems = ["kepler()"]\nmethods = [{use = "HBVM(k=4,s=2,h=0.1)"}] => campaign name '' must be a
name = "../x"\nproblems = ["kepler()"]\nmethods = [{use = "HBVM(k=4,s=2,h=0.1)"}] => campaign name '../x'
name = ".x"\nproblems = ["kepler()"]\nmethods = [{use = "HBVM(k=4,s=2,h=0.1)"}] => campaign name '.x' must be
name = "a b"\nproblems = ["kepler()"]\nmethods = [{use = "HBVM(k=4,s=2,h=0.1)"}] => campaign name 'a b' must
PROBLEMS\nproblems = "kepler()"                              => Expected `array`, got `str`, at `problems`
PROBLEMS\nproblems = []                                      => campaign 'x' has no problems; give at least
PROBLEMS\nproblems = [3]                                     => Expected `str | object`, got `int`, at
PROBLEMS\nproblems = [[]]                                    => Expected `str | object`, got `array`, at
PROBLEMS\nproblems = {}                                      => Expected `array`, got `object`, at `problems`
PROBLEMS\nproblems = [""]                                    => an empty specification; write a name or a
PROBLEMS\nproblems = ["keplr()"]                             => unknown problem 'keplr'; did you mean
PROBLEMS\nproblems = ["kepler(e=2)"]                         => e=2 of kepler must be an eccentricity, 0 <= e
PROBLEMS\nproblems = ["kepler(ee=0.6)"]                      => unknown argument of kepler 'ee'; did you mean
PROBLEMS\nproblems = ["kepler("]                             => cannot read 'kepler(': this is not one call
PROBLEMS\nproblems = ["kepler(0.6)"]                         => cannot read 'kepler(0.6)': arguments are
PROBLEMS\nproblems = ["fput(n=100000000)"]                   => the limit is
PROBLEMS\nproblems = ["lennard_jones(rings=1000)"]           => the limit is
PROBLEMS\nproblems = ["kepler()", "kepler()"]                => HBVM(k=4, s=2, h=0.1) on kepler(e=0.6) is
PROBLEMS\nproblems = [{}]                                    => Object missing required field `use`, at
PROBLEMS\nproblems = [{use = 3}]                             => Expected `str`, got `int`, at
PROBLEMS\nproblems = [{us = "kepler()"}]                     => unknown key 'us'; did you mean 'use' or
PROBLEMS\nproblems = [{use = "kepler()", grid = 3}]          => Expected `object | null`, got `int`, at
PROBLEMS\nproblems = [{use = "kepler()", grid = {count = 0}}] => Expected `int` >= 1, at
PROBLEMS\nproblems = [{use = "kepler()", values = 3}]        => Expected `object`, got `int`, at
PROBLEMS\nproblems = [{use = "kepler()", values = {a = {}}}] => Expected `int | float | str | array`, got
PROBLEMS\nproblems = [{use = "kepler()", values = {a = true}}] => Expected `int | float | str | array`, got
PROBLEMS\nproblems = [{use = "kepler(e={e})"}]               => unknown value in kepler(e={e}) 'e'; there are
PROBLEMS\nproblems = [{use = "kepler()", sweep = {e = [0.1]}}] => kepler(): the sweep gives values of 'e',
PROBLEMS\nproblems = [{use = "kepler(e={e})", sweep = {e = []}}] => Expected `array` of length >= 1, at
PROBLEMS\nproblems = [{use = "kepler(e={e})", sweep = {e = 3}}] => Expected `array`, got `int`, at
PROBLEMS\nproblems = [{use = "kepler(e={e})", sweep = {e = ["a"]}}] => e='a' of kepler must be an eccentr
PROBLEMS\nproblems = [{use = "kepler(e={e*2})", sweep = {e = ["a"]}}] => kepler(e={e*2}): {e*2} multiplies
PROBLEMS\nproblems = [{use = "kepler(e={e+2})", sweep = {e = [0.1]}}] => kepler(e={e+2}): the sweep gives
PROBLEMS\nproblems = [{use = "kepler(e={e})", sweep = {e = [nan]}}] => cannot read 'kepler(e=nan)': a value
PROBLEMS\nproblems = [{use = "kepler(e={e})", sweep = {e = [inf]}}] => cannot read 'kepler(e=inf)': a value
PROBLEMS\nproblems = [{use = "kepler()", end = []}]           => Expected `array` of length >= 1, at
PROBLEMS\nproblems = [{use = "kepler()", end = 3}]            => Expected `array | null`, got `int`, at
PROBLEMS\nproblems = [{use = "kepler()", end = [1], reference = true}] => end= of kepler() is its
PROBLEMS\nproblems = [{use = "kepler()", end = [1, 2]}]      => end=[1.0, 2.0] of kepler(e=0.6) must be 4 fini
PROBLEMS\nproblems = [{use = "kepler()", end = [1, 2, 3, nan]}] => end=[1.0, 2.0, 3.0, nan] of kepler(e=0.6) m
PROBLEMS\nproblems = [{use = "kepler(e={e})", end = [1], sweep = {e = [0.1]}}] => end= of kepler(e={e}) is of
PROBLEMS\nproblems = [{use = "kepler(e={})"}]                => kepler(e={}): '' in a placeholder is neither
PROBLEMS\nproblems = [{use = "kepler(e={e)", sweep = {e = [0.1]}}] => cannot read 'kepler(e={e)': this is not
METHODS\nmethods = [{use = "HBVM(k={k},s={s},h={h})", sweep = {k = MANY, s = MANY, h = MANY}}] => the limit is
METHODS\nmethods = "HBVM()"                                  => Expected `array`, got `str`, at `methods`
METHODS\nmethods = []                                        => campaign 'x' has no methods; give at least
METHODS\nmethods = ["HBVM()"]                                => Expected `object`, got `str`, at `methods[0]`
METHODS\nmethods = [3]                                       => Expected `object`, got `int`, at `methods[0]`
METHODS\nmethods = [{}]                                      => Object missing required field `use`, at
METHODS\nmethods = [{use = 3}]                               => Expected `str | array`, got `int`, at
METHODS\nmethods = [{use = ""}]                              => an empty specification; write a name or a
METHODS\nmethods = [{use = "HBVN()"}]                        => HBVN(): unknown method 'HBVN'; did you mean
METHODS\nmethods = [{use = "HBVM(kk=3)"}]                    => HBVM(kk=3): unknown option of HBVM 'kk'; did
METHODS\nmethods = [{use = "HBVM(1,2)"}]                     => cannot read 'HBVM(1,2)': arguments are given
METHODS\nmethods = [{use = "Gauss(h=0.1)"}]                  => Gauss(h=0.1): Gauss needs s; give a value as
METHODS\nmethods = [{use = "HBVM(k=2000,s=2,h=0.1)"}]        => the limit is
METHODS\nmethods = [{use = "HBVM(k=4,s=2,h=-1)"}]            => HBVM(k=4, s=2, h=-1): h=-1 of HBVM must be
METHODS\nmethods = [{use = "HBVM(k=4,s=2,h={h})"}]           => unknown value in HBVM(k=4,s=2,h={h}) 'h';
METHODS\nmethods = [{use = "HBVM()"}, {use = "HBVM()"}]      => HBVM(tol=3e-16) on kepler(e=0.6) is given
METHODS\nmethods = [{use = "HBVM()", settings = "best"}]     => unknown settings 'best'; known: as published,
METHODS\nmethods = [{use = "HBVM()", settings = 3}]          => unknown settings '3'; known: as published,
METHODS\nmethods = [{use = "HBVM()", note = 3}]              => Expected `str`, got `int`, at
METHODS\nmethods = [{use = "HBVM()", only = "kepler"}]       => Expected `array`, got `str`, at
METHODS\nmethods = [{use = "HBVM()", only = ["keplr"]}]      => unknown problem of the campaign 'keplr'; did
METHODS\nmethods = [{use = "HBVM()", only = [3]}]            => Expected `str`, got `int`, at
METHODS\nmethods = [{use = "HBVM()", sweep = {k = [1]}}]     => HBVM(): the sweep gives values of 'k', which
METHODS\nmethods = [{use = "HBVM()", sweep = 3}]             => Expected `object`, got `int`, at
METHODS\nmethods = [{use = "HBVM()", role = "ours"}]         => unknown key 'role'; did you mean 'only' or
METHODS\nmethods = [{use = "HBVM(tol={t})", sweep = {t = [true]}}] => Expected `int | float | str | array`,
METHODS\nmethods = [{use = "HBVM(tol={t})", sweep = {t = [1979-05-27]}}] => Expected `int | float | str |
METHODS\nmethods = [{use = "HBVM(tol={t})", sweep = {t = [[1e-9]]}}] => Expected `str`, got `float`, at
RIGHT\ngrid = 3                                              => Expected `object`, got `int`, at `grid`
RIGHT\ngrid = []                                             => Expected `object`, got `array`, at `grid`
RIGHT\n[grid]\nstep = 0                                      => Expected `float` > 0.0, at `grid.step`
RIGHT\n[grid]\nstep = -1                                     => Expected `float` > 0.0, at `grid.step`
RIGHT\n[grid]\nstep = "a"                                    => Expected `float | null`, got `str`, at
RIGHT\n[grid]\nstep = nan                                    => Expected `float` > 0.0, at `grid.step`
RIGHT\n[grid]\nstep = inf                                    => Expected `float` <= 1e+300, at `grid.step`
RIGHT\n[grid]\nstep = 1e-12                                  => the limit is
RIGHT\n[grid]\nstep = 1e-320                                 => the limit is
RIGHT\n[grid]\ncount = 0                                     => Expected `int` >= 1, at `grid.count`
RIGHT\n[grid]\ncount = 1.5                                   => Expected `int | null`, got `float`, at
RIGHT\n[grid]\ncount = "a"                                   => Expected `int | null`, got `str`, at
RIGHT\n[grid]\ncount = 1000000000000                         => the limit is
RIGHT\n[grid]\ncount = 1000000000000\nspacing = "irregular"  => the limit is
RIGHT\n[grid]\ncount = 1000000000000\nspacing = "log"        => the limit is
RIGHT\n[grid]\ncount = 10\nstep = 1                          => a grid has a step or a count, not both, at
RIGHT\n[grid]\nspacing = "even"                              => Invalid enum value 'even', at `grid.spacing`
RIGHT\n[grid]\nspacing = 3                                   => Expected `str`, got `int`, at `grid.spacing`
RIGHT\n[grid]\nspacing = "log"\nstep = 1                     => a grid with spacing='log' has a count, not a
RIGHT\n[grid]\nfirst = 1                                     => first= belongs to a grid with spacing='log',
RIGHT\n[grid]\nspacing = "log"\nfirst = 1e9                  => a grid that begins at first=1000000000.0 lies
RIGHT\n[grid]\nspacing = "log"\nfirst = -1                   => Expected `float` > 0.0, at `grid.first`
RIGHT\n[grid]\nspacing = "log"\nfirst = nan                  => Expected `float` > 0.0, at `grid.first`
RIGHT\n[grid]\ncuont = 3                                     => unknown key 'cuont'; did you mean 'count'?
RIGHT\n[grid]\ncount = true                                  => Expected `int | null`, got `bool`, at
RIGHT\nlimits = 3                                            => Expected `object`, got `int`, at `limits`
RIGHT\n[limits]\nwall_seconds = 0                            => Expected `float` >= 0.1, at
RIGHT\n[limits]\nwall_seconds = -1                           => Expected `float` >= 0.1, at
RIGHT\n[limits]\nwall_seconds = "a"                          => Expected `float`, got `str`, at
RIGHT\n[limits]\nwall_seconds = nan                          => Expected `float` >= 0.1, at
RIGHT\n[limits]\nwall_seconds = inf                          => Expected `float` <= 1e+300, at
RIGHT\n[limits]\nmemory_gib = 0                              => Expected `float` >= 0.1, at
RIGHT\n[limits]\nmemory_gib = nan                            => Expected `float` >= 0.1, at
RIGHT\n[limits]\nmemory_gib = inf                            => Expected `float` <= 1e+300, at
RIGHT\n[limits]\nmemory = 3                                  => unknown key 'memory'; did you mean
RIGHT\n[limits]\nmemory_gib = []                             => Expected `float`, got `array`, at
RIGHT\ntiming = true                                         => Expected `object`, got `bool`, at `timing`
RIGHT\n[timing]\nrounds = -1                                 => Expected `int` >= 0, at `timing.rounds`
RIGHT\n[timing]\nrounds = 1.5                                => Expected `int`, got `float`, at
RIGHT\n[timing]\nrounds = "a"                                => Expected `int`, got `str`, at `timing.rounds`
RIGHT\n[timing]\nrounds = 1000000000000                      => Expected `int` <= 10000, at `timing.rounds`
RIGHT\n[timing]\nshortest = 0                                => Expected `float` > 0.0, at `timing.shortest`
RIGHT\n[timing]\nshortest = nan                              => Expected `float` > 0.0, at `timing.shortest`
RIGHT\n[timing]\nshortest = inf                              => Expected `float` <= 1e+300, at
RIGHT\n[timing]\nbudget = -1                                 => Expected `float` > 0.0, at `timing.budget`
RIGHT\n[timing]\nbudget = nan                                => Expected `float` > 0.0, at `timing.budget`
RIGHT\n[timing]\nround = 3                                   => unknown key 'round'; did you mean 'rounds'
RIGHT\nchecks = 3                                            => Expected `object`, got `int`, at `checks`
RIGHT\n[checks]\nstarts = -1                                 => Expected `int` >= 0, at `checks.starts`
RIGHT\n[checks]\nstarts = 1001                               => Expected `int` <= 1000, at `checks.starts`
RIGHT\n[checks]\nstarts = 1.5                                => Expected `int`, got `float`, at
RIGHT\n[checks]\nreversal = 2                                => Expected `float` <= 1.0, at `checks.reversal`
RIGHT\n[checks]\nreversal = -0.1                             => Expected `float` >= 0.0, at `checks.reversal`
RIGHT\n[checks]\nreversal = "a"                              => Expected `float`, got `str`, at
RIGHT\n[checks]\nreversal = nan                              => Expected `float` >= 0.0, at `checks.reversal`
RIGHT\n[checks]\nchaos = 1                                  => Expected `bool`, got `int`, at `checks.chaos`
RIGHT\n[checks]\nstart = 3                                   => unknown key 'start'; did you mean 'starts'?
RIGHT\n[limits]\nmemory_gib = 1e-6                            => Expected `float` >= 0.1, at
RIGHT\n[limits]\nwall_seconds = 1e-6                          => Expected `float` >= 0.1, at
RIGHT\n[limits]\ncompile_seconds = 0.01                       => Expected `float` >= 0.1, at
RIGHT\n[grid]\nalso = [1e99]                                  => also=1e+99 of the grid of kepler lies beyond
RIGHT\n[grid]\nalso = [-1]                                    => Expected `float` > 0.0, at `grid.also[0]`
RIGHT\n[grid]\nstep = 1e99                                    => step=1e+99 of the grid of kepler lies beyond
RIGHT\n[grid]\nmultiple_of = 1e99                             => multiple_of=1e+99 of the grid of kepler lies
PROBLEMS\nproblems = [{use = "kepler()", grid = {also = [1e9]}}] => also=1000000000.0 of the grid of kepler li
RIGHT\n[timing]\nshortest = 1e-4                              => shortest=0.0001 of timing is too short for a
RIGHT\n[page]\nseries = ["drift.enrgy"]                      => unknown series of the campaign's cases
RIGHT\n[page]\nseries = ["error.energy", "guard.x"]          => unknown series of the campaign's cases
METHODS\nmethods = [{use = []}]                               => Expected `array` of length >= 1, at
METHODS\nmethods = [{use = ["HBVM()", "IAS15()"], quick = [2]}] => there is no setting 2; there are 2, counted
METHODS\nmethods = [{use = ["HBVM()", "IAS15()"], quick = [-1]}] => there is no setting -1; there are 2, count
name = "x"\nproblems = ["kepler()", "morse()"]\nmethods = [{use = "HBVM()", only = ["kepler"]}] => no method
PROBLEMS\nproblems = [{use = "kepler()", within = {positon_end = 1}}] => unknown metric 'positon_end'; did you
PROBLEMS\nproblems = [{use = "kepler()", within = {distance_max = 1}}] => the metric 'distance_max' cannot be
BOTH\n[[goals]]\nat = 1\nwithin = {positon_end = 1}           => unknown metric 'positon_end'; did you mean
BOTH\n[[goals]]\nat = 1\nmetric = "warm_second"               => unknown metric 'warm_second'; did you mean
BOTH\n[[goals]]\nat = -1                                      => Expected `float` >= 0.0, at `goals[0].at`
BOTH\n[[goals]]\nat = nan                                     => Expected `float` >= 0.0, at `goals[0].at`
BOTH\n[[goals]]\nat = 1\nno_worse = {energy_max = 1}          => no_worse= of a goal belongs to against= and
BOTH\n[[goals]]\nat = 1\nmethod = "HBMV"                      => unknown method of ours 'HBMV'; did you mean
BOTH\n[[goals]]\nat = 1\nmethod = "Taylor"                    => unknown method of ours 'Taylor'; known: HBVM,
BOTH\n[[goals]]\nratio = 2\nagainst = "Tailor"                => unknown peer that the goal's problems have 'T
BOTH\n[[goals]]\nratio = 2\nagainst = "HBVM"                  => unknown peer that the goal's problems have 'H
BOTH\n[[goals]]\nratio = 2\nagainst = "Taylor(tol=1e-9)"      => did you mean 'Taylor(tol=1e-15)'
BOTH\n[[goals]]\nratio = 2\nagainst = "Taylor"\nno_worse = {enrgy_max = 1} => unknown metric 'enrgy_max'; did
BOTH\n[timing]\nrounds = 0\n[[goals]]\nratio = 2\nagainst = "Taylor" => a goal asks for warm_seconds, and timi
RIGHT\n[[goals]]\nratio = 2\nagainst = "Taylor"               => a goal's problems have no peer; give a method
RIGHT\nensembles = 3                                         => Expected `array`, got `int`, at `ensembles`
RIGHT\nensembles = [3]                                       => Expected `object`, got `int`, at
RIGHT\n[[ensembles]]                                         => Object missing required field `problem`, at
RIGHT\n[[ensembles]]\ncount = 10                             => Object missing required field `problem`, at
RIGHT\n[[ensembles]]\nENSEMBLE                               => Object missing required field `count`, at
RIGHT\n[[ensembles]]\nENSEMBLE\ncount = 0                    => count=0 of an ensemble must be at least 1, at
RIGHT\n[[ensembles]]\nENSEMBLE\ncount = -1                   => count=-1 of an ensemble must be at least 1,
RIGHT\n[[ensembles]]\nENSEMBLE\ncount = 1.5                  => Expected `int`, got `float`, at
RIGHT\n[[ensembles]]\nENSEMBLE\ncount = "a"                  => Expected `int`, got `str`, at
RIGHT\n[[ensembles]]\nENSEMBLE\ncount = 1000000000           => the limit is
RIGHT\n[[ensembles]]\nENSEMBLE\ncount = 100000000000000000000000 => the limit is
RIGHT\n[[ensembles]]\nENSEMBLE\ncount = 10\nspread = 0       => Expected `float` > 0.0, at
RIGHT\n[[ensembles]]\nENSEMBLE\ncount = 10\nspread = -1      => Expected `float` > 0.0, at
RIGHT\n[[ensembles]]\nENSEMBLE\ncount = 10\nspread = nan     => Expected `float` > 0.0, at
RIGHT\n[[ensembles]]\nENSEMBLE\ncount = 10\nspread = inf     => Expected `float` <= 1.0, at
RIGHT\n[[ensembles]]\nENSEMBLE\ncount = 10\nspread = "a"     => Expected `float`, got `str`, at
RIGHT\n[[ensembles]]\nENSEMBLE\ncuont = 10                   => unknown key 'cuont'; did you mean 'count'?
RIGHT\n[[ensembles]]\nENSEMBLE\ncount = 10\nspread = 2       => Expected `float` <= 1.0, at
RIGHT\n[[ensembles]]\nENSEMBLE\ncount = 10\nname = "../x"    => problem name '../x' must be a file name of
RIGHT\n[[ensembles]]\nENSEMBLE\ncount = 10\nvary = {m = 0.1} => unknown parameter of kepler 'm'
RIGHT\n[[ensembles]]\nproblem = "kepler()"\ncount = 9\nmethods = [{use = "HBVM()", only = ["x"]}] => only=['x'
RIGHT\n[[ensembles]]\nproblem = 3\nmethods = []\ncount = 10  => Expected `str`, got `int`, at
RIGHT\n[[ensembles]]\nproblem = "kepler()"\nmethods = []\ncount = 10 => Expected `array` of length >= 1, at
"""


def written(text: str) -> str:
    """Return the file that a row stands for."""
    for word, meaning in WORDS.items():
        text = text.replace(word, meaning)
    return text.replace("\\n", "\n")


def checks(asked) -> None:
    """Check a campaign as the command does before it runs."""
    checked.check(asked, loop.plan(asked))


def fault(line: str) -> Fault:
    """Return a row of the table."""
    text, says = (part.strip() for part in line.split(" => "))
    return Fault(text, lambda: checks(campaign.parse(written(text))), re.escape(says))


@pytest.mark.parametrize("row", [fault(line) for line in TABLE.strip("\n").splitlines()], ids=str)
def test_one_sentence(row):
    is_met(row)


@pytest.mark.parametrize("text", ["x = DEEP", "RIGHT\\n[grid]\\ncount = 0"])
def test_the_command_line_names_the_file(text, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.toml").write_text(written(text))
    assert cli.main(["run", "mine.toml"]) == 2
    sentence(capsys.readouterr().err, "hbvm-bench: mine.toml: ")
    assert [path.name for path in tmp_path.iterdir()] == ["mine.toml"]


def test_a_limit_can_be_raised(monkeypatch):
    text = written("METHODS\\n" + 'methods = [{use = "HBVM(tol={t})", sweep = {t = [1e-6, 1e-7, 1e-8]}}]')
    monkeypatch.setenv("HBVM_BENCH_MAX_CASES", "2")
    with pytest.raises(InputError, match=r"'x' has 3 cases, and the limit is 2; .*HBVM_BENCH_MAX_CASES"):
        campaign.parse(text).cases()
    monkeypatch.setenv("HBVM_BENCH_MAX_CASES", "3")
    assert len(campaign.parse(text).cases()) == 3
    monkeypatch.setenv("HBVM_BENCH_MAX_CASES", "many")
    with pytest.raises(InputError, match="HBVM_BENCH_MAX_CASES='many' must be a positive number"):
        campaign.parse(text).cases()
