"""The source: who may see whom, one meaning a name, one thread."""
import glob
import os
import re

import layers
from calls import SOURCE


def test_includes_point_down():
    assert layers.broken(SOURCE) == []


def classes(path):
    """Names of the classes that a file defines in namespaces that have a name, with these."""
    names, open_namespaces = [], []
    with open(path, encoding="utf-8") as file:
        for line in file:
            begins = re.match(r"(?:inline )?namespace ?([\w:]*) ?\{", line)
            if begins:
                open_namespaces.append(begins[1])
            elif re.match(r"\} *// namespace", line):
                open_namespaces.pop()
            defined = re.match(r"(?:struct|class|enum(?: class)?) (\w+)(?: final)? ?(?::(?!:)|\{)", line)
            if defined and "" not in open_namespaces:
                names.append("::".join([*open_namespaces, defined[1]]))
    return names


def test_one_class_a_name():
    """Of two classes with one name the linker takes the members of either: what is a file's own stands in a namespace
    without a name, or has a name of its own."""
    first = {}
    for path in sources():
        for name in classes(path):
            assert first.setdefault(name, path) == path, f"{name}: in {first[name]} and {path}"
    assert len(first) > 300


def sources():
    return [path for root in ("src", "include") for path in sorted(glob.glob(os.path.join(SOURCE, root, "**", "*.?pp"),
                                                                             recursive=True))]


def test_lines_of_at_most_110_columns():
    """As `.clang-format` says, which CONTRIBUTING.md names."""
    tests = glob.glob(os.path.join(SOURCE, "tests", "**", "*.?pp"), recursive=True)
    for path in [*sources(), *tests]:
        with open(path, encoding="utf-8") as file:
            wide = [number for number, line in enumerate(file, 1) if len(line.rstrip("\n")) > 110]
        assert not wide, f"{path}: lines {wide}"


def test_releases_of_catch2_are_met_in_one_place():
    for path in glob.glob(os.path.join(SOURCE, "tests", "**", "*.?pp"), recursive=True):
        with open(path, encoding="utf-8") as file:
            assert "<catch2/" not in file.read() or os.path.basename(path) == "catch.hpp", path


THREADS = re.compile(r"^\s*#\s*include\s*<(thread|future|mutex|shared_mutex|condition_variable|atomic|execution|omp\.h|pthread\.h)>"
                     r"|\bstd::(thread|async)\b|^\s*#\s*pragma\s+omp\b|\bpthread_\w+|-fopenmp|find_package\((Threads|OpenMP)"
                     r"|MPI_THREAD_(SERIALIZED|MULTIPLE)", re.MULTILINE)


def test_one_thread():
    """No thread is started and none is asked for: what a tool for threads would look for cannot be there."""
    paths = sources()
    assert len(paths) > 200  # found at all
    for path in [*paths, os.path.join(SOURCE, "CMakeLists.txt")]:
        with open(path, encoding="utf-8") as file:
            found = THREADS.search(file.read())
        assert not found, f"{path}: {found[0]}: say in docs/developers/promises.md how threads are tested"
