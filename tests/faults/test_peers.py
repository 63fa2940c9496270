"""What somebody does wrong with the peers, and the sentence they get."""

from dataclasses import dataclass

import pytest

import integrators
import problems
from hbvm_bench import cli
from tests.faults.fault import Fault, is_met, sentence


@dataclass(frozen=True)
class Typed:
    """A command line that is a mistake, and what its sentence must say."""

    words: tuple[str, ...]
    says: str

    def __str__(self) -> str:
        return " ".join(self.words)


@pytest.mark.parametrize(
    "typed",
    [
        Typed(("doctor", "--rounds", "3"), "--rounds and --out belong to --peers: hbvm-bench doctor --peers"),
        Typed(("doctor", "--out", "x.json"), "--rounds and --out belong to --peers"),
    ],
    ids=str,
)
def test_the_command_says_what_is_wrong_and_writes_nothing(typed, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("hbvm_bench.measure.doctor.examine", dict)  # nothing is looked at before that is said
    assert cli.main(list(typed.words)) == 2
    sentence(capsys.readouterr().err, typed.says)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "method",
    [
        integrators.HBVM(k=4, s=2, h=0.1),
        integrators.HBVM(k=4, s=2, tol=1e-6),
        integrators.LineIntegral(k=4, s=2, h=0.1, invariants=["energy"]),
        integrators.DOP853(rtol=1e-6, atol=1e-6),
    ],
    ids=str,
)
def test_every_methods_start_refuses_the_same(method):
    problem = problems.load("kepler")
    program = method.compile(problem.system)
    for do, says in (
        (lambda: program.start(problem.y0, "abc"), "par must be numbers, not 'abc'"),
        (lambda: program.start(problem.y0, [1.0] * 99), r"par must have shape .*, not \(99,\)"),
        (lambda: program.start(problem.y0, None, "x"), "t0 must be numbers, not 'x'"),
        (lambda: program.start(problem.y0, None, [0.0]), r"t0=\[0.0\] must be one finite number"),
        (lambda: program.start(problem.y0).advance("x"), "times must be numbers, not 'x'"),
    ):
        is_met(Fault("start", do, says))
