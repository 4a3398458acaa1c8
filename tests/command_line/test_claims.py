"""What the pages and scenes say is what the program says (scripts/claims.py); the claims that take longer: ./check book."""
import importlib.util
import os
import re
import shlex
import shutil
import tempfile

import pytest

from calls import PROGRAM, SOURCE, ran

spec = importlib.util.spec_from_file_location("claims", os.path.join(SOURCE, "scripts", "claims.py"))
claims = importlib.util.module_from_spec(spec)
spec.loader.exec_module(claims)

PAGES = {name: claims.Page(name) for name in claims.pages()}
CHECKED = [name for name, page in PAGES.items()
           if any(kind == "check" for kind, *_ in page.notes) or any(claims.sessions(page))]


@pytest.mark.parametrize("name", CHECKED)
def test_claims_hold(name):
    wrong = list(claims.check(PAGES[name], long=False))
    assert not wrong, "\n".join(wrong)


def test_pages_say_what_longer_claims_hold():
    """The numbers of claims that ./check does not run, too."""
    silent = [f"{name}: {claim}" for name, page in PAGES.items() for kind, (_, *claimed), _ in page.notes if kind == "check long"
              for claim in claimed if " = " in claim and not page.shows(claim.rpartition(" = ")[2].partition(" ~ ")[0])]
    assert not silent, silent


def test_false_claims_are_found(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("Stable from v = 0.966 and 0.967 upwards.\n<!-- check: spectrum -grid_n 8 -model_v 1; stable is False; "
                    "growth_rate = 0.966; growth_rate = -0.1; growth_rate < 0; frequency = 0.967 ~ 0.04 -->\n")
    wrong = [words.split("\n")[1].strip() for words in claims.check(claims.Page(str(page)), long=False)]
    # growth rate -C/2 = -0.1, frequency sqrt(1 - 0.01) = 0.995
    assert wrong[0] == "not true: stable is False" and re.match(r"growth_rate is -0\.\d+, not 0\.966", wrong[1])
    assert wrong[2] == "the page does not say -0.1: growth_rate = -0.1" and len(wrong) == 3


def test_false_output_is_found(tmp_path):
    page = tmp_path / "page.md"
    for shown, wrong in (("psi 1.004 b\n...\n", ""), ("psi 1.02 b\n...\n", "'psi 1.0 b'"), ("eta 1 b\n...\n", "'psi 1.0 b'"),
                         ("psi 1 b\n", "prints more: more")):
        page.write_text(f"```console\n$ printf 'psi 1.0 b\\nmore\\n'\n{shown}```\n")
        found = list(claims.check(claims.Page(str(page)), long=False))
        assert len(found) == bool(wrong) and wrong in "".join(found), found


def dry(command, folder):
    """What the program says of a command whose result has no folder to go to: everything else of it is right."""
    words = shlex.split(command)
    done = ran([PROGRAM, *words[1:], "-out_file", "nowhere/x.h5"], folder)
    return None if done.returncode == 2 and "error: out_file 'nowhere/" in done.stderr else f"{command}: {done.stderr.strip()}"


@pytest.mark.parametrize("name", [name for name in PAGES if name.endswith(".md")])
def test_blocks_of_pages_are_understood(name):
    """Every block of YAML, pasted into a file, is a scene, and every command of the program has options that it takes; that they
    do what the page says, too, is seen by ./check book --commands."""
    folder = claims.tree(os.path.realpath(tempfile.mkdtemp(dir=".")))
    wrong = []
    for command in claims.commands(PAGES[name]):
        for part in re.split(r" && |; | \| ", command):
            if re.match(r"(build/)?stickslip \w", part) and "$" not in part and not re.search("-help|-restart", part):
                wrong.append(dry(part, folder))
    for number, block in enumerate(claims.scenes(PAGES[name])):
        with open(os.path.join(folder, f"{number}.yaml"), "w", encoding="utf-8") as file:
            file.write(block)
        for data in re.findall(r"^fit: \{data: ([\w.-]+)", block, re.MULTILINE):
            shutil.copy(os.path.join(SOURCE, "runs", data), folder)
        wrong.append(dry(f"stickslip {claims.command_of(block)} {number}.yaml", folder))
    wrong = list(filter(None, wrong))
    assert not wrong, "\n".join(wrong)


def test_false_tables_are_found(tmp_path):
    """What a command prints is compared line by line; a line that is the same is not shown."""
    page = tmp_path / "page.md"
    command = "<!-- made: printf '| a |\\n|---|\\n| 1 |\\n| 2 |\\n' -->\n"
    page.write_text(command + "| a |\n|---|\n| 1 |\n| 2 |\n\n" + command + "| a |\n|---|\n| 1 |\n| 3 |\n")
    (wrong,) = claims.make(claims.Page(str(page)))
    assert wrong.split("\n    ")[-2:] == ["-| 3 |", "+| 2 |"]


def numeric(table):
    cells = [cell.strip() for row in table.splitlines()[2:] for cell in row.strip("|").split("|")]
    return sum(bool(re.match(r"[+-]?\d[\d.]*(?:e[+-]?\d+)?\b", cell)) for cell in cells) > 0.3 * len(cells)


@pytest.mark.parametrize("name", [name for name in PAGES if name.endswith(".md")])
def test_pictures_and_tables_say_how_they_were_made(name):
    """A comment stands right before each of them; a table that a test writes has the test's own."""
    text = PAGES[name].text
    silent = [match[1] for match in re.finditer(r"\n+(!\[[^]]*\]\([\w/-]+\.png\))", text) if text[:match.start()][-3:] != "-->"]
    for match in re.finditer(r"\n\n?((?:\|.*\n)+)", text):
        if numeric(match[1]) and text[:match.start()][-3:] != "-->":
            silent.append(match[1].partition("\n")[0])
    assert not silent, f"{name}: nothing says how these were made: {silent}"
