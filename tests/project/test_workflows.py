"""The workflow files, which only a public host runs, as far as they can be checked without it."""

import re
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[2]
FILES = sorted((ROOT / ".github/workflows").glob("*.yml"))
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


def test_they_follow_the_schema():
    command = [sys.executable, "-m", "check_jsonschema", "--builtin-schema", "vendor.github-workflows"]
    done = subprocess.run([*command, *FILES], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def test_they_run_on_every_python_that_is_promised():
    promised = re.findall(r"Python :: (3\.\d+)", "\n".join(PROJECT["classifiers"]))
    lists = re.findall(r"python: \[(.*)\]", (ROOT / ".github/workflows/checks.yml").read_text())
    assert len(lists) == 2
    assert all(re.findall(r"3\.\d+", one) == promised for one in lists)


def test_what_they_run_is_there():
    text = "\n".join(file.read_text() for file in FILES)
    targets = re.findall(r"^([a-z0-9-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE)
    assert set(re.findall(r"run: make ([a-z0-9-]+)", text)) <= set(targets)
    named = re.findall(r"\./(\.github/\S+)|(\.ci/\S+)|\.\./(examples/\S+)|-r (\S+\.lock)", text)
    paths = [path for groups in named for path in groups if path]
    assert len(paths) >= 4
    assert all((ROOT / path).exists() for path in paths)


def test_libraries_without_wheels_for_some_systems_are_asked_for_elsewhere_only():
    from integrators.peers import WHEELS

    marked = [one for one in PROJECT["optional-dependencies"]["peers"] if "sys_platform" in one]
    assert [re.match(r"[\w-]+", one)[0] for one in marked] == list(WHEELS)
