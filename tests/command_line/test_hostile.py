"""Files from elsewhere that mean harm: HDF5 that is huge, or leads out of the file, YAML and columns that grow or never
end. One line of error, exit code 2, bounded memory, and no file is opened but the one named."""
import os
import struct

import h5py
import numpy as np
import pytest

from calls import PROGRAM, SANITIZED, check, checkpoint_block, errors, run
from served import Server

MEMORY = 600 << 20  # bytes beyond a program that waits: what docs/files.md says, and what a start takes
START = "run -grid_n 16 -ts_max_time 0.1 -init_type file -init_file bad.h5 -out_file out.h5"


@pytest.fixture(scope="module")
def server():
    server = Server(PROGRAM, 20, 600, None if SANITIZED else MEMORY)
    yield server
    server.close()


def refuse(server, words, *parts):
    before = sorted(os.listdir("."))
    code, _ = server.run(words, os.getcwd(), os.path.abspath("../out"), os.path.abspath("../err"))
    with open("../err", encoding="utf-8") as file:
        said = file.read()
    lines = errors(said)
    check(code == 2 and len(lines) == 1 and len(said.splitlines()) == 1 and all(part in lines[0] for part in parts),
          f"exit {code}, not one line with {parts}: {said[-600:]}")
    check(sorted(os.listdir(".")) == before, f"files were made: {os.listdir('.')}")


def fields(file, skip=""):
    """What is right about a file of others but for one dataset."""
    for name, values in (("x", np.linspace(0, 60, 9)), ("psi", np.full(9, 0.1)), ("eta", np.zeros(9))):
        if name != skip:
            file[name] = values


def huge(file):
    fields(file, "x")
    file.create_dataset("x", (1 << 40,), "f4", chunks=(1 << 10,))


def wide(file):
    for name in ("x", "psi", "eta"):
        file.create_dataset(name, (1 << 27,), "f4", chunks=(1 << 16,), compression="gzip")


def many(file):  # each of them may be, all of them may not
    fields(file, "x")
    for name in ("x", *(f"field{k}" for k in range(40))):
        file.create_dataset(name, (1 << 23,), "f4", chunks=(1 << 16,), compression="gzip")


def one_chunk(file):
    fields(file, "psi")
    file.create_dataset("psi", (1, 9), "f4", maxshape=(None, None), chunks=(1, 1 << 28))


def outside(file):
    fields(file, "psi")
    file["psi"] = h5py.ExternalLink("other.h5", "/psi")


def outside_x(file):
    fields(file, "x")
    file["x"] = h5py.ExternalLink("other.h5", "/x")


def soft(file):
    fields(file, "psi")
    file["psi"], file["other"] = h5py.SoftLink("/other"), h5py.SoftLink("/psi")


def stored_elsewhere(file):
    fields(file, "psi")
    file.create_dataset("psi", (9,), "f8", external=[("secret", 0, 72)])


def virtual(file):
    fields(file, "psi")
    layout = h5py.VirtualLayout((9,), "f8")
    layout[:] = h5py.VirtualSource("other.h5", "psi", (9,))
    file.create_virtual_dataset("psi", layout)


def unknown_filter(file):
    fields(file, "psi")
    plist = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    plist.set_chunk((9,))
    plist.set_deflate(1)
    made = h5py.h5d.create(file.id, b"psi", h5py.h5t.NATIVE_DOUBLE, h5py.h5s.create_simple((9,)), plist)
    made.write(h5py.h5s.ALL, h5py.h5s.ALL, np.full(9, 0.1))


def newline(file):
    fields(file, "psi")
    file["psi\nstickslip: error: all is well"] = np.zeros(9)


def text(file):
    fields(file, "psi")
    file["psi"] = ["text"] * 9


def compound(file):
    fields(file, "psi")
    file["psi"] = np.zeros(9, dtype=[("a", "f8"), ("b", "i4")])


def group(file):
    fields(file, "psi")
    file.create_group("psi/psi")


def no_text(file):
    fields(file)
    file.attrs["program"] = np.arange(1000)


def not_finite(file):
    fields(file, "psi")
    file["psi"] = np.full(9, np.nan)


@pytest.mark.parametrize("make, parts", [
    (huge, ["larger than the file"]), (wide, ["larger than the file"]), (many, ["larger than the file"]),
    (one_chunk, ["chunks of more than 64 MB"]), (outside, ["'psi' is a link to elsewhere"]),
    (outside_x, ["'x' is a link to elsewhere"]), (soft, ["'psi' is a link to elsewhere"]),
    (stored_elsewhere, ["in other files"]), (virtual, ["in other files"]), (unknown_filter, ["filter"]),
    (newline, ["psi"]), (text, ["does not hold numbers"]), (compound, ["does not hold numbers"]), (group, ["psi"]),
    (no_text, ["program"]), (not_finite, ["psi"])])
