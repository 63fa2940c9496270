"""What runs under one name in the race, in the words of its pages."""

from dataclasses import dataclass

from hbvm_bench.studies.race.results import OURS


@dataclass(frozen=True)
class Family:
    """What runs under one name in the race.

    Attributes
    ----------
    title, short : str
        For readers; for column heads.
    lead : str
        The method whose colour and marker it has.
    code : str
        What machine code runs.
    """

    title: str
    short: str
    lead: str
    code: str


FAMILIES: dict[str, Family] = {
    OURS: Family(
        "HBVM and Gauss, fixed step",
        "HBVM, Gauss",
        "HBVM",
        "compiled here by numba for this processor, vector instructions as it has them",
    ),
    "Taylor": Family(
        "heyoka, Taylor",
        "heyoka",
        "Taylor",
        "compiled here by heyoka's LLVM for this processor",
    ),
    "IAS15": Family(
        "REBOUND, IAS15",
        "IAS15",
        "IAS15",
        "the wheel's, for any x86-64; forces other than gravity compiled here by numba",
    ),
    "WHFast": Family("REBOUND, WHFast", "WHFast", "WHFast", "the wheel's, for any x86-64"),
    "WHFast512": Family(
        "REBOUND, WHFast512",
        "WHFast512",
        "WHFast512",
        "the wheel's, in AVX-512 instructions; on other processors it does not run",
    ),
    "Leapfrog": Family(
        "REBOUND, leapfrog",
        "leapfrog",
        "Leapfrog",
        "the wheel's, for any x86-64; forces other than gravity compiled here by numba",
    ),
    "DOP853": Family(
        "SciPy, DOP853",
        "DOP853",
        "DOP853",
        "a step loop in Python around a vector field compiled here by numba",
    ),
}
