"""Steps in lanes are lowered once for each width; loops are unrolled where a field is linked with them."""

import re
from functools import partial

import problems
from integrators.kernel import tables
from integrators.kernel.engines import lanes
from integrators.kernel.ensemble.form import JUDGED, Form
from integrators.kernel.native import binary, machine, stages
from integrators.kernel.native.around import unrolling
from problems import targets

K, ROWS = 6, 2


def optimized(text):
    """Return LLVM's text of adaptive steps for Hénon and Heiles' field."""
    numbers = {"k": K, "rows": ROWS, "second": 1, "varying": 1, "unrolled": 1, "held": 1}
    blocks = {"blocks.groups": 1, "blocks.count": ROWS, "blocks.width": 1}
    judged = dict(zip(JUDGED, tables.degrees_judged(K, K - 2), strict=True))
    constants = Form(numbers | blocks | judged, {}).words.tolist()
    system = problems.load("henon_heiles").system
    function, arguments = stages.on_lanes(targets.numba(system, "force").py_func, 8, par=True)
    linked = partial(lanes._linked, [kind for _, kind in arguments], text, constants)
    with machine.alone():
        module = binary.linked(function, arguments, "void", linked)
        machine.optimized(module)
        return str(module)


def test_all_loops_over_numbers_are_unrolled_and_llvm_warns_of_none(capfd):
    text = lanes.text((8, 8))
    made = optimized(unrolling(text))
    assert capfd.readouterr().err == ""
    assert "alloca" not in made  # rows are in registers
    assert len(re.findall(r"phi i64", made)) == 2  # steps and iterations are counted
    assert len(re.findall(r"phi i64", optimized(text))) > 2
