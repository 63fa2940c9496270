"""What somebody does wrong with the peers, and the sentence they get."""

from dataclasses import dataclass

import pytest

from hbvm_bench import cli
from tests.faults.fault import sentence


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
    monkeypatch.setattr("hbvm_bench.doctor.examine", dict)  # nothing is looked at before that is said
    assert cli.main(list(typed.words)) == 2
    sentence(capsys.readouterr().err, typed.says)
    assert not list(tmp_path.iterdir())
