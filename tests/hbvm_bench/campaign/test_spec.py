import ast
import contextlib
import keyword

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hbvm_bench.campaign.spec import LONGEST, Spec, parse_spec
from problems.errors import InputError

NAMES = st.from_regex(r"[A-Za-z_][A-Za-z0-9_]{0,12}", fullmatch=True).filter(
    lambda name: not keyword.iskeyword(name)
)
SCALARS = (
    st.none()
    | st.booleans()
    | st.integers(-(2**60), 2**60)
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(st.characters(blacklist_categories=["Cs", "Cc", "Zs", "Zl", "Zp"]), max_size=10)
)
VALUES = st.recursive(SCALARS, lambda inner: st.lists(inner, max_size=3).map(tuple), max_leaves=6)
SPECS = st.builds(Spec, NAMES, st.dictionaries(NAMES, VALUES, max_size=4))


@given(SPECS)
def test_a_specification_reads_back_as_it_prints(spec):
    assert parse_spec(str(spec)) == spec


@given(st.text(max_size=60))
def test_any_text_is_a_specification_or_an_input_error(text):
    with contextlib.suppress(InputError):
        spec = parse_spec(text)
        assert parse_spec(str(spec)) == spec


@given(
    st.lists(
        st.sampled_from(
            ["f", "(", ")", "h", "=", "1", ",", "-", "[", "]", "'", "__import__", ".", "*", "e", " "]
        ),
        max_size=20,
    )
)
def test_what_looks_like_a_call_is_parsed_or_refused(pieces):
    with contextlib.suppress(InputError):
        parse_spec("".join(pieces))


def test_a_bare_name_is_a_call_without_arguments():
    assert parse_spec("IAS15") == parse_spec(" IAS15() ") == Spec("IAS15")


def test_lists_and_signs_are_values():
    assert parse_spec("W(h=-0.5, order=[0, 2, 1])").arguments == {"h": -0.5, "order": (0, 2, 1)}


@pytest.mark.parametrize(
    ("text", "column"),
    [
        ("f(1)", 3),
        ("f(h=1) + 2", 1),
        ("f(h=g())", 5),
        ("f(h=__import__('os'))", 5),
        ("f(h=a.b)", 5),
        ("f(h=[1 for x in y])", 5),
        ("f(h=1, h=2)", 8),
        ("f(**k)", 5),
        ("a.b(h=1)", 1),
        ("  é(h=x)", 7),
        ("f(h=2**1000)", 5),
        ("f(h=1e999)", 5),
        ("f(h=-1e999)", 5),
        (f"f(h={'9' * 400})", 5),
        ("f(h=-True)", 5),
        ("f(h=1j)", 5),
        ("f(h=b'x')", 5),
        ("f(h=lambda: 0)", 5),
        ("f(h=(y := 1))", 6),
        ("f(h=f'{1}')", 5),
        ("f(h=" + "[" * 10 + "]" * 10 + ")", 13),
    ],
)
def test_anything_but_literals_is_refused_with_its_column(text, column):
    with pytest.raises(InputError, match=rf"column {column}\)"):
        parse_spec(text)


@pytest.mark.parametrize(
    "text", ["", "   ", "\n", "f(" + "h" * LONGEST + "=1)", "(" * 3000, "f(h=" + "-" * 3000 + "1)"]
)
def test_empty_long_and_deep_texts_are_refused(text):
    with pytest.raises(InputError):
        parse_spec(text)


def test_nothing_is_evaluated(monkeypatch):
    def forbidden(*args, **kwargs):
        raise AssertionError("evaluated")

    monkeypatch.setattr("builtins.eval", forbidden)
    monkeypatch.setattr("builtins.exec", forbidden)
    monkeypatch.setattr(ast, "literal_eval", forbidden)
    assert parse_spec("f(h=(1, 'x', None))").arguments == {"h": (1, "x", None)}
