"""What a method cannot see, as sentences for `Solution.warnings`: the same for every method."""

from problems.analysis.structure import has_kinks
from problems.problem import Problem, System

FEWEST = 4  # nodes whose coefficients can show a kink


def unseen(problem: Problem, why: str | None) -> str | None:
    """Return the sentence on a field with kinks that a method does not look for, if it is one.

    Parameters
    ----------
    problem : Problem
        What is integrated; a system that is not traced cannot be asked whether it has kinks.
    why : str or None
        Why the method does not see them; ``None`` where it does.
    """
    if why is None or not problem.system.traced or not has_kinks(problem.system):
        return None
    return (
        f"its field has m.abs or m.where, and {why}: steps go over a kink with any error, "
        "and the run ends as finished."
    )


def sees_kinks(k: int, system: System) -> bool:
    """Whether steps with k nodes look for kinks.

    With few nodes a smooth field now and then looks like one with a kink. So with few nodes kinks are
    looked for only where the traced field is known to have some.
    """
    return k >= 8 or (k >= FEWEST and system.traced and has_kinks(system))


def blind(k: int | None, tol: float | None, solver: str) -> str | None:
    """Return why HBVM(k, s) with these options does not look for kinks; ``None`` where it does.

    Where k is chosen, it is large enough.
    """
    if tol is None:
        return "steps of one length are not cut there"
    if solver in ("newton", "blended"):
        return f"kinks are not looked for with solver={solver!r}"
    if k is not None and k < FEWEST:
        return f"k={k} nodes do not tell a kink from a smooth field"
    return None
