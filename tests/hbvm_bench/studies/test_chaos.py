"""The study of chaos: its systems, what it says of published values, and its page."""

from dataclasses import replace

import numpy as np
import pytest
from msgspec.structs import replace as with_fields

from hbvm_bench.campaign.file import load
from hbvm_bench.campaign.shorter import quick_run
from hbvm_bench.cli import main
from hbvm_bench.summaries.table import NONE
from integrators import lyapunov
from problems import targets
from tests.hbvm_bench.study_folders import REPORTS, module

exponents, maps, orbits, report = (
    module("chaos", name) for name in ("exponents", "maps", "orbits", "blocks")
)
SKIP, SYSTEMS = module("chaos", "systems").SKIP, module("chaos", "systems").SYSTEMS


@pytest.mark.parametrize("name", [name for name, one in SYSTEMS.items() if one.divergence is not None])
def test_the_divergence_is_the_trace_of_the_jacobian(name):
    problem = SYSTEMS[name].problem()
    field = targets.numpy(problem.system, "field")
    rng = np.random.default_rng(3)
    step = 1e-6
    for y in problem.y0 + rng.uniform(-0.5, 0.5, (3, problem.system.dim)):
        trace = 0.0
        for i, unit in enumerate(np.eye(problem.system.dim)):
            ahead, behind = (np.array(field(0.7, y + sign * step * unit, problem.par)) for sign in (1, -1))
            trace += (ahead - behind)[i] / (2 * step)
        assert trace == pytest.approx(SYSTEMS[name].divergence, abs=1e-7)  # measured at most 3e-9


def test_heyoka_and_we_have_the_same_sum_of_exponents():
    """Thomas's exponents are small, so rounding has not parted the trajectories at this end."""
    problem = SYSTEMS["thomas"].problem(0.003)
    theirs = exponents.Variational(problem).run(2048)
    ours = lyapunov(problem, exponents.METHOD, skip=SKIP)
    assert theirs.sum() == pytest.approx(ours.sum, abs=1e-11)
    assert ours.sum == pytest.approx(-0.54, abs=1e-11)
    assert theirs.shape == ours.exponents.shape


def made_up(name, largest, heyoka, total):
    dim = SYSTEMS[name].problem().system.dim
    values = np.zeros(dim)
    values[0] = largest
    return exponents.Measured(
        exponents=values,
        intervals=np.stack([values - 0.01, values + 0.01], axis=1),
        sum=total,
        time=1000.0,
        heyoka=np.full(dim, heyoka),
        seconds=[1.0],
        heyoka_seconds=[0.5],
        others=0.0,
        stolen=0.0,
    )


def decided(name, index, here):
    known = SYSTEMS[name]
    return report._decided(known, known.published[index], here)


def test_a_published_spectrum_that_breaks_an_exact_relation_is_reported():
    rusyn = decided("rucklidge", 1, made_up("rucklidge", 0.3, 0.305, -3.0))
    assert "add up to -3.0016" in rusyn
    assert "heyoka's value is 0.3050, inside this interval" in rusyn
    pairs = decided("henon_heiles", 0, made_up("henon_heiles", 0.0, 0.0, 0.0))
    assert "the published ones add up to 0.0270 and are not paired" in pairs


def test_a_published_spectrum_with_the_exact_sum_is_not_called_wrong():
    sprott = decided("rucklidge", 0, made_up("rucklidge", 0.19, 0.5, -3.0))
    assert "the sum does not decide" in sprott
    assert "outside this interval" in sprott


def test_times_on_a_busy_machine_are_not_judged():
    quiet = made_up("lorenz", 0.9, 0.9, -41 / 3)
    table = report._times({"lorenz": replace(quiet, others=0.01)})
    assert "not judged" not in " ".join(table.rows[0])
    assert "During the timing other work took at most 1% of a core." in table.note
    made = report._times({"lorenz": replace(quiet, others=0.5)})
    assert " ".join(made.rows[0]).count("(not judged)") == 2
    assert "at most 50%" in made.note


