"""Powers and small declared sums written out, before a function is put in order."""

from collections.abc import Sequence

from problems.calculus.gradient import reachable
from problems.trace.graph import Graph, Node
from problems.trace.sums import Affine, Loop


def body_of(roots: Sequence[Node], loop: Loop) -> list[Node]:
    """Return the nodes inside a loop that ``roots`` depend on, arguments first."""
    seen: dict[int, Node] = {}
    stack = list(roots)
    while stack:
        node = stack.pop()
        if node.loop is loop and node.id not in seen:
            seen[node.id] = node
            stack.extend(node.args)
    return [seen[key] for key in sorted(seen)]


class Rewriter:
    """Expands powers, and the declared sums that are small enough."""

    def __init__(self, graph: Graph, limit: int | None, roots: Sequence[Node]) -> None:
        self.graph = graph
        self.limit = limit
        self.done: dict[int, Node] = {}
        self._uses: dict[int, int] = {}
        for arg in [arg for node in reachable(list(roots)) for arg in node.args] + list(roots):
            self._uses[arg.id] = self._uses.get(arg.id, 0) + 1
        self.rewrite(roots)

    def small(self, loop: Loop, roots: Sequence[Node]) -> bool:
        # A root that does not vary in the loop still stands in each of its terms.
        operations = max(len(body_of(roots, loop)), len(roots))
        return self.limit is None or len(loop) * operations <= self.limit

    def rewrite(self, roots: Sequence[Node]) -> None:
        for node in reachable(list(roots)):
            if node.id in self.done or node.loop is not None:
                continue
            if node.op == "sum":
                self.done[node.id] = self._sum(node)
            else:
                self.done[node.id] = self._apply(node, self.done)

    def _apply(self, node: Node, done: dict[int, Node]) -> Node:
        args = tuple(done[arg.id] if arg.id in done else self.done[arg.id] for arg in node.args)
        if node.op == "pow":
            return self.graph.expanded(args[0], node.data)
        if node.op == "neg" and args[0].op == "sub" and self._uses[node.args[0].id] == 1:
            return self.graph.sub(*args[0].args[::-1])  # -(a - b), used here only
        return self.graph.apply(node, args)

    def _sum(self, node: Node) -> Node:
        loop, root = node.data, node.args[0]
        if not self.small(loop, [root]):
            return self.graph.sum(self.inside([root], loop)[0], loop)
        total: Node | None = None
        for (term,) in self.written_out([root], loop):
            total = term if total is None else total + term
        assert total is not None
        return total

    def inside(self, roots: Sequence[Node], loop: Loop) -> list[Node]:
        """Rewrite nodes inside a loop that stays one."""
        done: dict[int, Node] = {}
        for node in body_of(roots, loop):
            done[node.id] = node if node.op in ("symbol", "index") else self._apply(node, done)
        return [done[root.id] if root.id in done else self.done[root.id] for root in roots]

    def written_out(self, roots: Sequence[Node], loop: Loop) -> list[list[Node]]:
        """Return the roots at every term of a loop."""
        body = body_of(roots, loop)
        places = {n.id: _affine(n).values(loop) for n in body if n.op in ("symbol", "index")}
        rows: list[list[Node]] = []
        for k in range(len(loop)):
            done: dict[int, Node] = {}
            for node in body:
                if node.op == "symbol":
                    place = int(places[node.id][k])
                    done[node.id] = self.graph.symbol(node.data[0], place, flags=node.flags)
                elif node.op == "index":
                    done[node.id] = self.graph.const(float(places[node.id][k]))
                else:
                    done[node.id] = self._apply(node, done)
            rows.append([done[root.id] if root.id in done else self.done[root.id] for root in roots])
        return rows


def _affine(node: Node) -> Affine:
    return node.data[1] if node.op == "symbol" else node.data
