"""A short run of fuzz.py, always the same cases for the same options."""
import fuzz
import pytest


@pytest.mark.ranks
@pytest.mark.parametrize("seed", [1, 2])
def test_random_use(seed):
    assert fuzz.main(["--seed", str(seed), "--cases", "50", "--jobs", "1"]) == 0
