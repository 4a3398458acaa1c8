"""docs/: every page has its place in the reading order, links lead to what is there, and files.md names what files hold."""
import os
import re

import h5py
import pytest

from calls import SOURCE, run

DOCS = os.path.join(SOURCE, "docs")


def text(path):
    with open(os.path.join(SOURCE, path), encoding="utf-8") as file:
        return file.read()


def pages():
    return sorted(name for name in os.listdir(DOCS) if name.endswith(".md"))


def test_reading_order():
    order = list(dict.fromkeys(re.findall(r"\]\(([\w-]+\.md)\)", text("docs/README.md"))))
    assert sorted(order + ["README.md"]) == pages()
    assert ["README.md"] + order == re.findall(r"([\w-]+\.md)$", text("docs/site.yml.in"), re.MULTILINE)


def anchors(page):
    """Of the page's headings, as GitHub and mkdocs both make them; those that they make differently have none."""
    headings = re.findall(r"^#+ (.*)$", re.sub(r"```.*?```", "", text(page), flags=re.DOTALL), re.MULTILINE)
    plain = [re.sub(r"[^\w\s-]", "", heading).strip().lower() for heading in headings]
    return {heading.replace(" ", "-") for heading in plain if not re.search(r"\s\s|-\s|\s-|--", heading)}


def test_links_and_pictures():
    missing = []
    for page in ["README.md", *(os.path.join("docs", name) for name in pages())]:
        for shown, target in re.findall(r"(!?\[[^\]]*\])\(([^)\s]+)\)", text(page)):
            file = os.path.join(SOURCE, os.path.dirname(page), target.partition("#")[0] or os.path.basename(page))
            if re.match(r"https?:", target):
                continue
            place = target.partition("#")[2]
            if not os.path.exists(file) or shown == "![]" or place and place not in anchors(file):
                missing.append(f"{page}: {shown}({target})")
    assert not missing


# The least that makes a file of each kind with most of what it may hold.
FILES = {
    "run": "-model_form chain -grid_n 8 -ts_max_time 2 -friction_law carlson-langer -state_law healing -bc_left free -init_noise 0.3 "
           "-init_state 1 -out_probes 1,2 -out_events -out_displacement -lyapunov_count 1 -friction_amplitude_profile 0:1,7:2 "
           "-out_checkpoint_every 5 -out_file run.h5",
    "spectrum": "-grid_n 16 -model_v 1.1 -spectrum_pseudo 3",
    "boundary": "-grid_n 16 -model_form chain -friction_law carlson-langer -model_zeta paper -boundary_parameter model_v "
                "-boundary_from 0.5 -boundary_to 4 -boundary_parameter2 model_k1 -boundary_from2 0.1 -boundary_to2 1 "
                "-boundary_points 6 -boundary_verify 1",
    "wave": "-model_v 0.8 -wave_pulses 1 -wave_length 25 -wave_continue model_v -wave_to 0.81 -wave_steps 1 -wave_spectrum",
    "cycle": "-cycle_spectrum -cycle_continue model_v -cycle_to 0.21 -cycle_steps 1",
    "chart": "-grid_n 16 -grid_length 20 -ts_max_time 0.1 -chart_methods rk:3bs -chart_tolerances 1e-3 -chart_orders 2 "
             "-chart_grids 16 -chart_repeats 1",
    "laws": "",
}


def named():
    """{kind: the datasets that docs/files.md names}: those of a group stand in the last cell of the group's rows."""
    sections = re.split(r"^## ", text("docs/files.md"), flags=re.MULTILINE)[1:]
    names = {}
    for title, _, section in (part.partition("\n") for part in sections):
        names[title] = found = set()
        for first, *_, last in (re.findall(r"[^|]+", row) for row in re.findall(r"^\|.*\|$", section, re.MULTILINE)):
            for name in re.findall(r"`([\w-]+/?)`", first):
                found |= {name + each for each in re.findall(r"`(\w+)`", last)} if name.endswith("/") else {name}
    return names


@pytest.mark.parametrize("kind", FILES)
def test_files_hold_what_the_page_names(kind):
    run(f"-out_file {kind}.h5 {FILES[kind]}", command=kind)
    found = []
    with h5py.File(kind + ".h5") as file:
        file.visititems(lambda name, item: found.append(name) if isinstance(item, h5py.Dataset) else None)
    assert len(found) > 5 and not set(found) - named()[kind]
    if kind == "run":
        with h5py.File(sorted(name for name in os.listdir() if ".chk-" in name)[0]) as file:
            assert set(file) == {"arrays", "fields", "numbers"}
        assert all(f"`{name}/`" in text("docs/files.md") for name in ("arrays", "fields", "numbers"))
