"""Prints docs/options.md, made from what the program says of itself: `stickslip COMMAND -help` for every command.

usage: scripts/options.py build/stickslip > docs/options.md
"""
import re
import subprocess
import sys


def said(program, *words):
    return subprocess.run([program, *words], check=True, capture_output=True, text=True).stdout


def commands(program):
    text = said(program, "--help").split("commands:\n")[1].split("\n\n")[0]
    return [line.split()[0] for line in text.splitlines()]


def options(program, command):
    """(group, name, default, values, description) of each option of a command, in its order."""
    group = None
    lines = said(program, command, "-help").split("\n\n", 3)[3].splitlines()
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


def main(program):
    groups, readers = {}, {}
    names = commands(program)
    for command in names:
        for group, name, *entry in options(program, command):
            groups.setdefault(group, {})[name] = entry
            readers.setdefault(name, []).append(command)
    print("# Options\n\nMade by `scripts/options.py build/stickslip > docs/options.md` from what `stickslip COMMAND "
          "-help` prints.\nIn a scene nested maps join with `_`: `model: {gamma: 3}` is `-model_gamma 3`. Options of "
          "PETSc and SLEPc\n(`-ts_type`, `-ts_rtol`, `-eps_nev`, ...) are taken as well.")
    for group, entries in groups.items():
        print(f"\n## {group}\n\n| option | default | takes | what it does | commands |\n|---|---|---|---|---|")
        for name, entry in entries.items():
            by = "all" if readers[name] == names else " ".join(readers[name])
            print("| " + " | ".join(cell.replace("|", "\\|") for cell in
                                    (f"`{name}`", *entry, by)) + " |")


if __name__ == "__main__":
    main(sys.argv[1])
