"""What an iteration of the kernel costs, beside what the processor could do at best.

``python reports/costs/budget.py "outer_solar_system" --k 8 --s 8`` counts the
operations of the vector field and of the product, and measures the time of an
iteration and of what a step needs besides; ``--assembly`` prints the field's machine
code instead. ``docs/kernel.md`` reads an example.
"""

import argparse
import ast
from collections import Counter
from dataclasses import dataclass
from time import perf_counter

import numpy as np

import problems
from integrators.kernel.native import binary, machine, stages
from integrators.kernel.plan import Plan
from integrators.kernel.program import HBVMProgram
from integrators.kernel.routes import WIDE
from problems import targets
from problems.problem import Problem, System

NAMES = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/"}
STEPS, ROUNDS = 2000, 15
SHARES = (0.25, 0.5, 0.75, 1.0)  # of h: steps that need different numbers of iterations


@dataclass(frozen=True)
class Cost:
    """Measured times.

    Attributes
    ----------
    iteration, step : float
        Nanoseconds per iteration, and per step besides its iterations: the straight
        line through the fastest of `ROUNDS` runs at each of `SHARES` of h.
    iterations : float
        Per step of length h.
    """

    iteration: float
    step: float
    iterations: float


def operations(source: str) -> Counter[str]:
    """Count the operations on lanes in the text of an emitted function.

    Loops count as often as they run. What depends on parameters alone is scalar, done
    once for all stages, and left out.

    Returns
    -------
    Counter
        Of ``+``, ``-``, ``*``, ``/``, and function names.
    """
    counts: Counter[str] = Counter()
    uniform: set[str] = set()

    def varies(node: ast.expr, times: int) -> bool:
        """Count an expression; return whether it differs from lane to lane."""
        if isinstance(node, ast.BinOp):
            sides = [varies(side, times) for side in (node.left, node.right)]
            if any(sides):
                counts[NAMES[type(node.op)]] += times
            return any(sides)
        if isinstance(node, ast.UnaryOp):
            return varies(node.operand, times)
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            arguments = [varies(argument, times) for argument in node.args]
            counts[node.func.id] += times * any(arguments)
            return any(arguments)
        if isinstance(node, ast.Subscript):
            return not (isinstance(node.value, ast.Name) and node.value.id == "par")
        return isinstance(node, ast.Name) and node.id not in uniform

    def count(statements: list[ast.stmt], times: int) -> None:
        for statement in statements:
            if isinstance(statement, ast.For) and isinstance(statement.iter, ast.Call):
                bounds = [ast.literal_eval(bound) for bound in statement.iter.args]
                count(statement.body, times * len(range(*bounds)))
            elif isinstance(statement, ast.Assign):
                target = statement.targets[0]
                if not varies(statement.value, times) and isinstance(target, ast.Name):
                    uniform.add(target.id)

    (function,) = ast.parse(source).body
    if isinstance(function, ast.FunctionDef):
        count(function.body, 1)
    return counts


def measure(problem: Problem, k: int, s: int, h: float) -> Cost:
    """Measure an iteration and a step; see `Cost`."""
    programs = [HBVMProgram(problem.system, Plan(k=k, s=s, h=h * share)) for share in SHARES]
    fastest, iterations = np.full(len(SHARES), np.inf), np.zeros(len(SHARES))
    for _ in range(ROUNDS):
        for i, program in enumerate(programs):
            stepper = program.start(problem.y0, problem.par)
            end = np.array([STEPS * program.h])
            started = perf_counter()
            stepper.advance(end)
            fastest[i] = min(fastest[i], perf_counter() - started)
            iterations[i] = (stepper.stats.iterations or 0) / STEPS
    iteration, step = np.polyfit(iterations, fastest / STEPS * 1e9, 1)
    return Cost(float(iteration), float(step), float(iterations[-1]))


def _say(problem: Problem, k: int, s: int, h: float) -> None:
    program = HBVMProgram(problem.system, Plan(k=k, s=s, h=h))
    shape, constants = program.shape, program.constants
    quantity = "force" if program.second else "field"
    counts = operations(targets.source(problem.system, quantity, "numba").text)
    lanes = constants.lanes * -(-k // constants.lanes)
    plain = sum(n for name, n in counts.items() if name in "+-*")
    others = ", ".join(f"{lanes * n} {name}" for name, n in sorted(counts.items()) if name not in "+-*")
    form = "second" if program.second else "first"
    print(f"{problem!r}, HBVM({k}, {s}), h = {h:g}, {form}-order form, {shape.rows} rows, {lanes} lanes")
    print(f"  field    {lanes * plain} flops" + (f", {others}" if others else ""))
    if constants.route in (8, 16):
        print(f"  product  {2 * shape.rows * constants.route * lanes} flops")
    elif constants.route == WIDE:
        print(f"  product  {2 * shape.rows * lanes * lanes} flops")
    else:
        modes = 8 * -(-(s + constants.first) // 8)
        print(f"  product  {4 * shape.rows * lanes * modes} flops, through {s} coefficients")
    cost = measure(problem, k, s, h)
    print(f"  measured {cost.iteration:.1f} ns per iteration, {cost.iterations:.1f} iterations per step,")
    print(f"           {cost.step:.0f} ns per step besides ({machine.processor()})")


def assembly(system: System, quantity: str, lanes: int) -> str:
    """Return the machine code of a function of a system that runs on lanes, as text."""
    function, arguments = stages.on_lanes(targets.numba(system, quantity).py_func, lanes)
    with machine.alone():
        module = binary.linked(function, arguments, "void")
        machine.optimized(module)
        return machine.target_machine().emit_assembly(module)


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(prog="python -m integrators.kernel.budget", description=__doc__)
    parser.add_argument("problem", choices=problems.names(), metavar="problem")
    parser.add_argument("--k", type=int, default=8)
    parser.add_argument("--s", type=int, default=8)
    parser.add_argument("--h", type=float, default=1.0)
    parser.add_argument("--assembly", action="store_true", help="print the machine code of the field")
    given = parser.parse_args()
    problem = problems.load(given.problem)
    if given.assembly:
        program = HBVMProgram(problem.system, Plan(k=given.k, s=given.s, h=given.h))
        print(assembly(problem.system, "force" if program.second else "field", program.constants.lanes))
    else:
        _say(problem, given.k, given.s, given.h)


if __name__ == "__main__":
    main()
