"""The wheel, built of what stands in the repository."""

import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
LARGEST = 2_000_000  # bytes; measured 1.80 MB


@pytest.mark.slow
def test_it_is_small_and_brings_the_compiled_kernel(tmp_path):
    source = tmp_path / "source"
    passed_over = shutil.ignore_patterns("__pycache__", "shipped")
    for folder in ("integrators", "problems", "hbvm_bench"):
        shutil.copytree(ROOT / folder, source / folder, ignore=passed_over)
    for file in ("pyproject.toml", "hatch_build.py", "README.md", "LICENSE"):
        shutil.copy(ROOT / file, source)
    command = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(tmp_path)]
    subprocess.run(command, cwd=source, capture_output=True, check=True)
    (wheel,) = tmp_path.glob("*.whl")
    assert wheel.stat().st_size < LARGEST
    with zipfile.ZipFile(wheel) as opened:
        brought = [one for one in opened.namelist() if one.endswith(".tar.xz")]
    assert len(brought) == 2  # machine code, and texts of LLVM
    assert all(one.startswith("integrators/kernel/shipped/") for one in brought)
