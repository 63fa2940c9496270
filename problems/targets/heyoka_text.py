"""Emission to heyoka: expressions of its own symbols, all sums written out."""

from problems.errors import InputError
from problems.graph.functions import CALLED
from problems.graph.nodes import Node
from problems.targets.plan import Plan
from problems.targets.printer import Places, Printer

_FUNCTIONS = {name: f.heyoka for name, f in CALLED.items() if f.heyoka is not None}


class _HeyokaPrinter(Printer):
    def visit_symbol(self, node: Node, index: Places) -> None:
        # An expression by itself: no variable is needed to hold it.
        space, place = node.data
        self.names[node.id] = "t" if space == "t" else f"{space}[{place}]"

    def visit_table(self, node: Node, index: Places) -> None:
        raise InputError(
            "m.table is pieces of polynomials, of which a Taylor series sees one only; "
            "use a method that needs no Taylor series."
        )

    def visit_operation(self, node: Node, *index: Places) -> None:
        if node.op in CALLED and node.op not in _FUNCTIONS:
            raise InputError(
                f"heyoka has no m.{node.op} that is right to all digits; use a method of another library."
            )
        super().visit_operation(node, *index)

    def store(self, place: int, value: str) -> None:
        self.line(f"out[{place}] = {value}")


def heyoka_text(plan: Plan, name: str) -> str:
    """Return ``def name(t, y, par, hy)``, which returns the list of expressions."""
    printer = _HeyokaPrinter(plan, _FUNCTIONS)
    printer.line(f"out = [None]*{plan.n_out}")
    printer.statements(plan.first)
    printer.line("return out")
    return printer.finished(f"{name}(t, y, par, hy)")
