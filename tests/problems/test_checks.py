"""Values are checked by their annotations: what is kept, what is refused, and what is said."""

from collections.abc import Sequence
from typing import Annotated, Any, Literal

import numpy as np
import pytest

from problems.checks import Must, Positive, at_least, checked
from problems.errors import InputError, UnknownNameError

NAN, INF = float("nan"), float("inf")
SHARE = Annotated[float, Must("a share, 0 <= x < 1", lambda x: 0 <= x < 1)]
PAIR = Annotated[Sequence[float], Must("a list of 2 finite numbers", lambda found: len(found) == 2)]


@pytest.mark.parametrize(
    ("annotation", "given", "kept"),
    [
        (float, 1, 1.0),
        (float, np.float32(0.5), 0.5),
        (float, np.array(0.5), 0.5),
        (Positive, 3, 3.0),
        (SHARE, 0, 0.0),
        (int, np.int64(-3), -3),
        (Annotated[int, at_least(2)], 2, 2),
        (bool, np.bool_(True), True),
        (bool, 0, False),
        (str, "a", "a"),
        (Literal["a", "b"], "b", "b"),
        (Literal[2, 4], np.int32(4), 4),
        (PAIR, [1, 2.5], (1.0, 2.5)),
        (Positive | None, None, None),
        (Positive | None, 2, 2.0),
        (Any, "anything", "anything"),
        (list[int], (1, 2), (1, 2)),
        (float | str, "what it likes", "what it likes"),
    ],
)
def test_what_is_right_is_kept_in_the_form_in_which_it_is_compared(annotation, given, kept):
    found = checked("f", "x", given, annotation)
    assert found == kept
    assert type(found) is type(kept)


@pytest.mark.parametrize(
    ("annotation", "given", "says"),
    [
        (float, "1", "x='1' of f must be a finite number."),
        (float, True, "x=True of f must be a finite number."),
        (float, NAN, "x=nan of f must be a finite number."),
        (float, 10**400, "x=about 1e400 of f must be a finite number."),
        (float, np.ones(1), "must be a finite number."),
        (float, 1j, "is complex, and must be real; a complex state"),
        (float, None, "x=None of f must be a finite number."),
        (Positive, 0, "x=0 of f must be a positive number."),
        (Positive, INF, "x=inf of f must be a positive number."),
        (SHARE, 1.0, "x=1.0 of f must be a share, 0 <= x < 1."),
        (SHARE, "a", "x='a' of f must be a share, 0 <= x < 1."),
        (int, 2.0, "x=2.0 of f must be a whole number."),
        (Annotated[int, at_least(2)], 1, "x=1 of f must be a whole number of at least 2."),
        (Annotated[int, at_least(0)], True, "must be a whole number of at least 0."),
        (bool, "yes", "x='yes' of f must be True or False."),
        (bool, 2, "must be True or False."),
        (str, 3, "x=3 of f must be text."),
        (Literal[2, 4], 3, "x=3 of f must be one of 2, 4."),
        (Literal[0, 1], False, "x=False of f must be one of 0, 1."),
        (PAIR, [1], "x=[1] of f must be a list of 2 finite numbers."),
        (PAIR, [1, NAN], "must be a list of 2 finite numbers."),
    ],
)
def test_what_is_wrong_is_refused_by_name_and_value(annotation, given, says):
    with pytest.raises(InputError) as refused:
        checked("f", "x", given, annotation)
    assert says in str(refused.value)


def test_the_nearest_choice_is_named():
    with pytest.raises(UnknownNameError, match="unknown x of f 'jakobi'; did you mean 'jacobi'"):
        checked("f", "x", "jakobi", Literal["jacobi", "whds"])
