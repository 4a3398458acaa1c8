#!/usr/bin/env python3
"""Holds what README.md, docs/ and the comments of runs/ say against the commands that stand beside it.

    scripts/claims.py [PAGE ...]              the claims that take a moment (part of ./check)
    scripts/claims.py --long [PAGE ...]       all claims
    scripts/claims.py --made [PAGE ...]       makes pictures and tables again: pictures into docs/, tables are compared
    scripts/claims.py --commands [PAGE ...]   runs every command that a page prints, and every
                                              scene, pasted into a file, in a copy of the tree

A page is a path such as docs/waves.md or runs/study.yaml; without any, all of them. Exit code 1 where a claim fails.

In a page the commands stand in comments, `<!-- ... -->`; in a scene in lines that begin with `# check:`, of which the
scene is that of the command. There are three kinds:

    check: boundary -grid_n 64 ...; points[0].value = 0.966092; 0 < points[0].frequency < 1
    check long: ...
    made: COMMAND; COMMAND
    measured: COMMAND; MACHINE; DATE

`check` runs a command of the program. `KEY = NUMBER` says what the summary has, to the digits given (`~ 0.01`: within
that); the number must stand on the page as it stands here. Anything else is a condition. Keys are Python expressions.
`made` stands before a picture or a table that the commands draw or print; `measured` before seconds, which no check
repeats. In a block of the language `console` stand commands after `$ ` and what they print; it is run as a check that
takes a moment. There numbers agree to a hundredth (those below 1e-6 are round-off, counts may differ by one), words as
they stand, and a line `...` stands for what is left out.
"""
import argparse
import difflib
import glob
import json
import math
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from types import SimpleNamespace

