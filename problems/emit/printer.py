"""Expressions as Python text, shared by all emitters."""

from problems.trace.graph import Node

_SUM, _PRODUCT, _LEAF = 1, 2, 3
_OPERATORS = {"add": (" + ", _SUM), "sub": (" - ", _SUM), "mul": ("*", _PRODUCT), "div": ("/", _PRODUCT)}
_LONGEST = 72


class Printer:
    """Prints operations; a value used once is printed where it is used.

    Parameters
    ----------
    uses : dict
        How often each node is used.
    functions : dict
        Name of each function in the target, or a template with ``{}``.
    """

    def __init__(self, uses: dict[int, int], functions: dict[str, str]) -> None:
        self.names: dict[int, str] = {}
        self.lines: list[str] = []
        self.indent = "    "
        self._uses = uses
        self._functions = functions
        self._pending: dict[int, tuple[str, int]] = {}
        self._count = 0

    def line(self, text: str) -> None:
        """Add a line."""
        self.lines.append(self.indent + text)

    def assign(self, node: Node, text: str, name: str = "") -> None:
        """Add the line ``name = text`` and remember the name."""
        if not name:
            name = f"v{self._count}"
            self._count += 1
        self.names[node.id] = name
        self.line(f"{name} = {text}")

    def let(self, node: Node) -> None:
        """Compute a value, or keep its text for the one place that uses it."""
        if node.op == "const":
            return
        text, level = self._operation(node)
        if self._uses.get(node.id, 0) == 1 and len(text) < _LONGEST:
            self._pending[node.id] = (text, level)
        else:
            self.assign(node, text)

    def waiting(self, node: Node) -> bool:
        """Whether a value's text waits for the one place that uses it."""
        return node.id in self._pending

    def text(self, node: Node, level: int = _SUM) -> str:
        """Return the text of a value, in parentheses if it binds less tightly than ``level``."""
        if node.op == "const":
            return repr(node.data) if repr(node.data)[0] != "-" else f"({node.data!r})"
        if node.id in self.names:
            return self.names[node.id]
        text, binding = self._pending.pop(node.id)
        return text if binding >= level else f"({text})"

    def _operation(self, node: Node) -> tuple[str, int]:
        if node.op in _OPERATORS:
            symbol, level = _OPERATORS[node.op]
            left = self.text(node.args[0], level)
            return left + symbol + self.text(node.args[1], level + 1), level
        if node.op == "neg":
            return "-" + self.text(node.args[0], _LEAF), _SUM
        name = self._functions[node.op]
        text = self.text(node.args[0])
        return (name.format(text) if "{" in name else f"{name}({text})"), _LEAF
