"""What an analysis of a system gives, and which engine accepts which problem."""

import json

import pytest

import problems
from hbvm_bench import cli
from hbvm_bench.summaries import findings
from problems import Hamiltonian
from problems.analysis import structure
from problems.errors import InputError
from problems.targets.latex import latex

QUINTIC = "p^2*(1/2 + p^2) + p^2*(1 + p^2)*q + (1/2 + p + p^2)*q^2"


def test_the_papers_quintic_has_degree_5_and_its_k():
    for text in (QUINTIC, "period_annulus"):
        found = findings.inspect(text)
        assert found.degree == 5
        assert found.exact[1:] == ((2, 5), (3, 8), (4, 10), (5, 13))
        assert not found.separable


def test_sitnikovs_problem_is_not_polynomial():
    found = findings.inspect("sitnikov")
    assert found.degree is None
    assert found.exact == ()
    assert dict(findings.lines(found))["polynomial"].startswith("not polynomial")


@pytest.mark.parametrize(
    ("text", "degree"),
    [
        ("p^2/2", 2),
        ("p + q", 1),
        ("p^2/2 + k*q^4", 4),
        ("(p^2 + q^2)^3", 6),
        ("p^2/2 + q^2/k", 2),
        ("p^2/(1 + q^2)", None),
        ("p^2/2 - cos(q)", None),
        ("p^2/2 + sqrt(k)*q", 2),
        ("p^2/2 + abs(q)", None),
        ("p^2/2 + q^0.5", None),
        ("sin(t)*q + p^2", 2),
    ],
)
def test_the_degree_is_that_of_the_expression(text, degree):
    assert findings.inspect(text, "k=3" if "k" in text else "").degree == degree


def test_a_product_with_a_parameter_that_is_zero_drops_out():
    system = problems.load("fput").system
    assert structure.degree(system) == 4
    assert structure.degree(system, system.pack({"beta": 0.0})) == 3
    assert structure.degree(system, system.pack({"beta": 0.0, "alpha": 0.0})) == 2


def test_cyclic_coordinates_are_those_that_do_not_occur():
    found = findings.inspect("(p1^2 + p2^2 + p3^2)/2 + q1^2 + q1*p3")
    assert found.cyclic == ("q2", "q3")
    assert "p2 is constant" in dict(findings.lines(found))["cyclic coordinates"]
    assert structure.cyclic(problems.load("toda", n=40).system) == []

    def H(p, q, m):
        return m.sum(lambda i: p[i] ** 2 / 2, range(5)) + m.sum(lambda i: q[2 * i] ** 2, range(2))

    assert structure.cyclic(Hamiltonian(H, dof=5)) == [1, 3, 4]


def test_what_has_no_energy_or_no_momenta_says_so():
    field = problems.VectorField(lambda y: [-y[0]], dim=1)
    with pytest.raises(InputError, match="has no energy"):
        structure.degree(field)
    with pytest.raises(InputError, match="no positions and momenta"):
        structure.cyclic(problems.load("rigid_body").system)
    assert findings.inspect("rigid_body").kind == "poisson"


@pytest.mark.parametrize(
    ("text", "formula"),
    [
        ("p^2/2 - cos(q)", r"\frac{p^{2}}{2} - \cos\left(q\right)"),
        ("sqrt(q1^2 + q2^2)*p1", r"\sqrt{q_{1}^{2} + q_{2}^{2}} p_{1}"),
        ("k*exp(-q)^2/3 + p", r"\frac{k \left(e^{-q}\right)^{2}}{3} + p"),
        ("(p - q)*(p + q)", r"\left(p - q\right) \left(p + q\right)"),
        ("p - (q - 1)", r"p - \left(q - 1\right)"),
        ("abs(q)^1.5 + log(p)", r"\left|q\right| \sqrt{\left|q\right|} + \ln\left(p\right)"),
        ("1e-5*q + omega_c*p", r"10^{-5} q + \omega_{c} p"),
    ],
)
def test_formulas_are_printed_as_they_are_written(text, formula):
    values = {"k": "k=1", "omega_c": "omega_c=1"}
    parameters = ", ".join(value for name, value in values.items() if name in text)
    assert findings.inspect(text, parameters).formula == formula


