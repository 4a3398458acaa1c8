"""A short run of kills.py, always the same kills but for the moment in which they come."""
import pytest

import kills


@pytest.mark.ranks
def test_kills():
    assert kills.main(["--seed", "5", "--cases", "6"]) == 0
