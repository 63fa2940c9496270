"""Traced expressions as LaTeX, as the user wrote them; indices count from 1."""

import re
from collections.abc import Sequence

from problems.derive.function import Function
from problems.errors import InputError
from problems.graph.fold import Fold
from problems.graph.functions import FUNCTIONS
from problems.graph.nodes import Affine, Loop, Node
from problems.systems.base import System

LONGEST = 20_000  # characters: a formula beyond that is no longer read
_SUM, _SIGNED, _PRODUCT, _LEAF = 0, 1, 2, 3
_GREEK = frozenset(
    {"alpha", "beta", "gamma", "delta", "epsilon", "zeta", "eta", "theta", "kappa", "lambda", "mu"}
    | {"nu", "xi", "rho", "sigma", "tau", "phi", "chi", "psi", "omega"}
)
_LETTERS = "ijklm"


def latex(system: System, function: Function | None = None) -> str:
    """Return a scalar function of a system as LaTeX.

    Parameters
    ----------
    system : System
        The traced system.
    function : Function, optional
        One of its functions, the energy by default; of several outputs each, separated by commas.

    Returns
    -------
    str
        Without dollar signs. Positions and momenta are q_1 .. p_n (q and p where there is
        one of each), states of other systems y_1 .. y_n; the terms of a
        declared sum stand behind a summation sign.

    Raises
    ------
    problems.errors.InputError
        If the system has no such function, or the formula is longer than `LONGEST`.
    """
    printer = _Printer(system)
    function = function or system.function("hamiltonian")
    if function.loops:
        raise InputError(
            f"{function.name} of {system.name} is not one formula; print the Hamiltonian instead."
        )
    texts = [printer.text(term.node) for terms in function.outputs for term in terms]
    return ",\\ ".join(texts)


class _Printer(Fold[tuple[str, int]]):
    """The text of nodes, and how tightly it binds."""

    def __init__(self, system: System) -> None:
        super().__init__()
        self.system = system

    def text(self, root: Node) -> str:
        return self.of(root)[0]

    def visit(self, node: Node, results: Sequence[tuple[str, int]]) -> tuple[str, int]:
        text, level = super().visit(node, results)
        if len(text) > LONGEST:
            raise InputError(f"the formula of {self.system.name} is longer than {LONGEST} characters.")
        return text, level

    def _at(self, node: Node, level: int) -> str:
        return _bound(self.known[node.id], level)

    def visit_const(self, node: Node) -> tuple[str, int]:
        return _number(node.data)

    def visit_symbol(self, node: Node) -> tuple[str, int]:
        return self._symbol(node), _LEAF

    def visit_entry(self, node: Node) -> tuple[str, int]:
        return f"a_{{{_index(node.data[1], 1)}}}", _LEAF

    def visit_element(self, node: Node, *_: tuple[str, int]) -> tuple[str, int]:
        raise InputError(
            f"a formula of {self.system.name} reads values that a loop makes: it is not one line."
        )

    def visit_index(self, node: Node) -> tuple[str, int]:
        return _index(node.data, 0), _SUM

    def visit_add(self, node: Node, *args: tuple[str, int]) -> tuple[str, int]:
        left, right = (_bound(arg, _SUM) for arg in args)
        return (f"{left} - {right[1:]}" if right.startswith("-") else f"{left} + {right}"), _SUM

    def visit_sub(self, node: Node, a: tuple[str, int], b: tuple[str, int]) -> tuple[str, int]:
        return f"{_bound(a, _SUM)} - {_bound(b, _PRODUCT)}", _SUM

    def visit_neg(self, node: Node, a: tuple[str, int]) -> tuple[str, int]:
        return f"-{_bound(a, _PRODUCT)}", _SIGNED

    def visit_mul(self, node: Node, *_: tuple[str, int]) -> tuple[str, int]:
        return self._product(node)

    def visit_div(self, node: Node, *args: tuple[str, int]) -> tuple[str, int]:
        above, below = (_bound(arg, _SUM) for arg in args)
        return f"\\frac{{{above}}}{{{below}}}", _PRODUCT

    def visit_pow(self, node: Node, *_: tuple[str, int]) -> tuple[str, int]:
        return self._power(node.args[0], node.data), _PRODUCT

    def visit_sum(self, node: Node, body: tuple[str, int]) -> tuple[str, int]:
        return f"{_range(node.data)} {_bound(body, _PRODUCT)}", _PRODUCT

    def visit_where(self, node: Node, *args: tuple[str, int]) -> tuple[str, int]:
        condition, a, b = (_bound(arg, _SUM) for arg in args)
        pieces = f"{a} & {condition} > 0 \\\\ {b} & \\text{{else}}"
        return f"\\begin{{cases}} {pieces} \\end{{cases}}", _LEAF

    def visit_table(self, node: Node, x: tuple[str, int]) -> tuple[str, int]:
        return f"\\operatorname{{table}}\\left({_bound(x, _SUM)}\\right)", _LEAF

    def visit_operation(self, node: Node, *args: tuple[str, int]) -> tuple[str, int]:
        form = FUNCTIONS[node.op].latex
        return form % tuple(_bound(arg, _SUM) for arg in args), _PRODUCT if "^" in form else _LEAF

    def _power(self, base: Node, exponent: int) -> str:
        text, binding = self.known[base.id]
        if base.op in ("sin", "cos", "tan") and exponent > 1:
            return text.replace(base.op, f"{base.op}^{{{exponent}}}", 1)
        if binding < _LEAF or text[0].isdigit():
            text = f"\\left({text}\\right)"
        return text if exponent == 1 else f"{text}^{{{exponent}}}"

    def _product(self, node: Node) -> tuple[str, int]:
        factors: dict[int, list[Node]] = {}
        for factor in _factors(node):
            factors.setdefault(factor.id, []).append(factor)
        constant, divisor = "", ""
        rest: list[tuple[Node, int]] = []
        for same in factors.values():
            factor, count = same[0], len(same)
            if factor.op != "const" or count > 1:
                rest.append((factor, count))
                continue
            inverse = 1.0 / factor.data if factor.data else 0.0
            if inverse.is_integer() and 1.0 < inverse < 1000:
                divisor = str(int(inverse))
            else:
                constant = self._at(factor, _PRODUCT)
        level = _SUM if divisor and not constant and len(rest) == 1 else _PRODUCT
        words = [self._at(f, level) if count == 1 else self._power(f, count) for f, count in rest]
        if constant and words and words[0][0].isdigit():
            constant += " \\cdot"
        text = " ".join(([constant] if constant else []) + words)
        return (f"\\frac{{{text}}}{{{divisor}}}" if divisor else text), _PRODUCT

    def _symbol(self, node: Node) -> str:
        space, place = node.data
        if space == "t":
            return "t"
        if space == "par":
            return self._parameter(node)
        dof = self.system.dof
        if isinstance(place, Affine):
            assert node.loop is not None
            low = int(place.values(node.loop).min())
            letter = "y" if dof is None else ("q" if low < dof else "p")
            base = dof if letter == "p" and dof is not None else 0
            return f"{letter}_{{{_index(place, 1 - base)}}}"
        if dof is None:
            return "y" if self.system.dim == 1 else f"y_{{{place + 1}}}"
        letter, number = ("q", place + 1) if place < dof else ("p", place - dof + 1)
        return letter if dof == 1 else f"{letter}_{{{number}}}"

    def _parameter(self, node: Node) -> str:
        place = node.data[1]
        low = place if isinstance(place, int) else int(place.values(node.loop).min())
        offset = 0
        for name, value in self.system.parameters.items():
            size = len(value) if isinstance(value, tuple) else None
            if low < offset + (size or 1):
                if size is None:
                    return _word(name)
                index = str(place - offset + 1) if isinstance(place, int) else _index(place, 1 - offset)
                return _word(name, index)
            offset += size or 1
        raise AssertionError(f"no parameter at {low}")