def test_starts(server, make, parts):
    with h5py.File("other.h5", "w") as file:
        fields(file)
    with open("secret", "wb") as file:
        file.write(np.full(9, 0.1).tobytes())
    with h5py.File("bad.h5", "w") as file:
        make(file)
    if make is unknown_filter:  # no filter has this number
        with open("bad.h5", "rb+") as file:
            file.seek(file.read().index(b"deflate") - 8)
            file.write(struct.pack("<H", 32123))
    refuse(server, START.split(), "init_file", "bad.h5", *parts)
    for name in ("other.h5", "secret"):  # whoever opens these waits for ever
        os.remove(name)
        os.mkfifo(name)
    refuse(server, START.split(), "init_file", "bad.h5", *parts)


def in_checkpoint(change):
    """A checkpoint whose content was changed and whose checksum fits."""
    if not os.path.exists("../sound.h5"):
        run("-grid_n 16 -ts_max_time 0.2 -ts_max_steps 2 -out_file sound.h5 -out_checkpoint_every 1 "
            "-out_checkpoint_keep 1")
        name = next(name for name in os.listdir(".") if ".chk-" in name)
        os.rename(name, "../sound.h5")
        os.remove("sound.h5")
    with open("../sound.h5", "rb") as file:
        block = file.read()
    with open("bad.h5", "wb") as file:
        file.write(block)
    with h5py.File("bad.h5", "r+") as file:
        change(file)
    with open("bad.h5", "rb+") as file:
        content = file.read()[512:]
        file.seek(0)
        file.write(checkpoint_block(content))


def instead(path, what):
    def change(file):
        del file[path]
        file[path] = what
    return change


def test_checkpoints(server):
    for change, part in [(instead("fields", h5py.ExternalLink("other.h5", "/")), "link to elsewhere"),
                         (instead("arrays", h5py.SoftLink("/fields")), "link to elsewhere"),
                         (instead("numbers", h5py.ExternalLink("other.h5", "/")), "link to elsewhere"),
                         (instead("fields/u", h5py.ExternalLink("other.h5", "/psi")), "")]:
        with h5py.File("other.h5", "w") as file:
            fields(file)
        try:
            in_checkpoint(change)
        except KeyError:
            continue
        os.remove("other.h5")
        os.mkfifo("other.h5")
        refuse(server, ["run", "-restart", "bad.h5"], "restart", "bad.h5", part)
        os.remove("other.h5")


@pytest.mark.parametrize("scene, parts", [
    (b"a: &a [x,x]\nb: &b [*a,*a]\nc: [*b,*b]\n", ["anchors"]),
    (b"model_gamma: " + b"[" * 500000, []), (b"{" * 500000, []), (b"model: {" * 100000, []),
    (b"- " * 400000, ["list"]), (b"? " * 400000, []),
    (b"model_gamma: " + b"1" * 1000000, ["model_gamma"]), (b'"model_gamma\\nb": 1\n', []), (b"a" * (1 << 21), ["too many"]),
    (b"".join(b"a%d: 1\n" % k for k in range(9000)), ["a0"]), (b"model_gamma: !!python/object:os.system 1\n", ["tags"]),
    (b"<<: {model_gamma: 3}\n", []), (b"%YAML 1.1\n---\nmodel_gamma: 3\n", ["directives"])],
                         ids=lambda value: "" if isinstance(value, list) else value[:12].decode().split("\n")[0])
def test_scenes(server, scene, parts):
    with open("bad.yaml", "wb") as file:
        file.write(scene)
    refuse(server, ["run", "bad.yaml"], "bad.yaml", *parts)


def test_columns(server):
    with open("bad.txt", "wb") as file:
        file.write(b"0 0.1 0\n" + b"1" * 3000000)
    text_start = "run -grid_n 16 -init_type text -init_file".split()
    refuse(server, [*text_start, "bad.txt"], "bad.txt", "65535 bytes")
    refuse(server, [*text_start, "/dev/zero"], "/dev/zero", "65535 bytes")
    refuse(server, [*text_start, "."], "init_file")
    refuse(server, ["run", "-load_v", "/dev/zero"], "/dev/zero")
    with open("bad.txt", "wb") as file:
        file.write(b"0\t0.1 0\x00\n1 2 3\n")
    refuse(server, [*text_start, "bad.txt"], "bad.txt")
