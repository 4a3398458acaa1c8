"""docs/: every page has its place in the reading order, links lead to what is there, and files.md names what files hold."""
import glob
import os
import re
import subprocess

import h5py
import markdown
import pytest

from calls import SOURCE, run
from files_page import FilesPage, contents, disagreements

DOCS = os.path.join(SOURCE, "docs")


def text(path):
    with open(os.path.join(SOURCE, path), encoding="utf-8") as file:
        return file.read()


def pages():
    """Names within docs/, as `developers/adding.md`."""
    return sorted(glob.glob("**/*.md", root_dir=DOCS, recursive=True))


def test_reading_order():
    order = list(dict.fromkeys(re.findall(r"\]\(([\w/-]+\.md)\)", text("docs/README.md"))))
    assert sorted(order + ["README.md"]) == pages()
    assert ["README.md"] + order == re.findall(r" ([\w/-]+\.md)$", text("docs/site.yml.in"), re.MULTILINE)


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


def test_links_have_names():
    """A link says what it leads to, and not in which file that is; the site's list of pages has a name for each."""
    files = [f"{page}: {shown}" for page in map("docs/{}".format, pages())
             for shown in re.findall(r"\[[\w/-]+\.md\]\([^)]*\)", text(page))]
    assert not files
    assert len(re.findall(r"^ +- [A-Z][\w ]+: [\w/-]+\.md$", text("docs/site.yml.in"), re.MULTILINE)) == len(pages())


def test_only_formulas_are_typeset_as_formulas():
    """No initial of a name, volume of a journal or number in brackets."""
    wrong = [f"{page}: {found[0]}" for page in map("docs/{}".format, pages())
             for found in re.finditer(r"\b(?:Rev|Int|Phys|Mech|Res|Appl)\. \$[^$]*\$|\bof \$[A-Z]\$\. [a-z]|\$[A-Za-z] \([\d\\ln ]+\)\$", text(page))]
    assert not wrong


def test_code_has_its_language():
    """Blocks are fenced, begin where their lines do, and what one types has a language, by which it is run (claims.py). Formulas
    are whole on a line, with no letter or digit beside them, as GitHub wants them."""
    wrong = []
    for page in ["README.md", "CONTRIBUTING.md", *map("docs/{}".format, pages())]:
        shown = re.sub(r"<!--.*?-->", "", text(page), flags=re.DOTALL)
        wrong += [f"{page}: {line}" for line in re.findall(r"^ *```\n((?:build/)?stickslip \w.*|postprocess/.*)", shown, re.MULTILINE)]
        prose = re.sub(r"^ *```.*?```$|^\$\$$.*?^\$\$$", "", shown, flags=re.DOTALL | re.MULTILINE)
        wrong += [f"{page}: indented: {line}" for line in re.findall(r"\n\n( {4,}\S.*)", prose)]
        for line in re.sub(r"`[^`]*`", "``", prose).splitlines():
            beside = "".join(line[m.start() - 1:m.start()] + line[m.end():m.end() + 1] for m in re.finditer(r"\$[^$]+\$", line))
            if line.count("$") % 2 or re.search(r"\w", beside):
                wrong.append(f"{page}: formula: {line}")
    assert not wrong


def rendered(folder):
    """The pages as HTML in a folder, by mkdocs' own converter and extensions, beside their pictures."""
    for name in pages():
        html = markdown.markdown(text(os.path.join("docs", name)), extensions=["toc", "tables", "fenced_code", "sane_lists"])
        path = os.path.join(folder, name[:-len("md")] + "html")
        os.makedirs(os.path.dirname(path), exist_ok=True)
        with open(path, "w", encoding="utf-8") as file:
            file.write(re.sub(r'(href="[^":]*)\.md(["#])', r"\1.html\2", html))
    for name in glob.glob("**/*.png", root_dir=DOCS, recursive=True):
        os.symlink(os.path.join(DOCS, name), os.path.join(folder, name))


def site_check(folder):
    return subprocess.run(["/usr/bin/python3", "-B", os.path.join(SOURCE, "scripts", "site_links.py"), folder],
                          capture_output=True, text=True)


def test_pages_in_a_browser():
    """Every link leads somewhere, every picture has a text, nothing is left in Markdown. `ninja -C build site` makes them so."""
    rendered("site")
    done = site_check("site")
    assert done.returncode == 0 and done.stdout.startswith(f"{len(pages())} pages"), done.stdout + done.stderr


def test_dead_links_and_silent_pictures_are_found():
    rendered("site")
    with open(os.path.join("site", "model.html"), "a", encoding="utf-8") as file:
        file.write('<a href="theory.html#nowhere">x</a><a href="gone.html">x</a><img src="model.png"><p>**raw**</p>')
    done = site_check("site")
    assert done.returncode == 1
    for wrong in ("theory.html#nowhere leads nowhere", "gone.html leads nowhere", "no text stands for model.png", "raw '**raw**'"):
        assert f"model.html: {wrong}" in done.stdout


def test_files_and_tests_that_pages_name_are_there():
    """Headers without `include/stickslip/`, sources without `src/` or their ending, tests without their folder."""
    folders = ("", "src", "include", "include/stickslip", "tests", "tests/command_line", "tests/audit")
    tops = "|".join(sorted({name for folder in ("", "src") for name in os.listdir(os.path.join(SOURCE, folder)) if name.isalpha()}))
    missing = []
    for page in ["README.md", "CONTRIBUTING.md", *(os.path.join("docs", name) for name in pages())]:
        for name in re.findall(rf"`((?:{tops})/[\w/.-]+|test_\w+\.\w+)`", text(page)):
            paths = [os.path.join(SOURCE, folder, name) + ending for folder in folders for ending in ("", ".cpp", ".hpp")]
            if not name.startswith(("build/", "results/")) and not any(map(os.path.exists, paths)):
                missing.append(f"{page}: {name}")
    assert not missing