def test_declared_sums_are_printed_as_sums():
    text = latex(problems.load("outer_solar_system").system)
    assert text.startswith(
        r"\sum_{i=1}^{6} \frac{p_{3i-2}^{2} + p_{3i-1}^{2} + p_{3i}^{2}}{2 m_{i}} - G \sum_{1 \le i < j"
    )
    assert r"\sum_{i=1,\ j=i+1\,(\mathrm{mod}\,8)}^{8} e^{q_{i} - q_{j}}" in latex(
        problems.load("toda").system
    )


@pytest.mark.parametrize("name", problems.names())
def test_every_energy_prints_with_balanced_braces(name):
    text = latex(problems.load(name).system)
    assert text.count("{") == text.count("}")
    assert text.count("\\left") == text.count("\\right")


def test_every_problem_goes_to_every_library():
    rows = findings.matrix()
    for name, row in rows.items():
        for engine in (*findings.LIBRARIES, "HBVM", "Gauss", "Taylor", "DOP853"):
            assert row[engine] is None, (name, engine)


def test_rebound_takes_bodies_and_what_is_separable_and_says_why_not():
    rows = findings.matrix(["sitnikov", "henon_heiles", "cr3bp", "rigid_body", "sine_gordon"])
    assert rows["sitnikov"][findings.BODIES] is None
    assert rows["sitnikov"]["WHFast"] is None
    assert "bodies" in rows["henon_heiles"][findings.BODIES]
    assert rows["henon_heiles"][findings.FORCES] is None
    assert rows["henon_heiles"]["IAS15"] is None
    assert "separable" in rows["cr3bp"][findings.FORCES]
    assert "separable" in rows["cr3bp"]["IAS15"]
    assert "no positions and momenta" in rows["rigid_body"][findings.FORCES]


def test_the_command_inspects_formulas_and_problems(capsys):
    assert cli.main(["inspect", QUINTIC]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    assert "degree 5" in shown
    assert "k = 5 for s = 2, k = 8 for s = 3, k = 10 for s = 4, k = 13 for s = 5" in shown
    assert cli.main(["inspect", "p^2/2 + k*q^2", "--par", "k=2", "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["parameters"] == {"k": 2.0}
    assert answer["separable"] is True
    assert cli.main(["inspect", "kepler(e=0.9)"]) == 0
    assert "lenz" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["inspect", "q.real"], "`q.real` is not allowed"),
        (["inspect", "kepler(e=2)"], "e=2 of kepler must be an eccentricity"),
        (["inspect", "kepler", "--par", "k=2"], "parameters belong to formulas"),
        (["inspect", "p^2/2 + k*q"], "contains 'k', which has no value"),
        (["inspect", "kepler(0.5)"], "arguments are given by name"),
        (["engines", "keplr"], "did you mean 'kepler'"),
    ],
)
def test_the_commands_name_what_is_wrong_in_one_line(arguments, message, capsys):
    assert cli.main(arguments) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1


def test_the_matrix_is_printed_as_a_table_and_as_markdown(capsys):
    assert cli.main(["engines", "kepler", "cr3bp", "--markdown"]) == 0
    text = capsys.readouterr().out
    assert text.splitlines()[0].startswith("| problem | numpy | numba | jax | heyoka |")
    assert "| kepler | ✓ | ✓ | ✓ | ✓ | 1 | ✓ |" in text
    assert "\n1. it is not a system of bodies" in text
    assert cli.main(["engines", "kepler"]) == 0
    assert "1. it is not a system of bodies" in capsys.readouterr().out
