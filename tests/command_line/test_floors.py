"""The source: who may see whom, and that it has one thread."""
import glob
import os
import re

import floors
from calls import SOURCE


def test_includes_point_down():
    assert floors.broken(SOURCE) == []


THREADS = re.compile(r"^\s*#\s*include\s*<(thread|future|mutex|shared_mutex|condition_variable|atomic|execution|omp\.h|pthread\.h)>"
                     r"|\bstd::(thread|async)\b|^\s*#\s*pragma\s+omp\b|\bpthread_\w+|-fopenmp|find_package\((Threads|OpenMP)"
                     r"|MPI_THREAD_(SERIALIZED|MULTIPLE)", re.MULTILINE)


def test_one_thread():
    """No thread is started and none is asked for: what a tool for threads would look for cannot be there."""
    paths = [path for root in ("src", "include") for path in glob.glob(os.path.join(SOURCE, root, "**", "*.?pp"), recursive=True)]
    assert len(paths) > 300
    for path in [*paths, os.path.join(SOURCE, "CMakeLists.txt")]:
        with open(path, encoding="utf-8") as file:
            found = THREADS.search(file.read())
        assert not found, f"{path}: {found[0]}: say in docs/promises.md how threads are tested"