SOURCE = os.environ.get("STICKSLIP_SOURCE", os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
PROGRAM = os.path.abspath(os.environ.get("STICKSLIP", os.path.join(SOURCE, "build", "stickslip")))
KNOWN = {name: getattr(math, name) for name in ("sqrt", "log", "pi")}
KNOWN |= {function.__name__: function for function in (abs, all, any, len, max, min, round, sorted, sum)}
COMMAND = re.compile(r"((build/)?stickslip|build/tests/\w+|mpirun|postprocess/\S+|scripts/\S+|(/usr/bin/)?python3|for \w+ in)(\s|$)")
MPI = {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1", "OMPI_MCA_rmaps_base_oversubscribe": "1"}
PLACE = re.compile(r"\b[A-Z]{4,}\b|\.\.\.|\[")  # a word that stands for another; no command to run as it is


def pages():
    found = ["README.md", *(page for files in ("docs/**/*.md", "runs/**/*.yaml")
                            for page in sorted(glob.glob(files, root_dir=SOURCE, recursive=True)))]
    return [page for page in found if page != "docs/options.md"]


class Page:
    """A page or a scene: what a reader sees, and the comments that say how it came about."""

    def __init__(self, name):
        with open(os.path.join(SOURCE, name), encoding="utf-8") as file:
            text = file.read()
        self.name, self.scene = name, name.endswith(".yaml")
        if self.scene:
            lines = [line[1:] for line in re.match(r"(#.*\n)*", text).group(0).splitlines()]
            text = "\n".join(line[1:] if line.startswith(" ") else line for line in lines)
            comment = r"^(check(?: long)?): (.*(?:\n  .*)*)"
        else:
            comment = r"<!-- (check|check long|made|measured): (.*?) ?-->"
        flags = re.MULTILINE if self.scene else re.DOTALL
        self.notes = [(kind, [" ".join(part.split()) for part in content.split(";")], end)
                      for kind, content, end in ((*match.groups(), match.end()) for match in re.finditer(comment, text, flags))]
        begun = re.findall(r"^check\b" if self.scene else r"<!-- (?!table: |end of table|datasets |keys |end -->)", text, re.MULTILINE)
        if len(begun) != len(self.notes):
            raise ValueError(f"{name}: a comment that is none of check, check long, made, measured")
        self.text = text
        self.shown = re.sub(comment if self.scene else r"<!--.*?-->", "", text, flags=flags)

    def shows(self, value):
        return re.search(rf"(?<![\d.]){re.escape(value)}(?!\d|\.\d)", self.shown)


def tree(folder):
    """A folder that looks like the source tree to the commands of a page, in which they may write."""
    for name in os.listdir(SOURCE):
        if name not in ("build", "results", "docs") and not name.startswith("."):
            os.symlink(os.path.join(SOURCE, name), os.path.join(folder, name))
    for name in ("build", "results", "docs"):
        os.mkdir(os.path.join(folder, name))
    os.symlink(PROGRAM, os.path.join(folder, "build", "stickslip"))
    tests = os.path.join(os.path.dirname(PROGRAM), "tests")
    if os.path.isdir(tests):
        os.symlink(tests, os.path.join(folder, "build", "tests"))
    return folder


def shell(command, folder):
    path = os.pathsep.join([os.path.dirname(PROGRAM), os.path.dirname(sys.executable), os.environ["PATH"]])
    return subprocess.run(command, shell=True, executable="/bin/bash", cwd=folder, capture_output=True, text=True,
                          env={**os.environ, **MPI, "PATH": path, "STICKSLIP": PROGRAM})


def sessions(page):
    """The commands of the page's blocks of the language console, each with the lines that it prints there."""
    for block in [] if page.scene else re.findall(r"^```console\n(.*?)^```", page.text, re.DOTALL | re.MULTILINE):
        for part in re.split(r"^\$ ", block, flags=re.MULTILINE)[1:]:
            command, *lines = part.splitlines()
            yield command, lines


NUMBER = r"(?<![\w.])-?\d+(?:\.\d+)?(?:e[+-]?\d+)?"


def same_number(shown, said):
    """To a hundredth, or what is round-off; counts from five on to one, since another compiler may take a step more."""
    return math.isclose(float(shown), float(said), rel_tol=0.01, abs_tol=1 if shown.isdigit() and int(shown) >= 5 else 1e-6)


def same_line(shown, said):
    """Words as they stand, numbers nearly."""
    return re.sub(NUMBER, "#", shown) == re.sub(NUMBER, "#", said) and all(
        map(same_number, re.findall(NUMBER, shown), re.findall(NUMBER, said)))


def printed(command, lines, folder):
    """Nothing, or what is wrong with what a block of the language console shows."""
    done = shell(command + " 2>&1", folder)
    said = done.stdout.splitlines()
    for number, line in enumerate(lines):
        if line == "...":
            return None
        if number >= len(said) or not same_line(line, said[number]):
            return f"{command}\n    prints {said[number:number + 1]}, not {line!r}"
    return f"{command}\n    prints more: {said[len(lines)]}" if len(said) > len(lines) else None


def agrees(claim, page, summary):
    """Nothing, or what is wrong."""
    key, equals, text = claim.rpartition(" = ")
    known = {"__builtins__": {}, **KNOWN, **vars(summary)}
    if not equals:
        return None if eval(claim, known) else f"not true: {claim}"
    text, _, within = text.partition(" ~ ")
    found = eval(key, known)
    number = re.fullmatch(r"[+-]?\d+(?:\.(\d*))?(?:[eE]([+-]?\d+))?", text)
    if not page.shows(text):
        return f"the page does not say {text}: {claim}"
    if not number or not isinstance(found, (int, float)):
        return None if str(found) == text else f"{key} is {found}, not {text}"
    unit = 10.0**(int(number[2] or 0) - len(number[1] or ""))
    allowed = float(within) if within else unit / 2 * (1 + 1e-6)
    return None if abs(found - float(text)) <= allowed else f"{key} is {found!r}, not {text}"


def check(page, long):
    """The claims of a page: yields what is wrong."""
    notes = [(parts[0], parts[1:]) for kind, parts, _ in page.notes if kind == "check" or long and kind == "check long"]
    blocks = list(sessions(page))
    if not notes and not blocks:
        return
    with tempfile.TemporaryDirectory() as folder:
        tree(folder)
        yield from filter(None, (printed(command, lines, folder) for command, lines in blocks))
        for command, claims in notes:
            name, *rest = shlex.split(command)
            scene = [page.name] if page.scene else []
            done = subprocess.run([PROGRAM, name, *scene, *rest, "-progress", "off", "-summary", "claims.json"], cwd=folder,
                                  capture_output=True, text=True)
            if done.returncode:
                yield f"{command}\n    exit code {done.returncode}: {done.stderr.strip()}"
                continue
            with open(os.path.join(folder, "claims.json"), encoding="utf-8") as file:
                summary = json.load(file, object_hook=lambda entry: SimpleNamespace(**entry))
            for claim in claims:
                wrong = agrees(claim, page, summary)
                if wrong:
                    yield f"{command}\n    {wrong}"


def make(page):
    """Pictures and tables of a page: yields what is wrong."""
    for kind, parts, end in page.notes:
        if kind != "made":
            continue
        following = page.text[end:].lstrip()
        picture = re.match(r"!\[[^]]*\]\((?:docs/|\.\./)?([\w-]+\.png)\)", following)
        with tempfile.TemporaryDirectory() as folder:
            done = shell("set -e; " + "; ".join(parts), tree(folder))
            if done.returncode:
                yield f"{'; '.join(parts)}\n    exit code {done.returncode}: {done.stderr.strip()[-2000:]}"
            elif picture:
                drawn = os.path.join(folder, "docs", picture[1])
                if os.path.exists(drawn):
                    shutil.copyfile(drawn, os.path.join(SOURCE, "docs", picture[1]))
                else:
                    yield f"{'; '.join(parts)}\n    does not draw docs/{picture[1]}"
            elif following.startswith("|") and done.stdout.strip() != (table := following.split("\n\n")[0].strip()):
                lines = difflib.unified_diff(table.splitlines(), done.stdout.strip().splitlines(), "page", "printed", n=0, lineterm="")
                yield "\n    ".join(["; ".join(parts), *lines])


def commands(page):
    """The commands that a page prints, in order: those of its blocks, with continued lines and loops joined."""
    shown = page.shown + "\n"
    blocks = re.findall(r"^ *```sh\n(.*?)```", shown, re.DOTALL | re.MULTILINE)
    blocks += [command for command, _ in sessions(page)]
    found = []
    for block in blocks:
        lines = iter(re.sub(r"\\\n\s*", " ", block).splitlines())
        for line in lines:
            line = line.strip()
            while re.match(r"for \w+ in ", line) and not line.endswith("done"):
                line += "\n" + next(lines).strip()
            line = re.sub(r"\s+#.*", "", line)
            if COMMAND.match(line) and not PLACE.search(line):
                found.append(line)
    return found


def scenes(page):
    """The blocks of YAML of a page."""
    return re.findall(r"^ *```yaml\n(.*?)^ *```", page.text, re.DOTALL | re.MULTILINE)


def command_of(scene):
    """What runs a block of YAML."""
    return "fit" if "fit:" in scene else "run"


def run_commands(page):
    with tempfile.TemporaryDirectory() as folder:
        tree(folder)
        pasted = []
        for number, scene in enumerate(scenes(page)):
            with open(os.path.join(folder, f"{number}.yaml"), "w", encoding="utf-8") as file:
                file.write(re.sub(r"(?<=data: )(?=[\w.-]+\.(?:txt|csv))", "runs/", scene))  # which lies beside the scenes
            pasted.append(f"stickslip {command_of(scene)} {number}.yaml")
        for command in commands(page) + pasted:
            done = shell(command, folder)
            print(f"{'ok' if done.returncode == 0 else 'failed'}: {page.name}: {command}", flush=True)
            if done.returncode:
                yield f"{command}\n    exit code {done.returncode}: {done.stderr.strip()[-2000:]}"


def main():
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("pages", nargs="*", metavar="PAGE")
    for name in ("long", "made", "commands"):
        parser.add_argument("--" + name, action="store_true")
    asked = parser.parse_args()
    failed = 0
    for page in map(Page, asked.pages or pages()):
        wrongs = make(page) if asked.made else run_commands(page) if asked.commands else check(page, asked.long)
        for wrong in wrongs:
            failed += 1
            print(f"{page.name}: {wrong}", flush=True)
    return bool(failed)


if __name__ == "__main__":
    sys.exit(main())
