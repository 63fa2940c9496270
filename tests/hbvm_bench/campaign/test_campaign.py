import msgspec
import numpy as np
import pytest

import problems
from hbvm_bench.campaign import file as campaign
from hbvm_bench.campaign import own
from hbvm_bench.campaign.file import Case, Grid, Limits
from hbvm_bench.campaign.identity import is_ours, resolve
from hbvm_bench.campaign.spec import parse_spec
from hbvm_bench.run import loop
from problems.errors import InputError
from tests.hbvm_bench.made_up_run import record

METHOD = '\n[[methods]]\nuse = "Gauss(s=2, h=0.5)"\n'
GOOD = 'name = "x"\nproblems = ["sitnikov()"]\n'


def test_every_shipped_campaign_resolves():
    for name in campaign.shipped():
        opened, known = own.opened(campaign.load(name), campaign.file_of(name).parent, print)
        cases = loop.plan(opened, known)
        assert len({case.id for case in cases}) == len(cases) > 0


def test_the_sitnikov_campaign_has_every_family():
    names = {parse_spec(entry.use).name for entry in campaign.load("sitnikov").methods}
    assert names == {
        *("HBVM", "Gauss", "Taylor", "IAS15", "WHFast", "Leapfrog"),
        *("SemiImplicitEuler", "LeapfrogMidpoint", "ReversibleHeun", "Dopri8", "DOP853", "Radau"),
    }


def test_every_step_of_the_sitnikov_campaign_divides_its_grid():
    loaded = campaign.load("sitnikov")
    for entry in loaded.methods:
        h = parse_spec(entry.use).arguments.get("h")
        if h is not None:
            steps = loaded.grid.step / h
            assert steps == pytest.approx(round(steps), abs=1e-12)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (GOOD.replace("name", "nme") + METHOD, "did you mean 'name'"),
        (GOOD + METHOD.replace("use", "uze"), "did you mean 'use'"),
        (GOOD + METHOD + 'settings = "recomended"\n', "did you mean 'recommended'"),
        (GOOD + "grid = {stepp = 1}" + METHOD, "did you mean 'step'"),
    ],
)
def test_a_wrong_campaign_is_one_sentence(text, message):
    with pytest.raises(InputError, match=message) as caught:
        campaign.parse(text, "x.toml")
    assert str(caught.value).startswith("x.toml: ")


@pytest.mark.parametrize("name", ["sitnikof", "nowhere.toml"])
def test_an_unknown_campaign_is_named(name):
    with pytest.raises(InputError, match=name):
        campaign.load(name)


def test_a_case_given_twice_is_refused():
    with pytest.raises(InputError, match="twice"):
        loop.plan(campaign.parse(GOOD + METHOD + METHOD.replace("h=0.5", "h = 0.50")))


def test_the_grid_ends_at_the_end_and_hits_its_points_exactly():
    problem = problems.load("sitnikov")
    times = Grid(step=0.5).times(problem)
    assert times.tolist() == [0.5 * n for n in range(3001)]
    assert Grid(step=0.7).times(problem)[-1] == 1500.0
    assert Grid(count=4).times(problem).tolist() == [0.0, 375.0, 750.0, 1125.0, 1500.0]
    assert len(Grid().times(problem)) == 1001


def test_a_grid_runs_backwards_with_its_problem():
    times = Grid(step=0.25).times(problems.load("sitnikov", t_end=-1.0))
    assert times.tolist() == [0.0, -0.25, -0.5, -0.75, -1.0]


def test_an_absurdly_fine_grid_is_refused():
    with pytest.raises(InputError, match="larger"):
        resolve(Case(problem="sitnikov()", method="Gauss(s=2, h=0.5)", grid=Grid(step=1e-6)))


def _id(**changes):
    start = Case(problem="sitnikov(e=0.75)", method="Gauss(s=2, h=0.5)", grid=Grid(step=0.5))
    return resolve(msgspec.structs.replace(start, **changes)).id


def test_an_id_ignores_spelling_and_words():
    assert _id() == _id(problem=" sitnikov ( ) ", method="Gauss(h=.5,s=2)", note="x", settings="default")


def test_an_id_changes_with_everything_that_matters(monkeypatch):
    others = [
        _id(problem="sitnikov(e=0.6)"),
        _id(problem="sitnikov(t_end=1000.0)"),
        _id(method="Gauss(s=3, h=0.5)"),
        _id(method="HBVM(k=2, s=2, h=0.5)"),
        _id(grid=Grid(step=0.25)),
    ]
    monkeypatch.setattr("hbvm_bench.campaign.identity.version_of", lambda name: "0.0")
    others.append(_id())
    monkeypatch.undo()
    monkeypatch.setattr("hbvm_bench.campaign.identity.source_digest", lambda method, case: "edited")
    others.append(_id())
    monkeypatch.undo()
    assert len({_id(), *others}) == 8


def test_ours_are_ours():
    roles = {e.use: is_ours(resolve(Case(problem="sitnikov", method=e.use)).method)
             for e in campaign.load("sitnikov").methods}  # fmt: skip
    assert {parse_spec(use).name for use, ours in roles.items() if ours} == {"HBVM", "Gauss"}


def test_a_case_that_hit_a_limit_runs_again_under_a_larger_one():
    old = Limits(wall_seconds=10, memory_gib=1)
    same, larger = Limits(wall_seconds=10, memory_gib=1), Limits(wall_seconds=20, memory_gib=2)
    assert not loop.is_done(None, same)
    for outcome in ("ok", "stalled", "crashed", "refused"):
        assert loop.is_done(record(outcome=outcome, limits=old), larger)
    for outcome in ("timeout", "killed"):
        assert loop.is_done(record(outcome=outcome, limits=old), same)
        assert not loop.is_done(record(outcome=outcome, limits=old), larger)


def test_times_are_doubles():
    assert Grid(count=3).times(problems.load("sitnikov")).dtype == np.float64


def test_a_method_may_be_a_list_of_settings_of_which_a_quick_run_takes_some():
    text = 'use = ["Gauss(s=2, h={h})", "Gauss(s=3, h={h})"]\nsweep = { h = [0.5, 0.25] }\nquick = [1, 2]\n'
    whole = campaign.parse(GOOD + "[[methods]]\n" + text)
    settings = ["Gauss(s=2, h=0.5)", "Gauss(s=2, h=0.25)", "Gauss(s=3, h=0.5)", "Gauss(s=3, h=0.25)"]
    assert [case.method for case in whole.cases()] == settings
    quick = msgspec.structs.replace(whole, quick=True)
    assert [case.method for case in quick.cases()] == settings[1:3]


def test_a_problem_is_called_by_its_name_in_the_campaign():
    text = 'name = "x"\n[[problems]]\nuse = "fput(n=8)"\nname = "short"\n[[problems]]\nuse = "fput(n=16)"\n'
    made = campaign.parse(text + METHOD + 'only = ["short"]\n')
    assert [case.problem for case in made.cases()] == ["fput(n=8)"]
    with pytest.raises(InputError, match="must be a file name"):
        campaign.parse(text.replace("short", "../short") + METHOD)
