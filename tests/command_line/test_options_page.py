"""docs/options.md and the man page are what the program says of its options."""
import os
import subprocess
import sys

import pytest

from calls import PROGRAM, SOURCE


@pytest.mark.parametrize("words, page, least", [([], "options.md", "| `model_gamma` | 3 |"),
                                                (["--man"], "stickslip.1", ".B \\-model_gamma")])
def test_page_is_fresh(words, page, least):
    made = subprocess.run([sys.executable, "-B", os.path.join(SOURCE, "scripts", "options.py"), *words, PROGRAM],
                          check=True, capture_output=True, text=True).stdout
    with open(os.path.join(SOURCE, "docs", page), encoding="utf-8") as file:
        assert file.read() == made, \
            f"docs/{page} is stale: scripts/options.py {' '.join([*words, 'build/stickslip'])} > docs/{page}"
    assert least in made and made.count("\n") > 120
