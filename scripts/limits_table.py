"""Markdown table of a chart of limits, from its summary:  scripts/limits_table.py SUMMARY.json"""
import json
import sys


def cell(value):
    return "" if value is None else f"{value:.3g}" if isinstance(value, float) else str(value)


def main(path):
    with open(path, encoding="utf-8") as file:
        rows = json.load(file)["rows"]
    keys = ["shortest", "shortest_theory", "limit", "theory", "how", "followed", "wrong", "damps", "damps_theory"]
    varies = [key for key in ("value", "order", "n") if len({row[key] for row in rows}) > 1]
    heads = varies + ["method", "shortest wave grows", "theory", "run ends up to", "theory", "beyond it", "right up to",
                      "beyond it", "hides instability from", "theory"]
    print("| " + " | ".join(heads) + " |\n" + "|---" * len(heads) + "|")
    for row in rows:
        splits = row["method"].startswith("arkimex") or row["method"].startswith("rosw") and row["implicit"] != "both"
        name = row["method"] + (f":{row['implicit']}" if splits else "")
        print("| " + " | ".join([cell(row[key]) for key in varies] + [name] + [cell(row[key]) for key in keys]) + " |")


if __name__ == "__main__":
    main(sys.argv[1])
