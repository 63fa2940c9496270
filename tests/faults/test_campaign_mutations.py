"""Every key, name and number of the shipped campaign files, spoilt one at a time, is found before a run."""

import copy
import re
import tomllib

import pytest

from hbvm_bench.campaign import file, own
from hbvm_bench.run import checked, computing, loop
from problems.errors import InputError

WORDS = {"title", "description", "note", "words", "alone", "name", "lead", "series"}
"""Texts for readers, the name of a thing itself, and series: a report keeps those that are there."""

FREE = {"values", "sweep"}
"""Tables whose keys are the file's own names."""

QUICK = ("smoke", "endure", "ensemble")
SLOW = (
    "automatic",
    "constraints",
    "outer-solar-system",
    "sitnikov",
    "work-precision",
    "general",
    "drift",
    "race",
    "peers",
    "paper",
    "encounters",
    "large",
    "planets",
)
FOLDERS = ("chaos", "random", "costs")
"""Studies of ours that are folders with code."""


def leaves(data, path=()):
    """Yield the path of every value that is no table or list of others, and of every table's key."""
    if isinstance(data, dict):
        for key, value in data.items():
            yield (*path, key), "key"
            yield from leaves(value, (*path, key))
    elif isinstance(data, list):
        for place, value in enumerate(data):
            yield from leaves(value, (*path, place))
    else:
        yield path, "value"


def misspelt(text):
    """Return a text whose first word has a letter twice; a name of one letter has another one after it."""
    word = re.search(r"[A-Za-z_][\w-]*", text)
    return text[: word.end()] + "qq" + text[word.end() :] if word else text + "qq"


def spoilt(data, path, replace):
    made = copy.deepcopy(data)
    at = made
    for key in path[:-1]:
        at = at[key]
    replace(at, path[-1])
    return made


def rename(table, key):
    # at the same place: tables of a sweep are in order
    items = [(misspelt(name) if name == key else name, value) for name, value in table.items()]
    table.clear()
    table.update(items)


def mutations(data):
    """Yield what is spoilt, and the campaign with it; one of each kind of place and value."""
    seen = set()
    for path, kind in leaves(data):
        named = [key for key in path if isinstance(key, str)]
        if kind == "key":
            if not (
                len(named) > 1 and named[-2] == "values"
            ):  # used by whoever has the problem, or by nobody
                yield f"{path}", spoilt(data, path, rename)
            continue
        at = data
        for key in path:
            at = at[key]
        place = (tuple(named), str(at))
        if place in seen or FREE & {*named} or (named[-1] in WORDS):
            continue
        seen.add(place)
        if isinstance(at, str):
            changed = [misspelt(at)]
        elif isinstance(at, bool):
            changed = ["yes"]
        else:
            changed = [float("nan"), "1"] + [-1] * (named[-1] != "end")
        for value in changed:
            yield f"{path}: {value!r}", spoilt(data, path, lambda t, k, value=value: t.__setitem__(k, value))


def accepted(data, folder):
    """Whether a campaign would run, be it with what was spoilt."""
    try:
        file._check_keys(data, file.Campaign, "spoilt")
        made = file.msgspec.convert(data, file.Campaign)
        made, known = own.opened(made, folder, lambda name: None)
        checked.check(made, loop.plan(made, known))
        computing.plan(made, folder)
    except (InputError, file.msgspec.ValidationError):
        return False
    return True


@pytest.mark.parametrize(
    "name", [*QUICK, *(pytest.param(name, marks=pytest.mark.slow) for name in (*SLOW, *FOLDERS))]
)
def test_what_is_spoilt_in_a_shipped_campaign_is_found(name):
    path = file.file_of(f"reports/{name}" if name in FOLDERS else name)
    data = tomllib.loads(path.read_text())
    assert accepted(data, path.parent)
    all_ = dict(mutations(data))
    assert len(all_) > 20
    assert [what for what, spoilt_ in all_.items() if accepted(spoilt_, path.parent)] == []


def test_every_shipped_campaign_is_spoilt():
    assert {*QUICK, *SLOW} == {*file.shipped()}
