"""``python -m docs.problem_pages``: write the pages on problems, engines and compile times in docs."""

import argparse
from pathlib import Path

from docs.problem_pages import compile_times, pages

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--no-pictures", action="store_true", help="leave the pictures as they are")
parser.add_argument("--compile-times", action="store_true", help="only measure how long compiling takes")
asked = parser.parse_args()
folder = Path(__file__).parents[1]
if asked.compile_times:
    (folder / "compile_times.md").write_text(compile_times.page(), encoding="utf-8")
else:
    pages.write(folder, with_pictures=not asked.no_pictures)
