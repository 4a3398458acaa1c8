"""Files of columns as measuring programs and spreadsheets write them: every option that takes one reads them alike."""
import itertools

import numpy as np
import pytest

from calls import check, refused, run, words

BLOCK = "-progress auto -model_form chain -bc_left free -grid_n 1 -ts_max_time 0.1 "


def taken(option, given, more=""):
    """What stands for the option in the summary, and what was said of the file."""
    summary, said = run([*words(BLOCK + more), f"-{option}", given])
    return [tuple(map(float, pair.split(":"))) for pair in summary["options"][option].split(",")], \
        [line[11:] for line in said.splitlines() if line.startswith(f"stickslip: {option} ")]


def test_random_files():
    """Separators, decimal commas, headers, comments, marks of byte order, ends of lines, quotes, and which columns: as written,
    so read."""
    draw = np.random.default_rng(70)
    for k, (separator, comma) in enumerate(itertools.product((";", "\t", ",", " "), (False, True))):
        if separator == "," and comma:
            continue
        rows, columns = int(draw.integers(1, 6)), int(draw.integers(2, 6))
        table = np.round(draw.uniform(-3, 3, (rows, columns)), int(draw.integers(0, 5)))
        table[:, 0] = np.sort(draw.choice(40, rows, replace=False))
        names = [f"{name} ({unit})" if separator != " " else name for name, unit in
                 zip(draw.permutation(["Time", "Slip", "mu", "Force", "Point"]), ("s", "um", "-", "N", "%"))][:columns]
        header = draw.random() < 0.7

        def cell(value):
            word = f"{value:.17g}".replace(".", "," if comma else ".")
            return f'"{word}"' if draw.random() < 0.2 and separator != " " else word
        lines = ["# a comment"] if draw.random() < 0.5 else ["% another"]
        lines += [separator.join(names)] if header else []
        for row in table:
            lines += [separator.join(map(cell, row))] + ([""] if draw.random() < 0.2 else [])
        end = "\r\n" if draw.random() < 0.5 else "\n"
        with open(f"{k}.csv", "wb") as file:
            file.write(b"\xef\xbb\xbf" * (draw.random() < 0.5) + end.join(lines).encode() + end.encode() * (draw.random() < 0.7))
        second = int(draw.integers(1, columns))
        choices = [f"{k}.csv:1,{second + 1}"] + [f"{k}.csv:{names[0]},{names[second]}"] * header
        choices += [f'{k}.csv:"{names[0]}","{names[second]}"'] * header + ([f"{k}.csv"] if columns == 2 else [])
        for given in choices:
            pairs, said = taken("load_v", given)
            check(pairs == [(row[0], row[second]) for row in table], f"{given}: {pairs} for {table}")
            which = f"'{names[0]}' and '{names[second]}'" if header else f"1 and {second + 1}"
            which = f"columns {which}" if header or given != f"{k}.csv" else "2 columns"
            check(said == [f"load_v {given}: {rows} row{'s' * (rows > 1)}, {which}{', header skipped' * header}"], f"{said}")


def test_every_option_that_takes_a_file():
    """A curve, a load, a profile, what was measured, and a start, each from columns of one file of a laboratory."""
    with open("lab.csv", "w", encoding="utf-8") as file:
        file.write("Zeit (s);v;mu;N;psi;eta\n" + "".join(
            f"{t};{v};{mu};{N};0,1;0,2\n".replace(".", ",") for t, v, mu, N in ((0, 1, .6, 1), (.5, 2, .7, 1.5), (1, 3, .65, 1))))
    for option, columns, more, second in (
            ("load_normal", "Zeit (s),N", "", [1, 1.5, 1]), ("friction_table", "v,mu", "-friction_law table ", [.6, .7, .65]),
            ("model_k0_profile", "Zeit (s),mu", "", [.6, .7, .65])):
        pairs, said = taken(option, f"lab.csv:{columns}", more)
        check([pair[1] for pair in pairs] == second and "3 rows" in said[0], f"{option}: {pairs}, {said}")
    run([*words("-model_form chain -bc_left free -grid_n 1 -ts_max_time 1 -fit_parameters model_m -fit_starts 1"), "-fit_data",
         "lab.csv:Zeit (s),mu"], command="fit")
    with open("one.txt", "w", encoding="utf-8") as file:
        file.write("eta psi x\n0.2 0.1 0\n")
    start, _ = run(BLOCK.replace("0.1", "1e-9") + "-init_type text -init_file one.txt:x,psi,eta")
    check(abs(start["psi_max"] - 0.1) < 1e-6, f"{start['psi_max']}")


@pytest.mark.parametrize("text,given,said", [
    ("0 abc\n1 0.61\n", "f", ":1, column 2: abc is not a finite number"),
    ("0 0.1\n1 x\n", "f", ":2, column 2: x is not a finite number"),
    ("0;0.1\n1;inf\n", "f", ":2, column 2: inf is not a finite number"),
    ("a;b;c\n0;1;2\n", "f", ":2: 3 columns; 2 are wanted: choose them by number, as in f:1,2, or by name, of 'a', 'b', 'c'"),
    ("0 1\n1 2 3\n", "f", ":2: 3 columns where the rows before have 2"),
    ("Time (s),mu\n0,1\n", "f:Time,mu", "no column Time; did you mean Time (s)?"),
    ("v (km/h);v (m/s);Reibwert\n0,0;0;0,5\n3,6;1;0,45\n", "f:Speed,Reibwert",
     "no column Speed; choose them by number, as in f:1,2, or by name, of 'v (km/h)', 'v (m/s)', 'Reibwert'"),
    ("0,1\n", "f:1,3", "no row has numbers in the columns that are named"),
    ("0,1\n", "f:0,1", "no column 0; they count from 1"),
    ("0,1,2\n", "f:1,2,3", ":1: 3 columns; 2 are wanted"),
    ("0\n1\n", "f", "no row has numbers in 2 columns (it begins with 0)"),
    ("", "f", "no row has numbers in 2 columns"),
    ("\xff\xfe0\x00", "f", ":1: no text of UTF-8"),
    ("0,1\n0,2\n0,3\n", "f", "the first column must ascend"),
])
def test_what_is_wrong_is_named(text, given, said):
    with open("f", "wb") as file:
        file.write(text.encode("latin-1"))
    refused([*words(BLOCK), "-load_v", given], 2, said)


def test_only_what_counts_is_judged():
    """A value that another one replaces is not looked at, a file that it names least of all."""
    with open("bad.yaml", "w", encoding="utf-8") as file:
        file.write("model: {form: chain, m: -3}\nbc_left: free\ngrid_n: 1\nts_max_time: 0.1\nload_v: nowhere.txt\n")
    run("bad.yaml -model_m 1 -load_v 0:1,1:1 -grid_n 0 -grid_n 1")
    refused("bad.yaml -load_v 0:1,1:1", 2, "model_m -3")
    refused("bad.yaml -model_m 1", 2, "nowhere.txt")


def test_a_table_of_forces_beside_an_amplitude():
    _, said = run(BLOCK + "-friction_law table -friction_table 0:220.21,1:150 -model_f0 400")
    check("is multiplied by model_f0 400: friction at rest is 88084; a table of forces goes with model_f0 1" in said, said)
    for quiet in ("0:220,1:150 -model_f0 1", "0:0.6,1:0.5 -model_f0 400"):
        check("is multiplied" not in run(BLOCK + "-friction_law table -friction_table " + quiet)[1], quiet)
