"""Writes the tables of docs/summary.md and docs/files.md that stand between markers, from what the program says of its
results (`stickslip --tables`): name, unit and meaning of each key and dataset, as they stand in the source.

usage: scripts/tables.py build/stickslip [--check]         --check: only says which page is stale
    <!-- keys COMMAND -->             the keys of a summary; of a list in it: <!-- keys COMMAND LIST -->
    <!-- datasets COMMAND -->         the datasets of its lists
    <!-- end -->
"""
import json
import os
import re
import subprocess
import sys

DOCS = os.path.join(os.path.dirname(os.path.dirname(os.path.abspath(__file__))), "docs")


LETTERS = {"alpha": "α", "gamma": "γ", "delta": "δ", "eps": "ε", "zeta": "ζ", "eta": "η", "theta": "θ", "lambda": "λ", "nu": "ν",
           "pi": "π", "sigma": "σ", "tau": "τ", "chi": "χ", "psi": "ψ", "omega": "ω"}
LETTER = re.compile(r"(?<![\w:/.*-])(" + "|".join(LETTERS) + r")(0?)(?![\w:-]|\.\w)|(?<![\w:-])(" + "|".join(LETTERS) + r")(?=_[tx]+\b)")
SIGNS = {"<=": "≤", ">=": "≥", "^2": "²", "^3": "³", "sqrt(": "√("}


def letters(words):
    """What the program says in ASCII, in letters and signs: "psi <= 0" is "ψ ≤ 0". What one types, in `...`, stays."""
    parts = re.split(r"(`[^`]*`|\]\([^)]*\))", words)
    for k in range(0, len(parts), 2):
        for ascii_sign, sign in SIGNS.items():
            parts[k] = parts[k].replace(ascii_sign, sign)
        parts[k] = re.sub(r"abs\((\w+)\)", r"|\1|", parts[k])
        parts[k] = LETTER.sub(lambda name: LETTERS[name[1] or name[3]] + ("₀" if name[2] else ""), parts[k])
    return "".join(parts)


def row(*cells):
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |\n"


def unit_of(column):
    return "" if column["unit"] == "1" else letters(column["unit"])


def keys(tables, name=""):
    text = "| key | unit | meaning |\n|---|---|---|\n"
    for column in next(table for table in tables if table["list"] == name)["columns"]:
        if column["key"]:
            text += row(f"`{column['key']}`", unit_of(column), letters(column["meaning"]))
    return text


def datasets(tables):
    text = "| dataset | dimensions | unit | |\n|---|---|---|---|\n"
    for table in tables:
        if not table["dimension"]:
            continue
        dimension = table["dimension"].rpartition("/")[2]
        text += row(f"`{table['dimension']}`", dimension, "", letters(table["counts"]))
        for column in table["columns"]:
            if column["dataset"]:
                text += row(f"`{table['prefix']}{column['dataset']}`", dimension, unit_of(column), letters(column["meaning"]))
    return text


def filled(page, tables):
    def table(mark):
        kind, command, *name = mark[1].split()
        return f"<!-- {mark[1]} -->\n{globals()[kind](tables[command], *name)}<!-- end -->"
    return re.sub(r"<!-- ((?:keys|datasets) [\w. ]+) -->\n.*?<!-- end -->", table, page, flags=re.DOTALL)


if __name__ == "__main__":
    said = json.loads(subprocess.run([sys.argv[1], "--tables"], check=True, capture_output=True, text=True).stdout)
    stale = []
    for name in ("summary.md", "files.md"):
        path = os.path.join(DOCS, name)
        with open(path, encoding="utf-8") as file:
            before = file.read()
        after = filled(before, said)
        if after == before:
            continue
        stale.append(name)
        if "--check" not in sys.argv:
            with open(path, "w", encoding="utf-8") as file:
                file.write(after)
    if stale and "--check" in sys.argv:
        sys.exit(f"stale: {', '.join(stale)}; made by scripts/tables.py build/stickslip")
