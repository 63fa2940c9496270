"""What is typed wrongly on the command line: one sentence, exit code 2, nothing written."""

import shlex
import subprocess
import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path

import pytest
from packaging.requirements import Requirement

from hbvm_bench import cli

from .fault import sentence

RUN = 'run -p "kepler()" -m "HBVM(k=4, s=2, h=0.1)"'


@dataclass(frozen=True)
class Typed:
    """One row: the words that are typed, and what is said on stderr."""

    words: str
    says: str

    def __str__(self) -> str:
        return self.words

    @property
    def arguments(self) -> list[str]:
        """What the shell makes of the words; RUN stands for a run that would be right."""
        return shlex.split(self.words.replace("RUN", RUN, 1) if self.words.startswith("RUN") else self.words)


TABLE = r"""
lst                                                        | No such command 'lst'. Did you mean 'list'?
list problms                                               | unknown list 'problms'; did you mean
list problems methods                                      | Got unexpected extra argument(s) (methods)
list --foo                                                 | No such option: --foo
--foo                                                      | No such option: --foo
-x                                                         | No such option: -x
run                                                        | give a campaign, or at least one -p
run ""                                                     | unknown campaign ''; known:
run sitnikof                                               | unknown campaign 'sitnikof'; did you mean
run missing.toml                                           | there is no campaign file 'missing.toml'
run .                                                      | the folder '.' has no study.toml
run .toml                                                  | unknown campaign '.toml'; known:
run /                                                      | the folder '/' has no study.toml
run /dev/null                                              | unknown campaign '/dev/null'; known:
run sitnikov sitnikov                                      | Got unexpected extra argument(s) (sitnikov)
run sitnikov --jobs 0                                      | Invalid value for '--jobs': Input should be
run sitnikov --jobs -1                                     | Invalid value for '--jobs': Input should be
run sitnikov --jobs a                                      | Invalid value for '--jobs': Input should be a
run sitnikov --jobs 1.5                                    | Invalid value for '--jobs': Input should be a
run sitnikov --step 1                                      | give either a campaign or -m, --step and
run sitnikov --executor nowhere                            | there is no executor 'nowhere'; give local,
RUN --executor nowhere                                     | there is no executor 'nowhere'; give local,
RUN --executor no.such:thing                               | there is no executor 'no.such:thing': No module
RUN --executor os:path                                     | os:path cannot be made: 'module' object is not
RUN --executor math:sin                                    | math:sin cannot be made: math.sin() takes
RUN --executor ":"                                         | there is no executor ':': Empty module name
RUN --executor ""                                          | there is no executor ''; give local,
RUN --out /dev/null/x                                      | cannot write to the directory
RUN --out /proc/x                                          | cannot write to the directory '/proc/x': No such
RUN --out /etc/passwd                                      | '/etc/passwd' is no store of results: file is
RUN --out x --report /dev/null/x                           | cannot write to the directory '/dev/null/x':
RUN --step 1e-9                                            | the limit is
RUN --step 1e-320                                          | the limit is
RUN --step 0                                               | --step must be a positive number, not 0.0
RUN --step inf                                             | --step must be a positive number, not inf
RUN --step abc                                             | Invalid value for '--step': Input should be a
RUN --timing yes                                           | give either a campaign or -m, --step and
RUN -p "kepler()"                                          | HBVM(k=4, s=2, h=0.1) on kepler(e=0.6) is given
run -p "kepler()" -m ""                                    | an empty specification; write a name or a call
run -p "" -m "IAS15()"                                     | an empty specification; write a name or a call
run -p "kepler" -m "HBVM(1,2)"                             | cannot read 'HBVM(1,2)': arguments are given by
run -p "kepler(0.6)" -m "IAS15()"                          | cannot read 'kepler(0.6)': arguments are given
run -p "kepler(e=0.6" -m "IAS15()"                         | cannot read 'kepler(e=0.6': this is not one
run -p "kepler(e=0.6))" -m "IAS15()"                       | cannot read 'kepler(e=0.6))': this is not one
run -p "kepler(e=2)" -m "IAS15()"                          | e=2 of kepler must be an eccentricity, 0 <= e <
run -p "kepler(e=1/2)" -m "IAS15()"                        | cannot read 'kepler(e=1/2)': a value is a
run -p "kepler(e=nan)" -m "IAS15()"                        | cannot read 'kepler(e=nan)': a value is a
run -p "kepler(e=x)" -m "IAS15()"                          | cannot read 'kepler(e=x)': a value is a number,
run -p "kepler(e=0.6, e=0.7)" -m "IAS15()"                 | cannot read 'kepler(e=0.6, e=0.7)': 'e' is
run -p "kepler(**{})" -m "IAS15()"                         | cannot read 'kepler(**0)': ** is not allowed
run -p "kepler()()" -m "IAS15()"                           | cannot read 'kepler()()': the name must be one
run -p "kepler.kepler()" -m "IAS15()"                      | cannot read 'kepler.kepler()': the name must be
run -p "__import__('os')" -m "IAS15()"                     | cannot read "__import__('os')": arguments are
run -p "kepler(); kepler()" -m "IAS15()"                   | cannot read 'kepler(); kepler()': this is not
run -p "kepler(e=10**400)" -m "IAS15()"                    | cannot read 'kepler(e=10**400)': a value is a
run -p "fput(n=100000000)" -m "IAS15()"                    | the limit is
run -p "cluster(n=10000000)" -m "IAS15()"                  | the limit is
run -p "lennard_jones(rings=1000)" -m "IAS15()"            | the limit is
run -p "fput(n=1e8)" -m "IAS15()"                          | n=100000000.0 of fput must be a whole number of
run -p "kepler()" -m "HBVM(kk=3)"                          | HBVM(kk=3): unknown option of HBVM 'kk'; did
run -p "kepler()" -m "Gauss(h=0.1)"                        | Gauss(h=0.1): Gauss needs s; give a value as in
run -p "kepler()" -m "Gauss(s=2000,h=0.1)"                 | the limit is
run -p "kepler()" -m "HBVM(k=2000,s=2,h=0.1)"              | the limit is
run -p "kepler()" -m "HBVM(k=4,s=2,h=1e999)"               | cannot read 'HBVM(k=4,s=2,h=1e999)': the number
run -p "kepler()" -m "HBVM(k=4,s=2,h='a')"                 | HBVM(k=4, s=2, h='a'): h='a' of HBVM must be a
run -p "kepler()" -m "HBVM(k=4,s=2,h=[0.1])"               | HBVM(k=4, s=2, h=(0.1,)): h=(0.1,) of HBVM must
run -p "kepler()" -m "HBVM(k=4,s=2,h={})"                  | cannot read 'HBVM(k=4,s=2,h={})': a value is a
run -p "kepler()" -m "HBVM(k=[[[[[[[[[[4]]]]]]]]]],s=2,h=0.1)" | cannot read
run -p "kepler()" -m "WHFast(h=-1)"                        | WHFast(h=-1): h=-1 of WHFast must be a finite
run -p "kepler()" -m "sys.exit()"                          | cannot read 'sys.exit()': the name must be one
run -p "expression(H='p^2/2 +')" -m "IAS15()"              | cannot read the formula 'p^2/2 +': it is not
run -p "expression(H='q^10000000000')" -m "HBVM(k=4,s=2,h=0.1)" | cannot read the formula 'q^10000000000':
run -p "kepler()"                                          | give a campaign, or at least one -p
run -m "IAS15()"                                           | give a campaign, or at least one -p
run -p "kepler(ee=0.6)" -m "IAS15()"                       | unknown argument of kepler 'ee'; did you mean
run -p "kepler()" -m "HBVM(k=2,s=3,h=0.1)"                 | HBVM(k=2, s=3, h=0.1): HBVM needs k >= s; k=2 is
show                                                       | Missing argument 'directory'
show nowhere                                               | the directory 'nowhere' does not exist; make
show .                                                     | the directory '.' has no results; make some
show /dev/null                                             | the directory '/dev/null' does not exist; make
show /etc                                                  | the directory '/etc' has no results; make some
show nowhere --metric foo                                  | unknown metric 'foo'; known:
show nowhere --sort foo                                    | unknown metric 'foo'; known:
show nowhere --json                                        | the directory 'nowhere' does not exist; make
show a b                                                   | Got unexpected extra argument(s) (b)
cite HBVN                                                  | unknown method 'HBVN'; did you mean 'HBVM'?
cite ""                                                    | unknown method ''; known: BDF, BS, CVODE, Com
reference                                                  | Missing argument 'problem'
reference keplr                                            | unknown problem 'keplr'; did you mean 'kepler'?
reference "kepler("                                        | cannot read 'kepler(': this is not one call
reference "kepler(e=0.61)" --until nan                     | until=nan must lie between 0.0 and
reference "kepler(e=0.61)" --until -5                      | until=-5.0 must lie between 0.0 and
reference "kepler(e=0.61)" --until inf                     | until=inf must lie between 0.0 and
reference "kepler(e=0.61)" --until a                       | Invalid value for '--until': Input should be a
reference "kepler(e=0.61)" --until 0                       | until=0.0 must lie between 0.0 and
reference "kepler(e=0.61)" --until 1 -o /dev/null/x/y      | cannot write to the directory '/dev/null/x':
reference "kepler(e=0.61)" --until 1 -o /proc/y            | cannot write to the directory '/proc': No such
automatic nosuch                                           | hbvm-bench automatic is a campaign; leave out
automatic -p nosuch                                        | unknown problem of automatic 'nosuch'; known:
automatic --rounds 0                                       | Invalid value for '--rounds': Input should be
automatic --rounds a                                       | Invalid value for '--rounds': Input should be
automatic --rounds -5                                      | Invalid value for '--rounds': Input should be
race -p nosuch                                             | unknown problem of race 'nosuch'; known:
race --rounds 1                                            | Invalid value for '--rounds': Input should be
race --rounds 0                                            | Invalid value for '--rounds': Input should be
race --rounds a                                            | Invalid value for '--rounds': Input should be a
race --quick --out /dev/null/x                             | cannot write to the directory '/dev/null/x':
race extra                                                 | hbvm-bench race is a campaign; leave out
endure --years 1                                           | No such option: --years
endure --starts 0                                          | No such option: --starts
endure -m "Leapfrog(h=0.1)"                                | give either a campaign or -m, --step and
endure --quick --out /dev/null/x                           | cannot write to the directory '/dev/null/x
paper nosuch                                               | hbvm-bench paper is a campaign; leave out
paper --jobs 0                                             | Invalid value for '--jobs': Input should be
paper --jobs a                                             | Invalid value for '--jobs': Input should be a
paper --out /dev/null/x                                    | cannot write to the directory
compare                                                    | Missing argument 'first'
compare a                                                  | Missing argument 'second'
compare nowhere1 nowhere2                                  | the directory 'nowhere1' does not exist; make
compare /dev/null /dev/null                                | the directory '/dev/null' does not exist; make
compare . .                                                | the directory '.' has no results; make some
doctor extra                                               | Got unexpected extra argument(s) (extra)
doctor --foo                                               | No such option: --foo
engines nosuch                                             | unknown problem 'nosuch'; known:
engines --markdown nosuch                                  | unknown problem 'nosuch'; known:
engines ""                                                 | unknown problem ''; known: charged_particle,
export                                                     | Missing argument 'directory'
export nowhere                                             | Missing option '-o' / '--out'
export nowhere -o x.csv                                    | the directory 'nowhere' does not exist; make
export nowhere -o x.txt                                    | 'x.txt' must end in .csv or .parquet
export . -o x.csv                                          | the directory '.' has no results; make some
export nowhere -o x.csv --table nosuch                     | unknown table 'nosuch'; known: cases, series,
export nowhere -o /dev/null/x.csv                          | cannot write to the directory '/dev/null': Not
export nowhere -o x                                        | 'x' must end in .csv or .parquet
inspect                                                    | Missing argument 'system'
inspect ""                                                 | an empty formula; write one such as "p^2/2 -
inspect "p^2/2 - cos(q"                                    | cannot read the formula 'p^2/2 - cos(q': it is
inspect "p^2/2 - cosine(q)"                                | cannot read the formula 'p^2/2 - cosine(q)':
inspect "p^2/2 - k*q"                                      | the formula 'p^2/2 - k*q' contains 'k', which
inspect "p^2/2 - k*q" --par "k"                            | cannot read 'k'; write parameters as "k=2,
inspect "p^2/2 - k*q" --par "k=a"                          | cannot read 'k=a'; write parameters as "k=2,
inspect "p^2/2 - k*q" --par "kk=1"                         | the formula 'p^2/2 - k*q' contains 'k', which
inspect "p^2/2 - q" --par "k=1"                            | unknown parameter, not in the formula, 'k';
inspect "p^2/2" --par "k=1,k=2"                            | the parameter 'k' is given twice
inspect "keplr()"                                          | unknown problem 'keplr'; did you mean 'kepler'
inspect "schwarzchild"                                     | unknown problem 'schwarzchild'; did you mean
inspect "kepler(ee=1)"                                     | unknown argument of kepler 'ee'; did you mean
inspect "kepler()" --par "k=1"                             | parameters belong to formulas; write them into
inspect "1"                                                | the formula '1' contains no coordinate; use q
inspect "p9999999^2 + q9999999"                            | the formula 'p9999999^2 + q9999999' has more
inspect "((((((("                                          | cannot read the formula '(((((((': it is not
inspect "p^2 + 1/0"                                        | cannot read the formula 'p^2 + 1/0': `1 / 0`
inspect "p^2 + 1e999"                                      | cannot read the formula 'p^2 + 1e999': `1e309`
inspect "p^2; q"                                           | cannot read the formula 'p^2; q': it is not
inspect "p^2" extra                                        | Got unexpected extra argument(s) (extra)
merge                                                      | Missing argument 'runs'
merge a                                                    | Missing option '--out'
merge a b                                                  | Missing option '--out'
merge a b --out c                                          | the directory 'a' does not exist; make some
merge . . --out c                                          | merge needs two runs or more, as in: hbvm-bench
merge nowhere --out c                                      | merge needs two runs or more, as in: hbvm-bench
merge /dev/null /dev/null --out c                          | merge needs two runs or more, as in: hbvm-bench
report                                                     | give at least one run, as in runs/sitnikov, or
report nowhere                                             | the directory 'nowhere' does not exist; make
report .                                                   | the directory '.' has no results; make some
report nowhere --out x                                     | the directory 'nowhere' does not exist; make
report /dev/null                                           | the directory '/dev/null' does not exist; make
report --index nowhere                                     | the directory 'nowhere' does not exist; write a
report --index /dev/null                                   | the directory '/dev/null' does not exist; write
report --index .                                           | the directory '.' holds no report; write one
report nowhere --open                                      | the directory 'nowhere' does not exist; make
run --help=3                                               | Option '--help' does not take a value
list problems --json                                       | No such option: --json
RUN --executor nowhere                                     | there is no executor 'nowhere'; give local, dask
RUN --executor no.such:thing                               | there is no executor 'no.such:thing'
RUN --executor os:path                                     | os:path cannot be made
RUN --executor math:sin                                    | math:sin cannot be made
RUN --executor ":"                                         | there is no executor ':'
RUN --executor ""                                          | there is no executor ''; give local
RUN --out x --report /dev/null/x                           | cannot write to the directory '/dev/null/x'
"""

