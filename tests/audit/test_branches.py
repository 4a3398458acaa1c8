"""Special points of random branches of cycles: see branches.py."""
from branches import compare, scene
from calls import check


def test_special_points_of_random_branches(scenes):
    found = [compare(drawn, f"scene {index}") for index, drawn in scenes(scene, 671, short=2)]
    check(sum(f is not None for f in found) > 0, "no branch")
    check(sum(f or 0 for f in found) > 0, "no special point")
