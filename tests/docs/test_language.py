"""Phrases of the project's former dialect do not come back: the documentation uses the field's terms."""

import re

import pytest

from tests.docs import pages

RETIRED = {
    "own steps": "steps of the method, or adaptive step size",
    "steps of one length": "fixed step size",
    "steps that vary": "adaptive step size",
    "steps of varying length": "adaptive step size",
    "throw-away step": "partial step that is discarded",
    "seed paper": "the original paper",
    "home ground": "intended regime",
    "evaluations are dear": "expensive right-hand side",
    "no thinking": "default",
    "true motion": "reference solution",
    "sham rotation": "spurious precession",
    "way back to the start": "time-reversal error",
    "law of the drift": "error growth",
    "keeps the energy": "conserves the energy",
    "keep the energy": "conserve the energy",
    "energy is kept": "the energy is conserved",
    "does not care": "does not conserve",
    "damp nothing": "are not L-stable",
    "seen by nobody": "missed by every method",
    "lanes of the vector unit": "SIMD lanes",
    "with the same bits": "bitwise identical",
    "span of time": "integration interval",
    "our methods": "HBVM and Gauss",
}

WRITTEN = [
    path
    for path in pages.sources()
    if path.name not in ("problems.md", "engines.md", "compile_times.md", "kernel.md", "CONTRIBUTING.md")
]  # those are made from the code, or written about it for its developers


@pytest.mark.parametrize("page", WRITTEN, ids=lambda page: str(page.relative_to(pages.ROOT)))
def test_a_page_uses_the_terms_of_the_field(page):
    text = " ".join(re.sub(r"`[^`\n]*`", "", page.read_text(encoding="utf-8")).lower().split())
    assert {phrase: term for phrase, term in RETIRED.items() if re.search(rf"\b{phrase}\b", text)} == {}
