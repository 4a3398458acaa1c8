"""Markdown table of a chart of limits, from its summary:  scripts/limits_table.py SUMMARY.json [KEY KEY]

With two keys of its rows, such as `shortest limit`: a line for each method, a column for each order and grid, and in each
cell both numbers, `none` where there is none."""
import json
import sys

from tables import letters


def cell(value):
    return "" if value is None else f"{value:.3g}" if isinstance(value, float) else letters(str(value))


def name_of(row):
    splits = row["method"].startswith("arkimex") or row["method"].startswith("rosw") and row["implicit"] != "both"
    return row["method"] + (f":{row['implicit']}" if splits else "")


def lines(heads, body):
    return "\n".join("| " + " | ".join(words) + " |" for words in (heads, *body)).replace("\n", "\n|" + "---|" * len(heads) + "\n", 1)


def by_grid(rows, keys):
    grids = list(dict.fromkeys((row["order"], row["n"]) for row in rows))
    of = {(name_of(row), row["order"], row["n"]): " / ".join(cell(row[key]) or "none" for key in keys) for row in rows}
    return lines(["method", *(f"order {order}, n = {n}" for order, n in grids)],
                 [[name, *(of[name, *grid] for grid in grids)] for name in dict.fromkeys(map(name_of, rows))])


def whole(rows):
    keys = ["shortest", "shortest_theory", "limit", "theory", "how", "followed", "wrong", "damps", "damps_theory"]
    varies = [key for key in ("value", "order", "n") if len({row[key] for row in rows}) > 1]
    heads = varies + ["method", "shortest wave grows", "theory", "run ends up to", "theory", "beyond it", "right up to",
                      "beyond it", "hides instability from", "theory"]
    return lines(heads, [[cell(row[key]) for key in varies] + [name_of(row)] + [cell(row[key]) for key in keys] for row in rows])


def main(path, *keys):
    with open(path, encoding="utf-8") as file:
        rows = json.load(file)["rows"]
    print(by_grid(rows, keys) if keys else whole(rows))


if __name__ == "__main__":
    main(*sys.argv[1:])
