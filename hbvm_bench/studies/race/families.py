"""Who takes part in the race, in the words of its pages: families, with a row for either kind of step."""

from typing import NamedTuple

from hbvm_bench.campaign.file import Case
from hbvm_bench.campaign.identity import fixed_step, is_ours, make_method
from hbvm_bench.summaries.points import PROJECTION, family_named

OURS = ""
FIXED, OWN = "fixed step size", "adaptive step size"


class Family(NamedTuple):
    """What runs under one name in the race: its title, also short, and what its machine code is."""

    title: str
    short: str
    code: str


WHEEL = "from the wheel, for any x86-64"
WHEEL_AND_FORCES = f"{WHEEL}; forces other than gravity compiled here by numba"

FAMILIES: dict[str, Family] = {
    OURS: Family(
        "HBVM and Gauss",
        "HBVM, Gauss",
        "compiled here by numba for this processor, vector instructions as it has them",
    ),
    PROJECTION: Family(
        "HBVM with its energy projected", "HBVM, projection", "compiled here by numba, as HBVM and Gauss"
    ),
    "Taylor": Family("heyoka, Taylor", "heyoka", "compiled here by heyoka's LLVM for this processor"),
    "IAS15": Family("REBOUND, IAS15", "IAS15", WHEEL_AND_FORCES),
    "WHFast": Family("REBOUND, WHFast", "WHFast", WHEEL),
    "WHFast512": Family(
        "REBOUND, WHFast512",
        "WHFast512",
        "from the wheel, with AVX-512 instructions; on other processors it does not run",
    ),
    "SABA": Family("REBOUND, SABA(10,6,4)", "SABA", WHEEL),
    "Leapfrog": Family("REBOUND, leapfrog", "leapfrog", WHEEL_AND_FORCES),
    "DOP853": Family(
        "SciPy, DOP853",
        "DOP853",
        "a step loop in Python around a vector field compiled here by numba",
    ),
}


class FamilyRow(NamedTuple):
    """The settings of a family with one kind of step; every row has the same number of settings."""

    family: str
    steps: str

    @property
    def title(self) -> str:
        """Its name, for readers."""
        return f"{FAMILIES[self.family].title}, {self.steps}"


def row_of(case: Case) -> FamilyRow:
    """Return the row that a setting belongs to."""
    method = make_method(case.method)
    family = family_named(case.method)
    family = OURS if is_ours(method) and family != PROJECTION else family
    return FamilyRow(family, FIXED if fixed_step(method) else OWN)
