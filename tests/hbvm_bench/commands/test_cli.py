"""What the command line prints, keeps and repeats; how it is misused: `tests/faults`."""

import json
import os
import shlex
import signal
import sqlite3
import subprocess
import sys
import time
from pathlib import Path

import pytest

from hbvm_bench import cli
from hbvm_bench.campaign.own import NOTHING
from hbvm_bench.commands import run
from hbvm_bench.measure.metrics import METRICS
from hbvm_bench.store.store import Store
from tests.hbvm_bench.conftest import SHORT, stored

COMMAND = [sys.executable, "-m", "hbvm_bench.cli"]


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def fails(capsys, *arguments, says):
    assert cli.main(list(arguments)) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.startswith("hbvm-bench: ")
    assert printed.err.count("\n") == 1
    for words in says if isinstance(says, tuple) else (says,):
        assert words in printed.err


def test_a_directory_of_files_that_are_no_run_is_refused(here, capsys):
    (here / "results.sqlite").write_text("{}")
    fails(capsys, "show", ".", says="no store of results")


def test_help_version_and_lists(capsys):
    assert cli.main(["--version"]) == 0
    assert capsys.readouterr().out.startswith("hbvm-bench 0.")
    assert cli.main(["list"]) == 0
    out = capsys.readouterr().out
    assert all(name in out for name in ("sitnikov(", "HBVM(k=None, s=None, h=None, tol=None", *METRICS))
    assert cli.main(["run", "--help"]) == 0
    assert "--report" in capsys.readouterr().out


def test_citations_are_printed_once(capsys):
    assert cli.main(["cite", "HBVM(k=4, s=2, h=1)", "HBVM", "IAS15"]) == 0
    out = capsys.readouterr().out
    assert out.count("BrugnanoIavernaro2016") == 1
    assert "IAS15" in out


def test_a_run_is_stored_shown_and_not_repeated(toys, here, capsys):
    arguments = ["run", "-p", SHORT, "-m", "Steady()", "-m", "Raising()", "--out", "r"]
    assert cli.main([*arguments, "--report", "rep"]) == 0
    first = capsys.readouterr()
    assert "Steady()" in first.out
    assert "something <b>broke</b>" in first.out
    assert "measuring on this machine: 2 to do" in first.err
    assert {path.name for path in (here / "rep").iterdir()} == {
        "report.md",
        "index.html",
        "figures",
        "results.sqlite.xz",
    }
    records = stored(Store(here / "r"))
    assert cli.main(arguments) == 0
    assert "2 already there" in capsys.readouterr().err
    assert stored(Store(here / "r")) == records

    assert cli.main(["show", "r", "--json"]) == 0
    shown = json.loads(capsys.readouterr().out, parse_constant=lambda name: pytest.fail(name))
    assert [case["outcome"] for case in shown["cases"]] == ["ok", "crashed"]
    steady = shown["cases"][0]
    assert steady["timing"]["median"] > 0
    assert len(steady["timing"]["rounds"]) == 3
    assert steady["metrics"]["warm_seconds"]["value"] == steady["timing"]["median"]
    assert set(steady["metrics"]) <= set(shown["metrics"])

    assert cli.main(["show", "r", "--metric", "steps", "--sort", "steps"]) == 0
    out = capsys.readouterr().out
    assert "steps" in out
    assert "energy" not in out.splitlines()[2]
    assert cli.main(["report", "r"]) == 0
    assert (here / "r" / "report" / "index.html").is_file()


def test_a_report_of_a_run_without_a_finished_case_says_so(toys, here, capsys):
    assert cli.main(["run", "-p", SHORT, "-m", "Refusing()", "--out", "r"]) == 0
    with sqlite3.connect(here / "r" / "results.sqlite") as database:
        database.execute("DELETE FROM results")
    database.close()
    capsys.readouterr()
    fails(capsys, "report", "r", "-o", "rep", says=("has finished", "run its campaign again"))
    fails(capsys, "show", "r", says="no finished case")


