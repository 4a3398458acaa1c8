"""Some cases of kills.py, always the same but for the moment in which they come: two runs, on one rank and on two, a
sweep, a command with one result, a small disk."""
import pytest

import kills


@pytest.mark.ranks
@pytest.mark.parametrize("seed, case", [(88, 0), (12, 1), (12, 6), (15, 7), (2, 9)])
def test_kills(seed, case):
    assert kills.main(["--seed", str(seed), "--only", str(case)]) == 0
