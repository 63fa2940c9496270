"""Emission to heyoka: expressions of its own symbols, all sums written out."""

from collections.abc import Callable

from problems.errors import InputError
from problems.graph.functions import CALLED
from problems.graph.nodes import Affine, Node
from problems.targets.plan import Plan
from problems.targets.printer import Printer

_FUNCTIONS = {name: f.heyoka for name, f in CALLED.items() if f.heyoka is not None}


class _HeyokaPrinter(Printer):
    def let(self, node: Node, index: Callable[[Affine], str] | None = None) -> None:
        if node.op == "symbol":  # an expression by itself: no variable is needed to hold it
            space, place = node.data
            self.names[node.id] = "t" if space == "t" else f"{space}[{place}]"
        elif node.op in CALLED and node.op not in _FUNCTIONS:
            raise InputError(
                f"heyoka has no m.{node.op} that is right to all digits; use a method of another library."
            )
        elif node.op == "table":
            raise InputError(
                "m.table is pieces of polynomials, of which a Taylor series sees one only; "
                "use a method that needs no Taylor series."
            )
        else:
            super().let(node, index)

    def store(self, place: int, value: str) -> None:
        self.line(f"out[{place}] = {value}")


def heyoka_text(plan: Plan, name: str) -> str:
    """Return ``def name(t, y, par, hy)``, which returns the list of expressions."""
    printer = _HeyokaPrinter(plan, _FUNCTIONS)
    printer.line(f"out = [None]*{plan.n_out}")
    printer.statements(plan.first)
    printer.line("return out")
    return printer.finished(f"{name}(t, y, par, hy)")
