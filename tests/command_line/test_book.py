"""docs/: every page has its place in the reading order, and links lead to what is there."""
import os
import re

from calls import SOURCE

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


def test_links_and_pictures():
    missing = []
    for page in ["README.md", *(os.path.join("docs", name) for name in pages())]:
        for shown, target in re.findall(r"(!?\[[^\]]*\])\(([^)\s]+)\)", text(page)):
            file = os.path.join(SOURCE, os.path.dirname(page), target.partition("#")[0])
            if not re.match(r"https?:", target) and not os.path.exists(file) or shown == "![]":
                missing.append(f"{page}: {shown}({target})")
    assert not missing