def _bound(result: tuple[str, int], level: int) -> str:
    """Return a text, in parentheses if it binds less tightly than ``level``."""
    text, binding = result
    return text if binding >= level else f"\\left({text}\\right)"


def _factors(node: Node) -> list[Node]:
    if node.op != "mul":
        return [node]
    return _factors(node.args[0]) + _factors(node.args[1])


def _number(value: float) -> tuple[str, int]:
    text = str(int(value)) if value.is_integer() and abs(value) < 1e15 else repr(value)
    mantissa, _, exponent = text.partition("e")
    if exponent:
        power = f"10^{{{int(exponent)}}}"
        text = power if mantissa == "1" else f"-{power}" if mantissa == "-1" else f"{mantissa} \\cdot {power}"
    return text, _SIGNED if text.startswith("-") else _PRODUCT if exponent else _LEAF


def _index(affine: Affine, shift: int) -> str:
    """Return an affine index whose letters count from 1 while the loop's integers count from 0."""
    text = ""
    for letter, c in zip(_LETTERS, affine.coefficients, strict=False):
        if c:
            sign = "-" if c < 0 else "+" if text else ""
            text += f"{sign}{'' if abs(c) == 1 else abs(c)}{letter}"
    constant = affine.offset + shift - sum(affine.coefficients)
    return f"{text}{constant:+d}" if text and constant else text or str(constant)


def _range(loop: Loop) -> str:
    rows = [tuple(row) for row in loop.rows.tolist()]
    n = len(rows)
    if loop.width == 1:
        first = rows[0][0]
        if rows == [(first + i,) for i in range(n)]:
            return f"\\sum_{{i={first + 1}}}^{{{first + n}}}"
    if loop.width == 2:
        size = max(max(row) for row in rows) + 1
        if rows == [(i, j) for i in range(size) for j in range(i + 1, size)]:
            return f"\\sum_{{1 \\le i < j \\le {size}}}"
        if rows == [(i, (i + 1) % n) for i in range(n)]:
            return f"\\sum_{{i=1,\\ j=i+1\\,(\\mathrm{{mod}}\\,{n})}}^{{{n}}}"
    letters = ",".join(_LETTERS[: loop.width])
    return f"\\sum_{{({letters}) \\in \\mathcal{{I}}_{{{n}}}}}"


def _word(name: str, index: str = "") -> str:
    stem, _, tail = name.partition("_")
    match = re.fullmatch(r"([A-Za-z]+)(\d+)", stem)
    if match and not tail:
        stem, tail = match.groups()
    letter = {"eps": "\\varepsilon"}.get(stem) or (f"\\{stem}" if stem in _GREEK else stem)
    if len(stem) > 1 and letter == stem:
        letter = f"\\mathrm{{{stem}}}"
    below = ",".join(part for part in (tail, index) if part)
    return f"{letter}_{{{below}}}" if below else letter
