"""Problems in Python files: run where they are asked for, kept as formulas, told in one sentence."""

import json
import subprocess
import sys
from decimal import Decimal

import numpy as np
import pytest

import problems
from hbvm_bench import cli
from hbvm_bench.campaign import file, own
from hbvm_bench.campaign.identity import make_problem, resolve, typed_problem
from hbvm_bench.campaign.spec import parse_spec
from hbvm_bench.measure import reading
from hbvm_bench.reference import solutions, trusted
from hbvm_bench.report.markdown import markdown
from hbvm_bench.report.page import document
from hbvm_bench.store.store import Store
from problems.errors import InputError

SWING = """
import problems
from math import hypot
from constants import G

def swing(*, g: float = G, p: float = 1.0):
    H = lambda q, p, par, m: p[0]**2/6 - par.g*m.cos(q[0])
    return problems.Problem(problems.Hamiltonian(H, dof=1, parameters={"g": g}), q0=[0.0], p0=[p], t_end=4.0)

rest = swing(p=0.0)
half = 0.5

def number():
    return 3

def called():
    return problems.Problem(problems.Opaque(lambda t, y: -y, dim=1), y0=[1.0], t_end=1.0)

def fails(n=0):
    return 1/n

def says():
    raise ValueError("g must be positive.")

def anything(*a, **k):
    return 3

def _hidden():
    return rest
"""
CAMPAIGN = """
name = "mine"
timing = { rounds = 0 }
problems = [{ use = "mine.py:swing(g={g})", sweep = { g = [1.0, 2.0] } }]
methods = [{ use = "Gauss(s=2, h=0.1)", only = ["swing"] }]
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    (tmp_path / "mine.py").write_text(SWING)
    (tmp_path / "constants.py").write_text("G = 9.81\n")
    (tmp_path / "mine.toml").write_text(CAMPAIGN)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def opened(folder, text=CAMPAIGN):
    return own.opened(file.parse(text), folder, lambda _: None)


def kept(folder, text=CAMPAIGN):
    return opened(folder, text)[0]


def test_a_function_of_a_file_is_a_problem(folder):
    made = typed_problem("mine.py:swing(g=2.0)")
    assert (repr(made), made.title, made.par.tolist()) == ("mine.py:swing(g=2.0)", "swing", [2.0])
    assert typed_problem("mine.py:rest").y0.tolist() == [0.0, 0.0]
    assert "constants" not in sys.modules
    assert sorted(path.name for path in folder.iterdir()) == ["constants.py", "mine.py", "mine.toml"]


def test_a_campaign_says_what_it_runs_before_it_does(folder):
    (folder / "mine.py").write_text("raise SystemExit('stop')")
    said = []
    with pytest.raises(InputError, match="stop"):
        own.opened(file.parse(CAMPAIGN), folder, said.append)
    assert said == ["mine.py"]


def test_what_is_kept_is_the_same_problem_without_its_file(folder):
    campaign, known = opened(folder)
    first, second = campaign.cases()
    assert parse_spec(first.problem).arguments == {"g": 1.0}
    (folder / "mine.py").unlink()
    made, again = (make_problem(case.problem, known) for case in (first, second))
    assert (repr(made), made.par.tolist(), again.par.tolist()) == (first.problem, [1.0], [2.0])
    assert made.errors(np.array([[0.0, 1.0]]))["energy"].tolist() == [0.0]


def test_only_what_numbers_depend_on_makes_a_case_stale(folder):
    def ids():
        campaign, known = opened(folder)
        return [resolve(case, known).id for case in campaign.cases()]

    before = ids()
    (folder / "mine.py").write_text("'''A text.'''\n" + SWING)
    assert ids() == before
    (folder / "mine.py").write_text(SWING.replace("cos", "sin"))
    assert not {*ids()} & {*before}
    text = 'name = "x"\nproblems = ["mine.py:swing"]\nmethods = [{ use = "Gauss(s=2, h=0.1)" }]'
    old = kept(folder, text).cases()
    (folder / "constants.py").write_text("G = 1.62\n")
    assert kept(folder, text).cases() != old


def test_a_digest_is_the_same_in_every_process(folder):
    code = (
        "from pathlib import Path\nfrom hbvm_bench.campaign import file, own\n"
        "print(own.opened(file.load('mine.toml'), Path(), print)[0].cases()[0].problem)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split("\n")[1] == kept(folder).cases()[0].problem


def test_nobody_else_runs_a_file(folder):
    with pytest.raises(InputError, match="no Python file is run here"):
        make_problem("mine.py:swing()")
    with pytest.raises(InputError, match="should lie beside the results"):
        make_problem("mine.py@00000000:swing()")


def test_data_that_are_not_what_their_name_says_are_refused(folder):
    text = next(iter(opened(folder)[1].formulas.values()))
    plain = json.loads(text)
    plain["arrays"]["array_0"][1] = 2.0
    with pytest.raises(ValueError, match="not the one that its name says"):
        own.known_from(own.Beside(formula=json.dumps(plain)))
    with pytest.raises(ValueError, match="it has no symbol"):  # a text that would be printed into code
        own.known_from(own.Beside(formula=text.replace('["y", 0]', '["print(1) or y", 0]')))


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("other.py:swing()", "there is no Python file 'other.py'"),
        ("mine.py:swimg()", "unknown problem of mine.py 'swimg'; did you mean 'swing'"),
        ("mine.py:_hidden()", "unknown problem of mine.py '_hidden'"),
        ("mine.py:swing(h=1)", "unknown argument of mine.py:swing 'h'"),
        ("mine.py:swing(g=1", "cannot read 'swing(g=1'"),
        ("mine.py:swing(g='a')", "parameter 'g' is 'a'"),
        ("mine.py:half", "mine.py:half is 0.5, neither a problem nor a function"),
        ("mine.py:number()", "mine.py:number returns 3, not a problems.Problem"),
        ("mine.py:rest(g=1)", "takes no arguments"),
        ("mine.py:fails()", "mine.py:fails() cannot be made, ZeroDivisionError in line 20: division by zero"),
        ("mine.py:says()", "mine.py:says() cannot be made, ValueError in line 23: g must be positive."),
        ("mine.py:hypot(x=1)", "mine.py:hypot"),  # whose signature no Python tells alike
        ("mine.py:anything(n=1)", "mine.py:anything returns 3, not a problems.Problem"),
        ("broken.py:x", "broken.py cannot be run, SyntaxError in line 2: "),
        ("absent.py:x", "absent.py cannot be run, ModuleNotFoundError in line 1: No module named 'nowhere'"),
    ],
)
def test_what_is_wrong_is_one_sentence(folder, capsys, text, says):
    (folder / "broken.py").write_text("x = 1\nx = = 2\n")
    (folder / "absent.py").write_text("import nowhere\n")
    for command in (["inspect", text], ["advise", text], ["run", "-p", text, "-m", "Gauss(s=2, h=0.1)"]):
        assert cli.main(command) == 2
        printed = capsys.readouterr()
        last = printed.err.splitlines()[-1]
        assert says in last
        assert last.startswith("hbvm-bench: ")
    assert not (folder / "runs").exists()


@pytest.mark.parametrize(
    ("use", "says"),
    [
        ("../mine.py:swing()", "does not lie beside the campaign file"),
        ("FOLDER/mine.py:swing()", "does not lie beside the campaign file"),
        ("link.py:swing()", "a link out of the campaign's folder"),
        ("mine.py:swing()", "there is no Python file 'mine.py' beside the campaign file"),
    ],
)
def test_a_campaign_runs_only_what_lies_beside_it(folder, use, says):
    place = folder / "campaigns"
    place.mkdir()
    (place / "link.py").symlink_to(folder / "mine.py")
    use = use.replace("FOLDER", str(folder))
    with pytest.raises(InputError, match=says):
        kept(place, CAMPAIGN.replace("mine.py:swing(g={g})", use).replace(", sweep = { g = [1.0, 2.0] }", ""))


def test_a_run_keeps_formulas_only(folder):
    text = 'name = "x"\nproblems = ["mine.py:called()"]\nmethods = [{ use = "Gauss(s=2, h=0.1)" }]'
    with pytest.raises(InputError, match="is no formula but a function that is called"):
        kept(folder, text)


def once_more(problem, at):
    """Return the other opinion on a reference, by the method of the first."""
    rows = solutions.taylor(problem, at, "1e-30")
    return np.array([[complex(float(x), float(x - Decimal(float(x)))) for x in row] for row in rows])


def test_a_run_has_positions_where_a_reference_was_asked_for(folder, capsys, monkeypatch):
    without = CAMPAIGN.replace("[1.0, 2.0]", "[1.0]")
    (folder / "mine.toml").write_text(without)
    monkeypatch.setattr(trusted.collocation, "integrate", once_more)  # which compiles for ten seconds
    assert cli.main(["run", "mine.toml", "--out", "run"]) == 0
    printed = capsys.readouterr()
    assert "running the Python file mine.py, which mine.toml names" in printed.err
    assert "position" not in printed.out.splitlines()[2]
    assert "No stored reference for" in "".join(markdown(document(Store(folder / "run"))))
    (folder / "mine.toml").write_text(without.replace('",', '", reference = true,', 1))
    assert cli.main(["run", "mine.toml", "--out", "run"]) == 0
    printed = capsys.readouterr()
    assert "the two agree to " in printed.err
    assert "position" in printed.out.splitlines()[2]
    [record] = reading.records(Store(folder / "run"))
    assert 0.0 < (record.result.metrics["position_end"].value or 0.0) < 1e-5
    assert cli.main(["run", "mine.toml", "--out", "run"]) == 0
    assert "computing" not in capsys.readouterr().err
    (folder / "mine.py").unlink()
    page = "".join(markdown(document(Store(folder / "run"))))
    assert "Reference: heyoka taylor" in page
    assert "The two agree to" in page


def test_a_catalogue_problem_is_opened_by_nobody():
    campaign = file.load("smoke")
    assert own.opened(campaign, None, pytest.fail) == (campaign, own.NOTHING)
    assert own.NOTHING.problem(parse_spec("kepler(e=0.6)")) is None
    assert own.NOTHING.beside(problems.load("kepler")) == own.Beside()
