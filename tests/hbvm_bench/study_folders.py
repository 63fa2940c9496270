"""The code of studies in reports/, as the bench loads it."""

from pathlib import Path
from types import ModuleType

from hbvm_bench.campaign import folder

REPORTS = Path(__file__).parents[2] / "reports"


def module(study: str, name: str) -> ModuleType:
    """Return a module of a study."""
    return folder.module(REPORTS / study, name)
