"""How far a command of many cases is, in a file: so that it can be interrupted and gone on with."""
import hashlib
import json
import os
import subprocess
import time

from calls import PROGRAM


class Kept:
    """`now` is what the file holds: the program (of which it must stay the same), its revision, seconds so far, and what
    the command adds. `same`: names of what else must not have changed. Without a path nothing is kept."""

    def __init__(self, path, same=(), programs=(PROGRAM,), **begun):
        self.path, self.begin = path and os.path.abspath(path), time.monotonic()
        digest = hashlib.sha256()
        for program in programs:
            with open(program, "rb") as file:
                digest.update(file.read())
        version = subprocess.run([PROGRAM, "--version"], stdout=subprocess.PIPE, check=True).stdout.decode()
        self.now = {"program": digest.hexdigest()[:16], "git": version.split("git ")[1].split()[0], "seconds": 0.0, **begun}
        if not self.path or not os.path.exists(self.path):
            return
        with open(self.path, encoding="utf-8") as file:
            before = json.load(file)
        for key in ("program", *same):
            if before[key] != self.now[key]:
                raise SystemExit(f"{path}: of another {key} ({before[key]}, now {self.now[key]}); remove it to begin anew")
        self.now = before

    def save(self):
        now = time.monotonic()
        self.now["seconds"] += now - self.begin
        self.begin = now
        if self.path:
            with open(self.path + ".new", "w", encoding="utf-8") as file:
                json.dump(self.now, file, indent=1)
            os.replace(self.path + ".new", self.path)
