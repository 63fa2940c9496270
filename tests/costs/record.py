"""``python -m tests.costs.record``: count what the cases cost and rewrite the record.

To be run, and its difference read, where a change is meant to alter what integrations cost.
"""

import json

from tests.costs.cases import CASES, RECORDED, counted


def main() -> None:
    """Rewrite the record."""
    text = json.dumps({name: counted(name) for name in CASES}, indent=1)
    RECORDED.write_text(text + "\n", "utf-8")


if __name__ == "__main__":
    main()