ROWS = [Typed(*(part.strip() for part in line.rsplit(" | ", 1))) for line in TABLE.strip().splitlines()]
IN_A_PROCESS = ("lst", "show nowhere", "RUN --step 0")


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("row", ROWS, ids=str)
def test_one_sentence(row, here, capfd):
    assert cli.main(row.arguments) == 2
    printed = capfd.readouterr()
    assert not printed.out
    assert list(here.iterdir()) == []
    is_said(row, printed.err)


@pytest.mark.parametrize("row", [row for row in ROWS if row.words in IN_A_PROCESS], ids=str)
def test_one_sentence_in_a_process(row, here):
    command = [sys.executable, "-m", "hbvm_bench.cli", *row.arguments]
    done = subprocess.run(command, cwd=here, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert not done.stdout
    assert list(here.iterdir()) == []
    is_said(row, done.stderr)


def is_said(row, text):
    assert text.startswith("hbvm-bench: ")
    assert row.says in text
    sentence(text, "")


def test_the_oldest_typer_that_is_admitted_has_what_the_command_line_imports():
    told = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text())["project"]
    (typer,) = [wanted for wanted in map(Requirement, told["dependencies"]) if wanted.name == "typer"]
    # typer.exceptions came with 0.27.2: 0.27.1 is without it.
    assert typer.specifier.contains("0.27.2")
    assert not typer.specifier.contains("0.27.1")
