"""The source: who may see whom."""
import floors
from calls import SOURCE


def test_includes_point_down():
    assert floors.broken(SOURCE) == []
