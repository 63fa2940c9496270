"""Results have the bits on record: a change of any bit is seen, and is recorded on purpose.

``python -m tests.costs.record`` rewrites the record, and the commit says which bits change and why.
"""

import platform
import sys

import pytest
from llvmlite import binding

from tests.costs.bits import ENSEMBLES, PROCESSORS, alone, in_lanes, recorded
from tests.costs.cases import CASES

_features = binding.get_host_cpu_features()

# The mathematical functions of fields are the kernel's own, and none of its sums depends on the width of
# registers: code for AVX2 and for AVX-512 gives the same bits. Two things are not its own. Products of small
# matrices in the tables (the first stages of a step) are NumPy's: OpenBLAS's kernels with fused multiply-add
# agree (Haswell, SkylakeX), those without (Nehalem) change most bits. The first length of a step and
# decisions of the controller take `pow` and `log` of the C library, glibc's here: the same with and without
# its variants for AVX2 (2026-11-25).
pytestmark = pytest.mark.skipif(
    not (
        sys.platform == "linux"
        and platform.machine() == "x86_64"
        and platform.libc_ver()[0] == "glibc"
        and _features.get("avx2")
        and _features.get("fma")
    ),
    reason="the bits on record are those of x86-64 with AVX2, glibc and OpenBLAS",
)


@pytest.mark.parametrize("name", [name for name in CASES if name not in PROCESSORS])
def test_a_trajectory_has_the_bits_on_record(name):
    assert alone(name) == recorded()["alone"][name]


@pytest.mark.parametrize("name", ENSEMBLES)
def test_an_ensemble_in_lanes_has_the_bits_on_record(name):
    assert in_lanes(name) == recorded()["in lanes"][name]


def test_every_case_but_those_that_follow_the_processor_is_on_record():
    assert recorded()["alone"].keys() == CASES.keys() - PROCESSORS
    assert recorded()["in lanes"].keys() == ENSEMBLES.keys()
