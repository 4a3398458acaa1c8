#!/usr/bin/env python3
"""Looks at the pages that the target `site` has made: scripts/site_links.py FOLDER. Exit code 1 where something is wrong.

Every link and picture leads to a file of the folder and, with `#`, to a heading there; every picture has a text that stands
for it; no paragraph holds what should have become a list, a table, a code block or a comment."""
import glob
import os
import re
import sys
from html.parser import HTMLParser


class Page(HTMLParser):
    def __init__(self, path):
        super().__init__()
        self.names, self.links, self.blind, self.raw, self.open = set(), [], [], [], []
        with open(path, encoding="utf-8") as file:
            self.feed(file.read())

    def handle_starttag(self, tag, attributes):
        given = dict(attributes)
        self.names.update(given[name] for name in ("id", "name") if given.get(name))
        self.links.extend(given[name] for name in ("href", "src") if given.get(name))
        if tag == "img":
            self.blind += [] if given.get("alt") else [given.get("src")]
        elif tag in ("p", "li", "td", "code", "pre", "script"):
            self.open.append(tag)

    def handle_endtag(self, tag):
        if tag in self.open:
            del self.open[len(self.open) - 1 - self.open[::-1].index(tag):]

    def handle_data(self, data):
        if self.open and not {"code", "pre", "script"} & set(self.open):
            self.raw += re.findall(r"(?:^|\n)(?:\s*[-*|]\s.*|.*```.*)|.*\*\*.*|.*<!--.*|.*\]\(.*", data)


def main():
    folder = sys.argv[1]
    pages = {os.path.relpath(path, folder): Page(path) for path in glob.glob(os.path.join(folder, "**", "*.html"), recursive=True)}
    wrong = []
    for name, page in pages.items():
        wrong += [f"{name}: no text stands for {picture}" for picture in page.blind]
        wrong += [f"{name}: raw {text.strip()[:80]!r}" for text in page.raw]
        for link in page.links:
            path, _, place = link.partition("#")
            if re.match(r"[a-z]+:|//", link) or name == "404.html":
                continue
            target = os.path.normpath(os.path.join(os.path.dirname(name), path)) if path else name
            if not os.path.exists(os.path.join(folder, target)) or place and target in pages and place not in pages[target].names:
                wrong.append(f"{name}: {link} leads nowhere")
    print("\n".join(wrong) or f"{len(pages)} pages, every link leads somewhere")
    return bool(wrong)


if __name__ == "__main__":
    sys.exit(main())
