#!/usr/bin/env python3
"""Lines of code, without blanks and comments, of every layer of src/ and include/, and of the tests: the table of
docs/developers/architecture.md. Usage: scripts/lines.py"""
import glob
import os
import re

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
LAYERS = ("commands", "study", "time", "stability", "waves", "cycles", "output", "model", "options", "numerics", "base")


def code_lines(path):
    """Of a C++ file, or of a Python file with its texts between triple quotes."""
    with open(path, encoding="utf-8") as file:
        text = file.read()
    if path.endswith(".py"):
        return sum(bool(line.strip()) and not line.lstrip().startswith("#") for line in text.splitlines())
    text = re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL)
    return sum(bool(line.strip()) and not line.lstrip().startswith("//") for line in text.splitlines())


def of(*patterns):
    paths = {path for pattern in patterns for path in glob.glob(os.path.join(ROOT, pattern), recursive=True)}
    return len(paths), sum(map(code_lines, paths))


def main():
    rows = [(f"`{layer}/`", of(f"src/{layer}/**/*.?pp", f"include/stickslip/{layer}/**/*.?pp")) for layer in LAYERS]
    rows.append(("all of `src/` and `include/`", of("src/**/*.?pp", "include/**/*.?pp")))
    rows += [("unit tests and benchmarks", of("tests/**/*.?pp")), ("tests in Python", of("tests/**/*.py")),
             ("`scripts/` and `postprocess/`", of("scripts/*.py", "postprocess/*.py"))]
    print("| part | files | lines of code |\n|---|---|---|")
    for name, (files, lines) in rows:
        print(f"| {name} | {files} | {lines} |")


if __name__ == "__main__":
    main()
