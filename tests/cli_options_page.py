"""docs/options.md is what the program says of its options."""
import os
import subprocess
import sys

source = os.environ["STICKSLIP_SOURCE"]
made = subprocess.run([sys.executable, "-B", os.path.join(source, "scripts", "options.py"), os.environ["STICKSLIP"]],
                      check=True, capture_output=True, text=True).stdout
with open(os.path.join(source, "docs", "options.md"), encoding="utf-8") as page:
    if page.read() != made:
        sys.exit("docs/options.md is stale: scripts/options.py build/stickslip > docs/options.md")
rows = [line for line in made.splitlines() if line.startswith("| `")]
assert len(rows) > 60 and any(line.startswith("| `model_gamma` | 3 |") for line in rows), made