def test_the_sum_is_compared_with_the_mean_divergence_where_that_is_not_constant():
    older = made_up("rossler", 0.07, 0.07, -5.33)
    assert report._times({"rossler": older}).rows[0][5] == NONE
    newer = replace(older, divergence=-5.33 + 1e-12)
    assert report._times({"rossler": newer}).rows[0][5] == "1e-12"
    assert "where that is a constant" in report._times({"rossler": older}).note
    assert "the times of HBVM() contain its integration" in report._times({"rossler": newer}).note
    lorenz = made_up("lorenz", 0.9, 0.9, -41 / 3 + 1e-12)
    assert report._times({"lorenz": lorenz}).rows[0][5] == "1e-12"


@pytest.mark.parametrize(
    ("name", "cell"), [("lorenz", "not installed"), ("thomas", NONE)], ids=["one of its systems", "another"]
)
def test_without_pynamicalsys_the_row_says_so(name, cell, monkeypatch):
    monkeypatch.setattr(exponents, "installed", lambda: False)
    here = exponents.measured(name, 0.002, 1)
    assert here.pynamicalsys is None
    table = report._times({name: here})
    assert table.rows[0][-2:] == (NONE, cell)
    assert "times as long as HBVM()" not in table.note


def test_pynamicalsys_has_the_same_sum_of_exponents():
    pytest.importorskip("pynamicalsys")
    here = exponents.measured("lorenz", 0.005, 1)
    assert here.pynamicalsys.sum() == pytest.approx(-41 / 3, abs=1e-4)  # measured: 1.3e-8
    table = report._times({"lorenz": here})
    assert table.rows[0][-2] == f"{here.pynamicalsys[0]:.4f}"
    assert "times as long as HBVM()" in table.note


def test_maps_tell_regular_from_chaotic_starts():
    (row,) = maps.henon_heiles_section([0.0], [-0.26, 0.13, 0.99], 1 / 8, 500.0)
    assert row[0] > report.figures.CHAOTIC  # measured 7.2
    assert row[1] == pytest.approx(2.0, abs=0.3)  # measured 1.78
    assert np.isnan(row[2])
    (gone,) = maps.sitnikov([0.5], [0.5, 1.3], 10)
    assert gone[0] == pytest.approx(2.0, abs=0.5)
    assert np.isnan(gone[1])


@pytest.mark.slow
def test_a_quick_run_computes_and_draws_everything(tmp_path, monkeypatch):
    few = {name: SYSTEMS[name] for name in ("thomas", "henon_heiles")}
    for where in (report, report.figures):
        monkeypatch.setattr(where, "SYSTEMS", few)
    monkeypatch.setattr(orbits, "PLANETS", {"regular": orbits.PLANETS["regular"]})
    campaign = load(str(REPORTS / "chaos"))
    one = with_fields(campaign.methods[0], use=["Gauss(s=8, h=0.5)"])
    monkeypatch.setattr("hbvm_bench.commands.run.load", lambda name: with_fields(campaign, methods=[one]))
    place = ["--quick", "--jobs", "1", "--out", str(tmp_path), "--report", str(tmp_path)]
    assert main(["run", str(REPORTS / "chaos"), *place]) == 0
    text = (tmp_path / "report.md").read_text(encoding="utf-8")
    assert "Thomas, b = 0.18: the largest exponent" in text
    assert "| regular: a = 7, e = 0.05 | REBOUND, WHFast |" in text
    drawn = (tmp_path / "index.html").read_text(encoding="utf-8")
    for key in ("values", "megno", "sitnikov", "sections", "asteroids"):
        assert f'id="chaos-{key}' in drawn
        assert f"(figures/chaos-{key}.svg)" in text


def test_a_quick_run_of_a_campaign_without_times_takes_none():
    assert quick_run(load(str(REPORTS / "chaos"))).timing.rounds == 0
    assert quick_run(load("sitnikov")).timing.rounds > 0
