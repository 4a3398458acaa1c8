#!/usr/bin/env python3
"""Lines of code, without blanks and comments, of every layer of src/ and include/, and of the tests: the table of
docs/developers/architecture.md. Usage: scripts/lines.py"""
import glob
import os
import sys

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
sys.path.insert(0, os.path.join(ROOT, "tests"))
from layers import LAYERS  # noqa: E402


def code_lines(path):
    """The source has no comments between /* and */ that fill a line."""
    comment = "#" if path.endswith(".py") else "//"
    with open(path, encoding="utf-8") as file:
        return sum(bool(line.strip()) and not line.lstrip().startswith(comment) for line in file)


def of(*patterns):
    paths = {path for pattern in patterns for path in glob.glob(os.path.join(ROOT, pattern), recursive=True)}
    return len(paths), sum(map(code_lines, paths))


def main():
    rows = [(f"`{layer}/`", of(f"src/{layer}/**/*.?pp", f"include/stickslip/{layer}/**/*.?pp"))
            for siblings in reversed(LAYERS) for layer in siblings]
    rows.append(("all of `src/` and `include/`", of("src/**/*.?pp", "include/**/*.?pp")))
    rows += [("unit tests and benchmarks", of("tests/**/*.?pp")), ("tests in Python", of("tests/**/*.py")),
             ("`scripts/` and `postprocess/`", of("scripts/*.py", "postprocess/*.py"))]
    print("| part | files | lines of code |\n|---|---|---|")
    for name, (files, lines) in rows:
        print(f"| {name} | {files} | {lines} |")


if __name__ == "__main__":
    main()