# The least that makes files of each kind with all that they may hold. `curves/` and `special/` take longer to make: they are
# held against the page where a test has made them for another reason.
FILES = {
    "run": ["-model_form chain -grid_n 8 -ts_max_time 2 -friction_law carlson-langer -state_law healing -bc_left free -init_noise "
            "0.3 -init_state 1 -out_probes 1,2 -out_events -out_rupture -out_displacement -lyapunov_count 2 -friction_amplitude_profile 0:1,7:2 "
            "-friction_alpha_profile 0:0.5,7:0.6 -out_checkpoint_every 5", "-grid_n 8 -ts_max_time 1 -load_v 0:0.2,1:0.3",
            "-grid_n 8 -ts_max_time 1 -load_normal 0:1,1:1.3",
            "-model_form chain -grid_n 4 -bc_left free -friction_law coulomb -init_psi 0 -model_v 0.1 -ts_max_time 5 -load_halt "
            "-out_events"],
    "spectrum": ["-grid_n 8 -model_v 1.1 -friction_law rate-and-state -state_law ageing"],
    "boundary": ["-grid_n 16 -model_form chain -friction_law carlson-langer -model_zeta paper -boundary_parameter model_v "
                 "-boundary_from 0.5 -boundary_to 4 -boundary_parameter2 model_k1 -boundary_from2 0.1 -boundary_to2 1 "
                 "-boundary_points 6 -boundary_verify 1"],
    "wave": ["-model_v 0.8 -wave_pulses 1 -wave_length 25 -wave_continue model_v -wave_to 0.81 -wave_steps 1 -wave_spectrum",
             "-friction_law rate-and-state -friction_b 0.5 -state_law slip -model_v 1 -wave_pulses 1 -wave_length 30"],
    "cycle": ["-model_form chain -friction_law carlson-langer -model_zeta paper -state_law healing -model_v 1 -cycle_spectrum -cycle_wavenumbers 3",
              "-model_v 0.9655 -cycle_continue model_v -cycle_to 1.1"],
    "chart": ["-grid_n 16 -grid_length 20 -ts_max_time 0.1 -chart_methods rk:3bs -chart_tolerances 1e-3 -chart_orders 2 "
              "-chart_grids 16 -chart_repeats 1",
              "-chart_kind limits -grid_n 16 -chart_methods rk:3bs -chart_parameter model_gamma -chart_values 3 -ts_max_time 1"],
    "laws": ["", "-friction_table 0:1,1:0.5"],
    "fit": ["-model_form chain -grid_n 1 -bc_left free -ts_max_time 5 -fit_data 1:0.1,2:0.2,3:0.1,4:0.2 -fit_parameters model_k0 -fit_starts 1"],
}
ELSEWHERE = {"boundary": ("special/", "wave_", "train/"), "wave": "curves/"}
PAGE = FilesPage()


@pytest.mark.parametrize("kind", FILES)
def test_files_hold_what_the_page_names(kind):
    """Every dataset and attribute found stands on the page, with its dimensions, and each of the page is found."""
    found, attributes = set(), set()
    for number, options in enumerate(FILES[kind]):
        units = "-units_time s" if number == 0 else ""
        run(f"-out_file {number}.h5 {options} {units}", command=kind)
        profiles = re.findall(r"-(friction_\w+)_profile", options)
        assert disagreements(f"{number}.h5", PAGE, but=profiles) == []
        held = contents(f"{number}.h5")
        found |= set(held[2]) | {name.replace("theta", "tau") for name in held[2]}
        attributes |= held[1]
        assert set(profiles) <= set(held[2])
    found |= {name.replace("tau", "theta") for name in found}
    elsewhere = ELSEWHERE.get(kind, "/")
    assert {name for name in PAGE.datasets[kind] if not name.startswith(elsewhere)} <= found
    assert PAGE.attributes[kind] - attributes <= {"branch_parameter2"}
    if kind == "run":
        held_in_checkpoint(sorted(name for name in os.listdir() if ".chk-" in name)[0])


def held_in_checkpoint(path):
    with h5py.File(path) as file:
        assert {f"{name}/" for name in file} == set(re.findall(r"`(\w+/)`", text("docs/files.md").partition("## Checkpoints")[2]
                                                              .partition("\n## ")[0]))
        assert set(file.attrs) == PAGE.attributes["run"] - PAGE.own_attributes["run"] | PAGE.own_attributes["Checkpoints"]


def test_tables_of_sweeps():
    """Dimensions are the options; each variable is a key of the summaries, or the member of one."""
    options = "-grid_n 8 -ts_max_time 0.1 -units_time s -sweep_parameter1 model_v -sweep_values1 0.1,0.2 "
    keys = set(re.findall(r"`(\w+)`", text("docs/summary.md")))
    for more, dimensions in (("-sweep_parameter2 model_gamma -sweep_values2 2,3", ("model_v", "model_gamma")),
                             ("-sweep_follow", ("model_v", "direction")),
                             ("-sweep_parameter2 model_gamma -sweep_values2 2,3 -sweep_sample list", ("point",))):
        run(options + more + " -out_file s.h5", command="sweep")
        kind, attributes, found = contents("s.h5")
        assert attributes == PAGE.attributes[kind] - (set() if dimensions == ("point",) else {"coordinates"})
        for name, found_dimensions in found.items():
            if found_dimensions != (name,):
                own = (name + "_number",) if name == "measured_over" else ()
                assert found_dimensions == dimensions + own, name
                assert name in keys or name in ("number", "model_v", "model_gamma"), name
