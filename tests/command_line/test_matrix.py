"""What docs/matrix.md says of scenes and commands is what the program does, cells by draw."""
import os
import subprocess

from calls import PROGRAM, SOURCE


def test_cells_of_the_page():
    done = subprocess.run(["/usr/bin/python3", "-B", os.path.join(SOURCE, "scripts", "matrix.py"), PROGRAM, "--check", "16",
                           "--seed", "71"], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
