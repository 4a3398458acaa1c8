"""The calls of a default step, those of a frame and those of a growth rate of `boundary`, as docs/developers/architecture.md
lists them, are those of the source: at most eight calls, six calls, and six files.

How many calls a run passes is counted by a unit test (tests/test_fused.cpp).
"""
import os
import re

from calls import SOURCE

MOST, MOST_FILES, MOST_OF_A_FRAME = 8, 6, 6


def listed(title):
    with open(os.path.join(SOURCE, "docs/developers/architecture.md"), encoding="utf-8") as page:
        part = page.read().split(f"## {title}\n")[1].split("\n## ")[0]
    return re.findall(r"^\d+\. `([\w:()]+)` \(`([\w/.]+)`\)", part, re.MULTILINE)


def body_of(name, path):
    """The text between the braces of a function, defined in its class or outside it."""
    with open(os.path.join(SOURCE, "src", path), encoding="utf-8") as file:
        text = file.read()
    outside, within = re.escape(name), re.escape(name.split("::")[-1])
    found = re.search(rf"\b{outside}\([^;{{]*\{{", text) or re.search(rf"\b{within}\([^;{{]*\{{", text)
    assert found, f"{name} is not defined in src/{path}"
    depth, end = 1, found.end()
    while depth:
        depth += {"{": 1, "}": -1}.get(text[end], 0)
        end += 1
    return text[found.end():end]


def check_calls(way):
    for (name, path), (following, _) in zip(way, way[1:]):
        called = following.split("::")[-1]
        assert re.search(rf"\b{called}\(", body_of(name, path)), f"{name} (src/{path}) does not call {following}"


def test_a_growth_rate_passes_few_files():
    way = listed("The way of a growth rate")
    assert way[0][1].startswith("commands/") and body_of(*way[-1]), way
    assert len({path for _, path in way}) <= MOST_FILES, way
    check_calls(way)


def test_the_list_is_that_of_the_source():
    calls = listed("The way of a step")
    assert 4 < len(calls) <= MOST, calls
    way = [("simulate", "study/simulate.cpp")] + calls
    check_calls(way[:-1])
    # the loop over nodes is compiled for each set of instructions, and called by a name of the class
    assert "pointwise_(" in body_of(*way[-2])
    assert re.search(r"struct PointwiseOfColumns\b", open(os.path.join(SOURCE, "src", way[-1][1]), encoding="utf-8").read())


def test_the_way_of_a_frame_is_that_of_the_source():
    calls = listed("The way of a frame")
    assert 4 < len(calls) <= MOST_OF_A_FRAME, calls
    way = [("Frames::write", "output/series.cpp")] + calls
    # what flush() hands to collect(), and direct() to put(), is called by those
    from_hand = {"collect": calls[1], "RunFile::Impl::give_frames": calls[1], "Column::put": ("direct", calls[1][1])}
    for caller, (following, _) in zip(way[:-1], way[1:]):
        called = following.split("::")[-1]
        name, path = from_hand.get(caller[0], caller)
        assert re.search(rf"\b{called}\(", body_of(name, path)), f"{name} (src/{path}) does not call {following}"
