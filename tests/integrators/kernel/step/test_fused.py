"""Iterations compiled together with the field do exactly what they do one by one."""

import numpy as np
import pytest

import problems
from integrators.kernel import routes
from integrators.kernel.engines import iterations
from integrators.kernel.native import binary, machine
from integrators.kernel.native.around import Around
from integrators.kernel.plan import Plan
from integrators.kernel.program import HBVMProgram

CASES = [
    ("kepler", {"k": 8, "s": 8, "h": 0.2}),
    ("kepler", {"k": 16, "s": 16, "h": 0.4}),
    ("henon_heiles", {"k": 12, "s": 3, "h": 0.5}),
    ("henon_heiles", {"k": 5, "s": 2, "h": 0.1, "form": "first"}),
    ("period_annulus", {"k": 8, "s": 3, "h": 0.5}),
    ("pendulum", {"k": 16, "s": 8, "h": 0.5}),
    ("double_pendulum", {"k": 16, "s": 12, "h": 0.3}),
    ("rigid_body", {"k": 16, "s": 12, "h": 0.3}),  # an odd number of rows
]


def run(problem, settings, times):
    stepper = HBVMProgram(problem.system, Plan(**settings)).start(problem.y0, problem.par)
    return stepper.advance(times).y, stepper.stats


@pytest.mark.parametrize(("name", "settings"), CASES, ids=lambda value: str(value))
def test_fused_sweeps_make_the_same_bits(name, settings, monkeypatch):
    problem = problems.load(name)
    times = np.arange(1, 60) * (0.7 * settings["h"])  # partial steps as well
    program = HBVMProgram(problem.system, Plan(**settings))
    assert program.contexts(problem.par)[0].fused != 0
    fused = run(problem, settings, times)
    other = not machine.many_registers()
    monkeypatch.setattr(machine, "many_registers", lambda: other)
    assert run(problem, settings, times)[0].tobytes() == fused[0].tobytes()
    monkeypatch.setattr(routes, "FEW_ROWS", 0)
    assert HBVMProgram(problem.system, Plan(**settings)).contexts(problem.par)[0].fused == 0
    alone = run(problem, settings, times)
    assert fused[0].tobytes() == alone[0].tobytes()
    assert fused[1] == alone[1]


def test_larger_systems_wider_methods_and_other_masses_are_not_fused():
    def fused(problem, **settings):
        return HBVMProgram(problem.system, Plan(**settings)).contexts(problem.par)[0].fused != 0

    assert not fused(problems.load("outer_solar_system"), k=8, s=8, h=1.0)
    assert not fused(problems.load("kepler"), k=20, s=8, h=0.1)
    assert not fused(problems.load("sitnikov"), k=8, s=8, h=0.1)


def test_a_step_is_solved_with_the_last_change_still_visible_and_its_effect_removed():
    """The field is evaluated at stages whose next change would be nothing."""
    problem = problems.load("kepler")
    stepper = HBVMProgram(problem.system, Plan(k=16, s=16, h=0.2)).start(problem.y0, problem.par)
    changes = []
    for n in range(1, 40):
        stepper.advance([0.2 * n])
        changes.append(stepper._context.solver.last)
    assert max(changes) > 1e-16  # measured 6.8e-14: without the prediction it would have gone on
    energy = problem.errors(stepper.y[None])["energy"].max()
    assert energy < 5e-15  # measured 1.2e-15


def test_iterations_are_lowered_once_for_a_form_and_linked_with_each_field(tmp_path, monkeypatch):
    monkeypatch.setenv("HBVM_BENCH_CACHE", str(tmp_path))
    monkeypatch.setattr(binary, "_loaded", {})
    lowered = []
    lower = Around.lower
    monkeypatch.setattr(Around, "lower", lambda self, form: lowered.append(form) or lower(self, form))
    for name in ("henon_heiles", "kepler", "period_annulus"):
        assert not iterations.code(problems.load(name).system, "field", 8, (8, 4, True)).from_cache
    assert len(lowered) <= 1  # 0 where the text lies beside the package
