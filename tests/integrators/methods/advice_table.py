"""What `integrators.advise` expects on the forty systems of `forty`, beside the true errors.

``python -m tests.integrators.methods.advice_table`` prints the table of docs/howto/which_method.md. Which
of the proposals is the fastest depends on the machine, and with it the setting and both errors.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from integrators import advise, integrate
from integrators.methods.advice import Advice

from .forty import CHAOTIC, SYSTEMS, ends

PAGE = Path(__file__).parents[3] / "docs/howto/which_method.md"
BEGIN = "<!-- made by: python -m tests.integrators.methods.advice_table -->"
END = "<!-- end of what is made -->"
HEAD = "| system | chaotic | accuracy | setting | expected error | true error | ratio | reached |"
LINE = "|:--|:--|--:|:--|--:|--:|--:|:--|"


@dataclass(frozen=True)
class Row:
    """The advice on one system.

    Attributes
    ----------
    name : str
        Of the system.
    advice : Advice
        For the accuracy that `forty` asks for.
    true : float
        The error of the proposal at the end, relative to the largest coordinate.
    """

    name: str
    advice: Advice
    true: float

    @property
    def expected(self) -> float:
        """The error that `advise` expects of its first proposal."""
        return self.advice.proposals[0].position

    @property
    def ratio(self) -> float:
        """The true error as a part of the expected one."""
        return self.true / self.expected

    def __str__(self) -> str:
        words = ["no", "yes"]
        return (
            f"| {self.name} | {words[self.name in CHAOTIC]} | {self.advice.accuracy:.0e} "
            f"| `{self.advice.method!r}` | {self.expected:.1e} | {self.true:.1e} | {self.ratio:.2g} "
            f"| {words[self.advice.reached]} |"
        )


def measured(name: str) -> Row:
    """Ask for advice on a system, and integrate it as advised."""
    accuracy, make = SYSTEMS[name]
    problem = make()
    advice = advise(problem, accuracy)
    dof = problem.system.dof or problem.system.dim
    size = np.abs(integrate(problem).y[:, :dof]).max()
    end = integrate(problem, advice.method, [problem.t_end]).y[-1]
    return Row(name, advice, float(np.abs(end - ends()[name])[:dof].max() / size))


def main() -> None:
    """Print the table."""
    print("\n".join([BEGIN, HEAD, LINE, *(str(measured(name)) for name in SYSTEMS), END]))


if __name__ == "__main__":
    main()
