"""``python -m tests.costs.record``: count what the cases cost, digest their results, rewrite both records.

To be run, and its difference read, where a change is meant to alter what integrations cost or their bits.
"""

import json

from tests.costs import bits, cases


def main() -> None:
    """Rewrite the records."""
    costs = {name: cases.counted(name) for name in cases.CASES}
    for path, record in ((cases.RECORDED, costs), (bits.RECORDED, bits.digested())):
        path.write_text(json.dumps(record, indent=1) + "\n", "utf-8")


if __name__ == "__main__":
    main()
