"""What the pages and scenes say is what the program says (scripts/claims.py); the claims that take longer: ./check book."""
import importlib.util
import os
import re

import pytest

from calls import SOURCE

spec = importlib.util.spec_from_file_location("claims", os.path.join(SOURCE, "scripts", "claims.py"))
claims = importlib.util.module_from_spec(spec)
spec.loader.exec_module(claims)

PAGES = {name: claims.Page(name) for name in claims.pages()}
CHECKED = [name for name, page in PAGES.items() if any(kind == "check" for kind, *_ in page.notes)]


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