def test_a_campaign_file_runs(toys, here, capsys):
    head = f'name = "x"\nproblems = ["{SHORT}"]\ngrid = {{count = 2}}\n'
    (here / "x.toml").write_text(head + '[[methods]]\nuse = "Steady()"\nnote = "<i>"\n')
    assert cli.main(["run", "x.toml", "--no-timing"]) == 0
    assert (here / "runs" / "x" / "results.sqlite").is_file()
    out = capsys.readouterr().out
    assert "not timed" not in out
    assert "<i>" in out


@pytest.mark.parametrize(
    ("typed", "kept"),
    [
        ("{here}/x.toml", "x.toml"),
        ("{here}/in/x.toml", "in/x.toml"),
        ("{other}/x.toml --out {other}/r", "x.toml"),
        ("-m HBVM() -p {here}/in/m.py:f(a='/')", "--problem in/m.py:f(a='/') --method HBVM()"),
        ("-m HBVM() -p {other}/m.py:f(a='/')", "--problem m.py:f(a='/') --method HBVM()"),
        ("-m HBVM() -p ../m.py:f()", "--problem ../m.py:f() --method HBVM()"),
    ],
)
def test_the_command_that_is_kept_has_no_folder_of_this_machine(
    typed, kept, here, tmp_path_factory, monkeypatch
):
    other, commands = tmp_path_factory.mktemp("other"), []
    monkeypatch.setattr(run, "carry_out", lambda campaign, out, command, **_: commands.append(command))
    monkeypatch.setattr(run, "opened", lambda campaign, name: (campaign, NOTHING))
    for name in ("show", "refuse_died"):
        monkeypatch.setattr(run, name, lambda *_: None)
    (here / "in").mkdir()
    for folder in (here, here / "in", other):
        (folder / "x.toml").write_text('name = "x"\nproblems = ["kepler()"]\nmethods = [{use = "HBVM()"}]\n')
    assert cli.main(["run", *typed.format(here=here, other=other).split()]) == 0
    assert [shlex.split(command) for command in commands] == [["hbvm-bench", "run", *kept.split()]]


def test_ctrl_c_keeps_what_is_finished_and_a_rerun_goes_on(toys, here, capsys):
    arguments = f"run -p {SHORT} --no-timing --jobs 1 -m Steady() -m Steady(wait=20.0)".split()
    running = subprocess.Popen(
        [*COMMAND, *arguments], stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    store = Store(here / "runs" / "custom")
    deadline = time.monotonic() + 60
    while not stored(store) and time.monotonic() < deadline:
        time.sleep(0.05)
    time.sleep(0.5)
    children = Path(f"/proc/{running.pid}/task")
    workers = {int(pid) for task in children.iterdir() for pid in (task / "children").read_text().split()}
    running.send_signal(signal.SIGINT)
    _, err = running.communicate(timeout=60)
    assert running.returncode == 130
    assert "interrupted: 1 of 2 cases are kept in runs/custom" in err
    assert "Traceback" not in err
    assert workers
    assert not any(Path(f"/proc/{pid}").exists() for pid in workers)
    kept = stored(store)

    again = [argument.replace("wait=20.0", "wait=0.1") for argument in arguments]
    assert cli.main(again) == 0
    assert "1 already there" in capsys.readouterr().err
    assert kept.items() <= stored(store).items()


def test_output_into_a_closed_pipe_is_no_error():
    shell = f"{sys.executable} -m hbvm_bench.cli list | true; echo ${{PIPESTATUS[0]}}"
    done = subprocess.run(["bash", "-c", shell], capture_output=True, text=True, env=os.environ, check=False)
    assert done.stdout.strip() == "0"
    assert "Traceback" not in done.stderr


def test_help_imports_neither_what_compiles_nor_what_draws():
    code = (
        "import sys; from hbvm_bench.cli import main; code = main(['--help'])\n"
        "slow = {'matplotlib', 'llvmlite', 'numba', 'scipy', 'mpmath', 'jinja2'}\n"
        "print(code, sorted(set(sys.modules) & slow))"
    )
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.splitlines()[-1] == "0 []"
    assert "automatic" in found.stdout  # every command is there
