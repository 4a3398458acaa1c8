"""Prints docs/options.md, or with --man docs/stickslip.1, made from what the program says of itself: `stickslip COMMAND
-help` for every command.

usage: scripts/options.py build/stickslip > docs/options.md
       scripts/options.py --man build/stickslip > docs/stickslip.1
"""
import re
import subprocess
import sys

from tables import letters


def said(program, *words):
    return subprocess.run([program, *words], check=True, capture_output=True, text=True).stdout


def commands(program):
    text = said(program, "--help").split("commands:\n")[1].split("\n\n")[0]
    return [line.split()[0] for line in text.splitlines()]


def options(program, command):
    """(group, name, default, values, description) of each option of a command, in its order."""
    group = None
    whole = said(program, command, "-help").split("\n\n", 3)[3].splitlines()
    lines = [line for line in whole if not line.startswith("  -NAME_profile")]
    if len(lines) < len(whole):  # of which only the help of that group has a line for each
        lines += said(program, command, "-help", "profiles").split("\n\n", 3)[3].splitlines()
    for k, line in enumerate(lines):
        head = re.fullmatch(r"  -(\w+) \[(.*?)\]: (.*)", line)
        if head:
            body = []
            for more in lines[k + 1:]:
                if not more.startswith("      "):
                    break
                body.append(more.strip())
            yield group, head.group(1), head.group(2), head.group(3), " ".join(body)
        elif line and not line.startswith(" "):
            group = line


def of_all(program):
    """The options by group and name, and the commands that read each of them."""
    groups, readers = {}, {}
    names = commands(program)
    for command in names:
        for group, name, *entry in options(program, command):
            groups.setdefault(group, {})[name] = entry
            readers.setdefault(name, {})[command] = True
    return groups, {name: "all" if list(by) == names else " ".join(by) for name, by in readers.items()}


def page(program):
    groups, readers = of_all(program)
    name_of = re.compile(r"(?<![\w`.-])-?(?:" + "|".join(sorted(readers, key=len, reverse=True)) + r")(?![\w`-])")
    print("# Options\n\nMade by `scripts/options.py build/stickslip > docs/options.md` from what `stickslip COMMAND "
          "-help` prints.\nIn a scene nested maps join with `_`: `model: {gamma: 3}` is `-model_gamma 3`. Options of "
          "PETSc and SLEPc\n(`-ts_type`, `-ts_rtol`, `-eps_ncv`, ...) are taken as well.")
    for group, entries in groups.items():
        print(f"\n## {group}\n\n| option | default | takes | what it does | commands |\n|---|---|---|---|---|")
        for name, (default, takes, what) in entries.items():
            takes = takes if takes.startswith("one of") else letters(takes)  # words to type stay
            what = letters(name_of.sub(lambda option: f"`{option[0]}`" if "_" in option[0] else option[0], what))
            print("| " + " | ".join(cell.replace("|", "\\|") for cell in (f"`{name}`", default, takes, what, readers[name])) + " |")


def roff(text):
    text = text.replace("\\", "\\e").replace("-", "\\-")
    return "\\&" + text if text.startswith((".", "'")) else text


def man(program):
    groups, readers = of_all(program)
    head, usage, _, rest = said(program, "--help").split("\n\n", 3)
    print(f""".TH STICKSLIP 1 "" "{head.split(":")[0]}"
.SH NAME
stickslip \\- {roff(head.split(": ", 1)[1])}
.SH SYNOPSIS
.B stickslip
.I COMMAND
[\\fISCENE.yaml\\fR] [\\fIoptions\\fR]
.SH COMMANDS""")
    for line in said(program, "--help").split("commands:\n")[1].split("\n\n")[0].splitlines():
        name, what = line.split(maxsplit=1)
        print(f".TP\n.B {name}\n{roff(what)}")
    print(".SH DESCRIPTION\n" + roff(rest.strip()))
    for group, entries in groups.items():
        print(f".SH {roff(group.upper())}")
        for name, (default, takes, what) in entries.items():
            print(f".TP\n.B \\-{name}\n{roff(what or name)}\n.br\nTakes {roff(takes)}; default {roff(default or 'none')};"
                  f" read by {roff(readers[name])}.")
    print(".SH EXIT STATUS\n0 done; 1 the computation failed; 2 wrong use, found before any work; 130, 143 stopped by a "
          "signal.\n.SH SEE ALSO\nmpirun(1)")


if __name__ == "__main__":
    if sys.argv[1] == "--man":
        man(sys.argv[2])
    else:
        page(sys.argv[1])
