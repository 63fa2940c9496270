"""Questions that a new user has, and the page that answers each: at most two clicks from the first page."""

import pytest

from tests.docs import pages

FIRST = pages.DOCS / "index.md"

ANSWERS = {
    "How do I install it, without a compiler and without make?": ("start", ["pip install .", "no compiler"]),
    "How do I integrate a Hamiltonian of my own?": (
        "tutorials/own_hamiltonian",
        ["def H(q, p, par, m)", "problems.Hamiltonian(", "integrators.integrate("],
    ),
    "Which method and which step do I take?": (
        "howto/which_method",
        ["integrators.advise(", "| your system | take |"],
    ),
    "How do I run ten thousand trajectories, or values of a parameter?": (
        "tutorials/ensemble",
        ["integrate_many(", "parameters={", "threads="],
    ),
    "How do I make a Poincaré section, or stop at an event?": (
        "tutorials/sections",
        ["integrators.section(", "terminal=", "direction="],
    ),
    "My run takes a day: how do I see how far it is, and go on after a break?": (
        "tutorials/long_run",
        ["progress=True", "checkpoint=", "resume="],
    ),
    "Can I use it in my program, which is written with SciPy, diffrax or REBOUND?": (
        "tutorials/hosts",
        ["method=method", "diffeqsolve(", "install(sim"],
    ),
    "How do I compare integrators on a problem, and get a report?": (
        "tutorials/own_campaign",
        ["[[problems]]", "[[methods]]", "hbvm-bench run", "--report"],
    ),
    "What do the columns and brackets of a report mean?": (
        "howto/reading_a_report",
        ["Round brackets", "relative to the largest distance", "median and quartiles"],
    ),
    "How do I integrate a satellite with J2 and drag?": (
        "howto/satellite",
        ["par.J2", "VectorField(", "relative[0]", "terminal=True"],
    ),
    "Does it use my 64 cores?": ("howto/clusters", ["threads=64", "--jobs 64"]),
    "What is the licence?": ("faq", ["### What is the licence?", "3-clause BSD"]),
    "How do I treat a chaotic system?": ("faq", ["### How do I treat a chaotic system?", "advise"]),
    "How do I use a force of my own?": ("tutorials/driven", ["## Any first-order system", "VectorField"]),
    "How do I restart after a crash?": ("faq", ["continue it after a crash?", "`checkpoint=` and `resume=`"]),
    "Does it run on a GPU?": ("faq", ["### Does it run on a GPU?", 'backend="jax"']),
    "How do I choose s?": ("howto/which_method", ["### s", "The order is 2s."]),
    "How do I cite it?": ("faq", ["### How do I cite it?", "CITATION.cff", "hbvm-bench cite"]),
    "Does it run on Windows?": ("faq", ["### Which systems and Pythons does it run on?", "Windows"]),
    "When should I not use it, and why is the first call slow?": (
        "faq",
        ["When should I not use it?", "Why is my first call slow?", "hbvm-bench warm"],
    ),
}


@pytest.fixture(scope="module")
def distance():
    """How many clicks each page is away from the first one."""
    found, here = {FIRST: 0}, [FIRST]
    while here:
        following = {page for one in here for page in pages.clicks(one)} - set(found)
        found |= dict.fromkeys(following, found[here[0]] + 1)
        here = sorted(following)
    return found


@pytest.mark.parametrize("question", ANSWERS)
def test_a_question_is_answered_two_clicks_away(question, distance):
    name, words = ANSWERS[question]
    page = pages.DOCS / f"{name}.md"
    assert distance[page] <= 2
    text = " ".join(page.read_text(encoding="utf-8").split())
    assert [word for word in words if word not in text] == []


def test_every_page_is_reached(distance):
    hidden = [page for page in pages.sources() if pages.DOCS in page.parents and page not in distance]
    assert hidden == []
