"""Emission to heyoka: expressions of its own symbols, all sums written out."""

from problems.emit.plan import Let, Plan, Store
from problems.emit.printer import Printer
from problems.trace.graph import FUNCTIONS


def heyoka_text(plan: Plan, name: str) -> str:
    """Return ``def name(t, y, par, hy)``, which returns the list of expressions."""
    functions = {f: f"hy.{f}" for f in FUNCTIONS} | {
        "abs": "(hy.relu({0}) + hy.relu(-({0})))",
        "sign": "(hy.relup({0}) - hy.relup(-({0})))",
    }
    printer = Printer(plan.uses, functions)
    printer.line(f"out = [None]*{plan.n_out}")
    for statement in plan.first:
        match statement:
            case Let(node) if node.op == "symbol":
                space, place = node.data
                printer.names[node.id] = "t" if space == "t" else f"{space}[{place}]"
            case Let(node):
                printer.let(node)
            case Store(place, node):
                printer.line(f"out[{place}] = {printer.text(node)}")
    printer.line("return out")
    return f"def {name}(t, y, par, hy):\n" + "\n".join(printer.lines) + "\n"
