"""The code under reports/: what it may import, and that it plans and draws what it says."""

import ast
from graphlib import TopologicalSorter

import pytest

from hbvm_bench.campaign.file import STUDY, load
from hbvm_bench.report.page import page_in
from hbvm_bench.run import computing
from tests.hbvm_bench import study_folders

FOLDERS = sorted(path.parent for path in study_folders.REPORTS.glob(f"*/{STUDY}"))
ABOVE = ("hbvm_bench.cli", "hbvm_bench.commands", "hbvm_bench.run.loop", "hbvm_bench.run.task")


def imports(path):
    """Return the modules that a file imports: whole names, and names of files beside it."""
    far, near = set(), set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            far |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level:
            near |= {node.module} if node.module else {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            far |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    return far, near


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda folder: folder.name)
def test_a_study_stands_below_the_command_line_and_its_files_make_no_circle(folder):
    found = {path.stem: imports(path) for path in folder.glob("*.py")}
    assert found
    for name, (far, near) in found.items():
        assert not [module for module in far if module.startswith((*ABOVE, "tests", "reports"))], name
        assert near <= found.keys(), name
    list(TopologicalSorter({name: near for name, (_, near) in found.items()}).static_order())
    for name in found:
        assert study_folders.module(folder.name, name)


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda folder: folder.name)
def test_a_study_plans_its_computations_and_draws_its_page_from_what_is_stored(folder):
    planned = computing.plan(load(str(folder)), folder)
    assert len({request.id for request in planned}) == len(planned) > 0
    drawn = page_in(folder)
    assert drawn.failed == []
    assert drawn.title
