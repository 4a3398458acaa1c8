"""Cycles that motions of random unlike blocks settle on: see settling.py."""
from calls import check
from settling import compare, scene


def test_what_motions_of_unlike_blocks_settle_on(scenes):
    found = sum(compare(p, f"scene {index}") for index, p in scenes(scene, 661, short=20))
    check(found > 0, "no cycle")
