"""The campaign ``encounters``: what its problems are, and what its tables say."""

import numpy as np
from msgspec.structs import replace

import problems
from hbvm_bench.campaign import file as campaigns
from hbvm_bench.campaign.file import Case
from hbvm_bench.campaign.identity import make_problem
from hbvm_bench.campaign.shorter import chosen
from hbvm_bench.campaign.sweep import fill
from hbvm_bench.reference import solutions
from hbvm_bench.summaries import accuracies, compilations
from integrators import HBVM, integrate
from tests.hbvm_bench.made_up_run import record

CAMPAIGN = campaigns.load("encounters")


def test_every_reference_comes_with_the_package_and_says_its_condition():
    for entry in CAMPAIGN.entries():
        problem = make_problem(fill(entry.use, entry.values))
        known = solutions.find(problem)
        assert known is not None, entry.use
        if entry.name != "pythagorean70":  # whose positions doubles do not determine
            assert 1e3 < known.condition_at(problem.t_end) < 1e10, entry.use


def test_every_family_has_as_many_settings_but_those_outside_their_domain():
    for entry in CAMPAIGN.entries():
        only = chosen(CAMPAIGN, [campaigns.name_of(entry)])
        inside = [case for case in only.cases() if case.settings != "outside its domain"]
        ours = ("HBVM", "Gauss")
        counts = {}
        for case in inside:
            name = case.method.partition("(")[0]
            counts["ours" if name in ours else name] = counts.get("ours" if name in ours else name, 0) + 1
        assert set(counts.values()) == {6}, counts


def test_the_planets_meet_when_the_catalogue_says():
    problem = problems.load("scattering")
    found = integrate(problem, HBVM(), np.linspace(0.0, 60.0, 60_001))
    q = found.y[:, 3:12].reshape(-1, 3, 3)
    apart = np.min([np.linalg.norm(q[:, i] - q[:, j], axis=1) for i, j in ((0, 1), (0, 2), (1, 2))], axis=0)
    lowest = (
        np.flatnonzero((apart[1:-1] < apart[:-2]) & (apart[1:-1] < apart[2:]) & (apart[1:-1] < 0.012)) + 1
    )
    assert np.round(found.t[lowest], 1).tolist() == [17.5, 17.8, 46.7, 55.4]
    assert np.allclose(apart[lowest], [0.0117, 0.0089, 0.0032, 0.0062], atol=2e-4)


def test_the_table_of_accuracies_compares_the_fastest_settings_that_are_accurate_enough():
    campaign = chosen(CAMPAIGN, ["kepler99"])
    (entry,) = campaign.entries()
    case = Case(problem=repr(make_problem(entry.use)), method="", grid=campaign.grid)

    def measured(method, seconds, error):
        return record(
            replace(case, method=method),
            times=[seconds] * 4,
            metrics={"position_end": error, "energy_max": 1e-15},
        )

    records = [
        measured("HBVM()", 0.4, 1e-10),
        measured("HBVM(tol=1e-06)", 0.1, 1e-5),
        measured("Taylor()", 0.8, 1e-13),
        measured("Taylor(tol=1e-06)", 0.05, 1e-4),
        measured("IAS15()", 4.0, 1e-10),
    ]
    table = accuracies.table(campaign, records)
    title = entry.title
    assert table.head[2:] == ("HBVM and Gauss", "Taylor", "IAS15")
    rows = [tuple(cell.partition(" (")[0] for cell in row) for row in table.rows]
    assert rows == [
        (title, "0.001", "100 ms", "0.50×", "40.0×"),  # a loose Taylor series is faster
        (title, "1e-06", "400 ms", "2.00×", "10.0×"),
        (title, "1e-09", "400 ms", "2.00×", "10.0×"),
        (title, "1e-12", "–", "800 ms", "–"),  # reached by one library alone
    ]
    assert accuracies.table(campaign, []) is None


def test_the_best_compilation_stands_beside_the_median_for_all_libraries_alike():
    campaign = chosen(CAMPAIGN, ["kepler99"])
    (entry,) = campaign.entries()
    case = Case(problem=repr(make_problem(entry.use)), method="", grid=campaign.grid)

    def measured(method, times, position=1e-12):
        errors = {"position_end": position, "energy_max": 0.0}
        made = record(replace(case, method=method), times=times, metrics=errors)
        rounds = [replace(one, compilation=place) for place, one in enumerate(made.timing.rounds)]
        return replace(made, timing=replace(made.timing, rounds=rounds))

    records = [measured("HBVM()", [0.4, 0.2, 0.5]), measured("Taylor()", [0.6, 0.9, 0.6])]
    table = compilations.table(campaign, records)
    assert [row[1:] for row in table.rows] == [
        ("HBVM and Gauss", "HBVM()", "3", "400 ms", "200 ms", "2.50", "1×"),
        ("Taylor", "Taylor()", "3", "600 ms", "600 ms", "1.50", "3×"),
    ]
    once = record(
        replace(case, method="HBVM()"), times=[0.4], metrics={"position_end": 1e-12, "energy_max": 0.0}
    )
    assert compilations.table(campaign, [once]) is None
    anything = replace(campaign, problems=[replace(entry, within={})])  # asks for no accuracy
    records += [measured("Taylor(tol=0.1)", [0.1, 0.1, 0.1], position=0.5)]
    assert [row[2] for row in compilations.table(anything, records).rows] == ["HBVM()", "Taylor()"]
