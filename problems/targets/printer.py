"""A plan as Python text: what all targets have in common."""

from collections.abc import Callable, Sequence

from problems.graph.arithmetic import ARITHMETIC, LEAF, SUM
from problems.graph.fold import Visitor
from problems.graph.nodes import Affine, Loop, Node
from problems.targets.plan import Fill, Let, Plan, Reduce, Statement, Store, array_of

_LONGEST = 72
_PREFIX = {
    "y": "y",
    "par": "c",
    "out": "o",
    "value": "v",
    "summed": "a",  # outputs that a loop adds to, while they are in a variable
    "column": "i",  # of a loop's list of indices
}
"""What the variables of each kind are called, before a number.

No two prefixes are the same and none ends in a digit, so that variables of two kinds are never one;
the names without a number (``t``, ``i``, ``j``, ``k``, ``rows``) are none of them.
"""


def variable(kind: str, number: int) -> str:
    """Return the name of a variable in generated code; kinds are those of ``_PREFIX``."""
    return f"{_PREFIX[kind]}{number}"


Places = Callable[[Affine], str] | None
"""What prints a place that differs from term to term of a loop."""


class Printer(Visitor[None]):
    """Prints a plan's statements; a value used once is printed where it is used.

    Parameters
    ----------
    plan : Plan
        What to print.
    functions : dict
        Name of each function in the target, or a template with ``{}``.
    """

    def __init__(self, plan: Plan, functions: dict[str, str]) -> None:
        self.plan = plan
        self.names: dict[int, str] = {}
        self.lines: list[str] = []
        self.indent = "    "
        self._functions = functions
        self._pending: dict[int, tuple[str, int]] = {}
        self._count = 0
        self._tables: dict[str, str] = {}

    # What a target does in its own way.
    def store(self, place: int, value: str) -> None:
        """Print that an output is complete."""
        raise NotImplementedError

    def reduce(self, node: Node, loop: Loop, body: Sequence[Node]) -> None:
        """Print a declared sum."""
        raise NotImplementedError

    def fill(self, fill: Fill) -> None:
        """Print how an array of intermediate values is filled."""
        raise NotImplementedError

    def statements(self, statements: Sequence[Statement]) -> None:
        """Print statements in order."""
        for statement in statements:
            match statement:
                case Let(node):
                    self.let(node)
                case Store(place, node):
                    self.store(place, self.text(node))
                case Reduce(node, loop, body):
                    self.reduce(node, loop, body)
                case Fill():
                    self.fill(statement)

    def finished(self, signature: str) -> str:
        """Return the function that the lines make, preceded by its tables if it has any."""
        head = "".join(f"{name} = {text}\n" for text, name in self._tables.items())
        return head + f"def {signature}:\n" + "\n".join(self.lines) + "\n"

    def table(self, text: str) -> str:
        """Return the name of a table of numbers, one for each text."""
        return self._tables.setdefault(text, f"TABLE_{len(self._tables)}")

    def line(self, text: str) -> None:
        """Add a line."""
        self.lines.append(self.indent + text)

    def _next(self) -> int:
        """Return a number that no other value has, and no table."""
        self._count += 1
        return self._count - 1

    def assign(self, node: Node, text: str, name: str = "") -> None:
        """Add the line ``name = text`` and remember the name."""
        if not name:
            name = variable("value", self._next())
        self.names[node.id] = name
        self.line(f"{name} = {text}")

    def let(self, node: Node, index: Places = None) -> None:
        """Read an input, compute a value, or keep its text for the one place that uses it.

        ``index`` returns the text of a place that differs from term to term of a loop.
        """
        self.visit(node, [index])

    def visit_const(self, node: Node, index: Places) -> None:
        """Do nothing: constants are printed where they are used."""

    def visit_symbol(self, node: Node, index: Places) -> None:
        space, place = node.data
        if space == "t":
            self.names[node.id] = "t"
        elif isinstance(place, int):
            self.assign(node, f"{space}[{place}]", variable(space, place))
        else:
            assert index is not None
            self.assign(node, f"{space}[{index(place)}]")

    def visit_element(self, node: Node, index: Places) -> None:
        stage, place = node.data
        text = str(place) if isinstance(place, int) or index is None else index(place)
        self.assign(node, f"{array_of(stage)}[{text}]")

    def visit_entry(self, node: Node, index: Places) -> None:
        constants, place = node.data
        assert index is not None
        name = self.table(f"np.array({constants.values.tolist()!r})")
        self.assign(node, self.entry(name, index(place)))

    def visit_table(self, node: Node, index: Places) -> None:
        parts = (list(node.data.knots), list(map(list, node.data.rows)))
        arrays = ", ".join(self.table(f"np.array({part!r})") for part in parts)
        self._keep(node, f"table({arrays}, {self.text(node.args[0])})", LEAF)

    def visit_operation(self, node: Node, *_: Places) -> None:
        known = ARITHMETIC.get(node.op)
        if known is None:
            self._keep(node, self._call(self._functions[node.op], node.args), LEAF)
        elif known.arity == 1:
            self._keep(node, known.text + self.text(node.args[0], LEAF), known.level)
        else:
            left = self.text(node.args[0], known.level)
            self._keep(node, left + known.text + self.text(node.args[1], known.level + 1), known.level)

    def _call(self, name: str, args: Sequence[Node]) -> str:
        if len(args) > 1:
            return name.format(*(self.text(arg, LEAF) for arg in args))
        text = self.text(args[0])
        return name.format(text) if "{" in name else f"{name}({text})"

    def _keep(self, node: Node, text: str, level: int) -> None:
        """Keep the text of a value that is used once, or print it."""
        if self.plan.uses[node.id] == 1 and len(text) < _LONGEST:
            self._pending[node.id] = (text, level)
            self.names.pop(node.id, None)  # of an earlier loop over the same body
        else:
            self.assign(node, text)

    def entry(self, name: str, place: str) -> str:
        """Return the text of a number of an array, or of one for each term of a loop."""
        return f"{name}[{place}]"

    def waiting(self, node: Node) -> bool:
        """Whether a value's text waits for the one place that uses it."""
        return node.id in self._pending

    def text(self, node: Node, level: int = SUM) -> str:
        """Return the text of a value, in parentheses if it binds less tightly than ``level``."""
        if node.op == "const":
            return repr(node.data) if repr(node.data)[0] != "-" else f"({node.data!r})"
        if node.id in self.names:
            return self.names[node.id]
        text, binding = self._pending.pop(node.id)
        return text if binding >= level else f"({text})"
