"""docs/options.md is what the program says of its options."""
import os
import subprocess
import sys

from calls import PROGRAM, SOURCE


def test_options_page_is_fresh():
    made = subprocess.run([sys.executable, "-B", os.path.join(SOURCE, "scripts", "options.py"), PROGRAM], check=True,
                          capture_output=True, text=True).stdout
    with open(os.path.join(SOURCE, "docs", "options.md"), encoding="utf-8") as page:
        assert page.read() == made, "docs/options.md is stale: scripts/options.py build/stickslip > docs/options.md"
    rows = [line for line in made.splitlines() if line.startswith("| `")]
    assert len(rows) > 60 and any(line.startswith("| `model_gamma` | 3 |") for line in rows)
