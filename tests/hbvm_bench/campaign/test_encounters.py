"""The campaign ``encounters``: what its problems are."""

import numpy as np

import problems
from hbvm_bench.campaign import file as campaigns
from hbvm_bench.campaign.identity import make_problem
from hbvm_bench.campaign.shorter import chosen
from hbvm_bench.campaign.sweep import fill
from hbvm_bench.reference import solutions
from integrators import HBVM, integrate

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
