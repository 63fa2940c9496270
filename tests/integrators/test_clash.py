"""A user's own file problems.py beside a script is named in one sentence."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("place", ["problems.py", "problems/__init__.py"])
def test_a_file_of_that_name_is_told_where_integrators_is_imported(tmp_path, place):
    own = tmp_path / place
    own.parent.mkdir(exist_ok=True)
    own.write_text("tasks = [1, 2, 3]\n", encoding="utf-8")
    script = tmp_path / "script.py"
    script.write_text("import integrators\n", encoding="utf-8")
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, script], capture_output=True, text=True, check=False, env=environment
    )
    last = done.stderr.strip().splitlines()[-1]
    assert done.returncode == 1
    assert last == (
        f"ImportError: integrators needs hbvm-bench's package problems, but {own} has that name; rename it."
    )
