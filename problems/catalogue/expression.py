"""A Hamiltonian given as text, and the problem made of it.

Names in the text are the coordinates ``q`` and ``p`` (one degree of freedom) or
``q1, p1, q2, ...``, the time ``t``, ``pi``, and parameters; `problems.catalogue._formula` says what
else there is.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Annotated, Any

from problems.catalogue._formula import COORDINATE, NAME, Formula
from problems.checks import Must
from problems.entry import Expected, entry
from problems.errors import InputError, shown, unknown
from problems.graph.functions import OF_ONE_ARGUMENT
from problems.picture import Phase
from problems.problem import Problem
from problems.systems.hamiltonian import Hamiltonian

MOST_FREEDOM = 100  # degrees of freedom; larger systems have sums, which text has not


def hamiltonian(
    text: str,
    *,
    parameters: Mapping[str, float] | None = None,
    invariants: Mapping[str, str] | None = None,
    name: str = "expression",
) -> Hamiltonian:
    """Return the system of a Hamiltonian given as text.

    Parameters
    ----------
    text : str
        The energy in ``q, p`` or ``q1, p1, .. qn, pn``; the highest number is the
        number of degrees of freedom.
    parameters : mapping of str to float
        Names and default values of all other names in it.
    invariants : mapping of str to str
        Further conserved quantities, as text.
    name : str
        The system's name.

    Raises
    ------
    problems.errors.InputError
        For text that is not a formula, names without a value, or values of names
        that do not occur.
    """
    values = dict(parameters or {})
    energy = Formula(text)
    others = {key: Formula(formula) for key, formula in (invariants or {}).items()}
    dof = _freedom(energy)
    system = Hamiltonian(
        _traceable(energy, values, dof),
        dof=dof,
        parameters=values,
        invariants={key: _traceable(formula, values, dof) for key, formula in others.items()},
        name=name,
    )
    try:
        system.function("field")
    except (InputError, OverflowError):  # the derivatives' constants may overflow where H does not
        raise InputError(f"the formula {text!r} leads to numbers that a double cannot hold.") from None
    if not energy.coordinates:
        raise InputError(f"the formula {text!r} contains no coordinate; use q and p, or q1, p1, q2, ...")
    for key in values:
        if not any(key in formula.names for formula in (energy, *others.values())):
            raise unknown("parameter, not in the formula,", key, energy.names)
    return system


@entry(
    title=None,
    references=("given by the user",),
    notes="A formula of your own.",
    shows=("H", "q0", "p0"),
    picture=Phase(
        span=12.0,
        points=600,
        arguments={"H": "p^2/2 + k*q^4/4", "q0": [1.0], "p0": [0.0], "parameters": "k=2"},
    ),
    expected=Expected(h=0.2, energy=2e-15, default=2e-15),
)
def expression(
    *,
    H: Annotated[str, Must('text, such as "p^2/2 - cos(q)"')] = "p^2/2 - cos(q)",
    q0: Sequence[float] = (0.0,),
    p0: Sequence[float] = (1.9,),
    parameters: Annotated[str, Must('text, such as "k=2, m=0.5"')] = "",
    t_end: float = 100.0,
) -> Problem:
    """Return a problem whose Hamiltonian is given as text.

    Tests a Hamiltonian of your own, such as
    ``expression(H="(p1^2 + p2^2)/2 + q1^2*q2^2", q0=[0.5, 1.0], p0=[0.0, 0.3])``.

    Parameters
    ----------
    H : str
        The energy, in ``q`` and ``p`` or ``q1, p1, q2, ...``, the time ``t``, ``pi`` and parameters;
        with + - * /, powers ``^`` and the elementary functions of one argument.
    q0, p0 : sequence of float
        The initial state, as many numbers as there are degrees of freedom.
    parameters : str
        Values of the other names in ``H``: ``"k=2, m=0.5"``.
    t_end : float
        End of the integration.

    Returns
    -------
    Problem
        State ``[q1 .. qn, p1 .. pn]``; parameters as named in ``H``; invariant:
        energy, if ``H`` does not contain ``t``.

    Raises
    ------
    problems.errors.InputError
        For anything that cannot be read.
    """
    values = assignments(parameters)
    system = hamiltonian(H, parameters=values)
    for key, start in {"q0": q0, "p0": p0}.items():
        if len(start) != system.dof:
            raise InputError(
                f"{key}={shown(list(start))} of expression must be a list of {system.dof} finite numbers."
            )
    return Problem(system, q0=q0, p0=p0, t_end=t_end, title=H)


def assignments(text: str) -> dict[str, float]:
    """Return the values in a text such as ``"k=2, m=0.5"``.

    Raises
    ------
    problems.errors.InputError
        For anything else.
    """
    values: dict[str, float] = {}
    for part in filter(None, (piece.strip() for piece in text.split(","))):
        name, sign, number = (piece.strip() for piece in part.partition("="))
        try:
            value = float(number)
        except ValueError:
            value = math.nan
        if not sign or not NAME.fullmatch(name) or not math.isfinite(value):
            raise InputError(f'cannot read {part!r}; write parameters as "k=2, m=0.5".')
        if name in values:
            raise InputError(f"the parameter {name!r} is given twice.")
        if name in ("t", "pi", *OF_ONE_ARGUMENT) or COORDINATE.fullmatch(name):
            raise InputError(f"{name!r} has a meaning of its own and cannot be a parameter.")
        values[name] = value
    return values


def _freedom(energy: Formula) -> int:
    plain = [name for name in energy.coordinates if name in ("q", "p")]
    numbered = [name for name in energy.coordinates if name not in ("q", "p")]
    if plain and numbered:
        raise InputError(
            f"the formula {energy.text!r} mixes {plain[0]!r} with {numbered[0]!r}; number all coordinates."
        )
    dof = max((int(name[1:]) for name in numbered), default=1)
    if dof > MOST_FREEDOM:
        raise InputError(
            f"the formula {energy.text!r} has more than {MOST_FREEDOM} degrees of freedom; "
            "write it in Python with m.sum."
        )
    return dof


def _traceable(formula: Formula, values: Mapping[str, float], dof: int) -> Callable[..., Any]:
    """Return the function to be traced: the formula, calculated with symbols."""

    def H(t, q, p, par, m):
        def named(word: str) -> Any:
            if word == "t":
                return t
            coordinate = COORDINATE.fullmatch(word)
            if coordinate is None:
                if word not in values:
                    raise _undeclared(formula, word, values)
                return getattr(par, word)
            letter, number = coordinate.groups()
            if number is None and dof != 1:
                raise InputError(f"{word!r} in {formula.text!r} needs a number, such as {word}1.")
            if number is not None and int(number) > dof:
                raise InputError(
                    f"{word!r} in {formula.text!r} does not exist: H has {dof} degrees of freedom."
                )
            return (q if letter == "q" else p)[int(number or 1) - 1]

        return formula.value(named, m)

    return H


def _undeclared(formula: Formula, name: str, values: Mapping[str, float]) -> InputError:
    near = str(unknown("name", name, [*values, "q", "p", "t", "pi", *OF_ONE_ARGUMENT]))
    hint = near.partition("; ")[2] if "did you mean" in near else f'give it a value, as in "{name}=1".'
    return InputError(f"the formula {formula.text!r} contains {name!r}, which has no value; {hint}")
