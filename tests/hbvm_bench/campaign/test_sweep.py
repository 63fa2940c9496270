import pytest
from hypothesis import given
from hypothesis import strategies as st

from hbvm_bench.campaign import file
from hbvm_bench.campaign.identity import resolve
from hbvm_bench.campaign.sweep import combinations, fill, names
from problems.errors import InputError

HEAD = 'name = "x"\n'


def parsed(text):
    return file.parse(HEAD + text, "x.toml")


def test_a_sweep_is_every_combination_in_the_order_of_the_file():
    made = list(combinations({"k": [8, 16], "f": [1.0, 0.5]}))
    assert made == [{"k": 8, "f": 1.0}, {"k": 8, "f": 0.5}, {"k": 16, "f": 1.0}, {"k": 16, "f": 0.5}]
    assert list(combinations({})) == [{}]


def test_a_placeholder_is_a_value_or_a_product():
    text = "HBVM(k={k}, s={s}, h={step * f*0.5})"
    assert names(text) == {"k", "s", "step", "f"}
    filled = fill(text, {"k": 8, "s": 4, "step": 0.1, "f": 3})
    assert filled == "HBVM(k=8, s=4, h=0.15)"  # not 0.15000000000000002
    assert fill("WHFast(kernel={kind})", {"kind": "lazy"}) == "WHFast(kernel='lazy')"
    assert fill("L(invariants={keep})", {"keep": ["energy"]}) == "L(invariants=('energy',))"


@given(st.floats(1e-6, 1e6), st.integers(1, 40))
def test_a_product_is_near_the_product(step, factor):
    assert float(fill("{step*f}", {"step": step, "f": factor})) == pytest.approx(step * factor, rel=1e-11)


@pytest.mark.parametrize(
    ("text", "values", "message"),
    [
        ("h={stp}", {"step": 1.0}, "did you mean 'step'"),
        ("h={step*half}", {"step": 1.0}, "half"),
        ("h={step/2}", {"step": 1.0}, "neither a name nor a number"),
        ("h={step*kind}", {"step": 1.0, "kind": "lazy"}, "multiplies 'lazy'"),
    ],
)
def test_a_wrong_placeholder_is_one_sentence(text, values, message):
    with pytest.raises(InputError, match=message):
        fill(text, values)


def test_a_campaign_with_sweeps_is_problems_times_settings():
    cases = parsed(
        """
        [[problems]]
        use = "kepler(e={e}, t_end=6.0)"
        sweep = { e = [0.1, 0.3] }
        values = { step = 0.1 }
        [[problems]]
        use = "pendulum()"
        values = { step = 0.2 }
        [[methods]]
        use = "Gauss(s={s}, h={step*f})"
        sweep = { s = [2, 4], f = [1.0, 0.5] }
        [[methods]]
        use = "Taylor()"
        settings = "default"
        only = ["pendulum"]
        """
    ).cases()
    assert len(cases) == 2 * 4 + 4 + 1
    assert cases[3].method == "Gauss(s=4, h=0.05)"
    assert cases[4].problem == "kepler(e=0.3, t_end=6.0)"
    assert [case.method for case in cases if case.settings == "default"] == ["Taylor()"]
    assert cases[-1].problem == "pendulum()"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('problems = ["kepler()"]\n[[methods]]\nuse = "Gauss(s=2, h={h})"', "'h'"),
        (
            'problems = ["kepler()"]\n[[methods]]\nuse = "Gauss(s=2, h=0.1)"\nsweep = { h = [1] }',
            "no placeholder {h}",
        ),
        (
            'problems = ["kepler()"]\n[[methods]]\nuse = "Gauss(s=2, h=0.1)"\nonly = ["keppler"]',
            "did you mean 'kepler'",
        ),
        ('[[problems]]\nuse = "kepler(e={e})"\nsweep = { e = [] }\n[[methods]]\nuse = "Taylor()"', "sweep"),
        ('problems = ["kepler()"]', "no methods"),
        ('[[methods]]\nuse = "Taylor()"', "no problems"),
        ('[[ensembles]]\nproblem = "kepler()"\ncount = 3\nmethods = []', "methods"),
        ('[checks]\nstarts = -1\n[[ensembles]]\nproblem = "k"\ncount = 3\nmethods = [{use = "T"}]', "starts"),
    ],
)
def test_a_wrong_campaign_says_what_is_wrong(text, message):
    with pytest.raises(InputError, match=message):
        parsed(text).cases()


def test_an_unknown_key_of_an_entry_has_a_suggestion():
    with pytest.raises(InputError, match="did you mean 'sweep'"):
        parsed('problems = ["kepler()"]\n[[methods]]\nuse = "Taylor()"\nsweeps = {}')


def test_checks_and_ensembles_belong_to_the_identity_of_a_case():
    plain = file.Case(problem="kepler()", method="Taylor()")
    checked = file.Case(problem="kepler()", method="Taylor()", checks=file.Checks(starts=3))
    many = file.Case(problem="kepler()", method="Taylor()", ensemble=file.Ensemble(count=3))
    assert len({resolve(case).id for case in (plain, checked, many)}) == 3
    assert (
        resolve(plain).id
        == resolve(file.Case(problem="kepler()", method="Taylor()", checks=file.Checks())).id
    )
