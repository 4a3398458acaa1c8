"""What `cmake --install` puts in place works from there: the program, a project that finds the library, man page,
completion; and the source as a part of another project."""
import glob
import os
import re
import subprocess

import pytest

from calls import PROGRAM, SANITIZED, SOURCE, check

BUILD = os.path.dirname(PROGRAM)
USER = """#include <petscsys.h>

#include <cstdio>

#include "stickslip/model/scene.hpp"
#include "stickslip/waves/train.hpp"

int main(int argc, char** argv) {
  PetscFunctionBeginUser;
  PetscCall(PetscInitialize(&argc, &argv, nullptr, nullptr));
  stickslip::Scene scene;
  scene.delta = 0;
  scene.v = 0.5;
  const stickslip::Train train = stickslip::solve_train(scene, {4, 100., {}});
  std::printf("%.5f\\n", train.speed);
  PetscCall(PetscFinalize());
  return 0;
}
"""


def said(*words, **settings):
    done = subprocess.run(words, capture_output=True, text=True, **settings)
    check(done.returncode == 0, f"{' '.join(words)}: {done.stdout[-1500:]}{done.stderr[-1500:]}")
    return done.stdout


@pytest.mark.skipif(SANITIZED, reason="a program of others is not built with the sanitizers")
def test_installed():
    prefix = os.path.abspath("prefix")
    said("cmake", "--install", BUILD, "--prefix", prefix)
    program = os.path.join(prefix, "bin", "stickslip")
    check(said(program, "--version") == said(PROGRAM, "--version"), "the program")
    scene = os.path.join(prefix, "share", "stickslip", "runs", "ring.yaml")
    said(program, "run", scene, "-grid_n", "64", "-ts_max_time", "1", "-out_file", "a.h5")
    said("/usr/bin/python3", "-B", os.path.join(prefix, "bin", "stickslip-plot"), "a.h5")
    check(os.path.exists("a.png"), "a picture")
    check(os.path.exists(os.path.join(prefix, "share", "man", "man1", "stickslip.1")), "man page")
    words = said("bash", "-c", """source "$1"; COMP_WORDS=("$2" run -model_g); COMP_CWORD=2; _stickslip
        echo "${COMPREPLY[@]}"; COMP_WORDS=("$2" run -model_form ch); COMP_CWORD=3; _stickslip; echo "${COMPREPLY[@]}"
        COMP_WORDS=("$2" bou); COMP_CWORD=1; _stickslip; echo "${COMPREPLY[@]}" """, "bash",
                 os.path.join(prefix, "share", "bash-completion", "completions", "stickslip"), program).split()
    check(words == ["-model_gamma", "chain", "boundary"], f"completion: {words}")

    book = os.path.join(prefix, "share", "doc", "stickslip")
    dead = []
    for page in [os.path.join(book, "README.md"), *glob.glob(os.path.join(book, "docs", "**", "*.md"), recursive=True)]:
        with open(page, encoding="utf-8") as file:
            targets = re.findall(r"\]\(([^)\s#]+)[^)]*\)", re.sub(r"^(    |```).*$", "", file.read(), flags=re.MULTILINE))
        dead += [f"{page}: {target}" for target in targets
                 if not re.match("https?:", target) and not os.path.exists(os.path.join(os.path.dirname(page), target))]
    check(not dead, f"dead links: {dead}")
    # the package moved, for a project of C++ alone
    os.rename(prefix, "moved elsewhere")
    prefix = os.path.abspath("moved elsewhere")
    for path in glob.glob(os.path.join(prefix, "lib", "**", "*.cmake"), recursive=True):
        with open(path, encoding="utf-8") as file:
            said_there = file.read()
        check(not any(word in said_there for word in (SOURCE, "/usr/lib", "/usr/include", os.path.abspath("."))), f"an absolute path in {path}")
    with open("user.cpp", "w", encoding="utf-8") as file:
        file.write(USER)
    with open("CMakeLists.txt", "w", encoding="utf-8") as file:
        file.write("cmake_minimum_required(VERSION 3.25)\nproject(user LANGUAGES CXX)\nfind_package(stickslip 0.2 REQUIRED)\n"
                   "add_executable(user user.cpp)\ntarget_link_libraries(user stickslip::core)\n")
    said("cmake", "-G", "Ninja", "-S", ".", "-B", "own", f"-DCMAKE_PREFIX_PATH={prefix}")
    said("cmake", "--build", "own")
    check(said(os.path.join("own", "user")) == "2.68955\n", "a program of one's own: the train of the README")


def test_part_of_another_project():
    with open("CMakeLists.txt", "w", encoding="utf-8") as file:
        file.write("cmake_minimum_required(VERSION 3.25)\nproject(outer LANGUAGES C CXX)\n"
                   f'add_subdirectory("{SOURCE}" inner)\nadd_executable(outer outer.cpp)\n'
                   "target_link_libraries(outer stickslip::core)\n")
    with open("outer.cpp", "w", encoding="utf-8") as file:
        file.write("int main() {}\n")
    said("cmake", "-G", "Ninja", "-S", ".", "-B", "own")
    files = glob.glob("own/**/CTestTestfile.cmake", recursive=True)
    check(not files, f"the tests stay out: {files}")
