"""What `cmake --install` puts in place works from there: the program, a project that finds the library, man page,
completion; and the source as a part of another project."""
import glob
import json
import math
import os
import re
import shutil
import subprocess

import h5py
import numpy as np
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


OWN = os.path.join(SOURCE, "tests", "examples", "own", "program.cpp")
PROJECT = """cmake_minimum_required(VERSION 3.25)
project(user LANGUAGES CXX)
set(CMAKE_EXPORT_COMPILE_COMMANDS ON)
find_package(stickslip 0.2 REQUIRED)
add_executable(user user.cpp)
target_link_libraries(user stickslip::core)
add_executable(program "{own}")
target_link_libraries(program stickslip::laws)
add_library(headers OBJECT headers.cpp)
target_link_libraries(headers stickslip::laws)
"""


def said(*words, **settings):
    done = subprocess.run(words, capture_output=True, text=True, **settings)
    check(done.returncode == 0, f"{' '.join(words)}: {done.stdout[-1500:]}{done.stderr[-1500:]}")
    return done.stdout


ZSH = """
zmodload zsh/zpty
zpty shell zsh -f -i
zpty -w shell "PS1=; fpath=($1 \\$fpath); autoload -Uz compinit; compinit -u -D"
zpty -w shell "compadd() { builtin compadd -O found \\"\\$@\\"; print -rl -- \\${found/#/FOUND:}; }"
zpty -w shell "zle -C complete-word .complete-word _main_complete; bindkey '^I' complete-word"
zpty -n -w shell "$2"$'\\t'
integer quiet=0
repeat 1000; do  # until nothing has come for a while behind what was found (the first FOUND: is the echo of the line above)
  if zpty -r -t shell line; then all+=$line quiet=0; else sleep 0.02; quiet+=1; fi
  [[ $all == *FOUND:*FOUND:* ]] && ((quiet > 20)) && break
done
print -r -- $all
zpty -d shell
"""


@pytest.mark.skipif(not shutil.which("zsh"), reason="zsh is not installed")
@pytest.mark.parametrize("words, offered", [
    ("stickslip ", {"run", "boundary", "sweep"}), ("stickslip run -ts_ty", {"-ts_type"}), ("stickslip run -ts_type ", {"rk:5dp", "arkimex:4"}),
    ("stickslip boundary -boundary_parameter model_", {"model_v", "model_zeta"}), ("stickslip fit -fit_parameters friction_a,", {"model_k0"})])
def test_completion_of_zsh(words, offered):
    """In a real one, at a terminal of its own."""
    os.mkdir("functions")
    shutil.copy(os.path.join(SOURCE, "scripts", "completion.zsh"), "functions/_stickslip")
    os.mkdir("bin")
    os.symlink(PROGRAM, "bin/stickslip")
    done = subprocess.run(["zsh", "-f", "-c", ZSH, "zsh", os.path.abspath("functions"), words], capture_output=True, text=True, check=True,
                          env={**os.environ, "PATH": os.path.abspath("bin") + os.pathsep + os.environ["PATH"]}, timeout=60)
    found = set(re.findall(r"FOUND:(\S+)", done.stdout))
    check(offered <= found, f"{words!r}: {found or done.stdout}")


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
        COMP_WORDS=("$2" bou); COMP_CWORD=1; _stickslip; echo "${COMPREPLY[@]}"
        COMP_WORDS=("$2" boundary -boundary_parameter model_ze); COMP_CWORD=3; _stickslip; echo "${COMPREPLY[@]}"
        COMP_WORDS=("$2" fit -fit_parameters friction_a,friction_sl); COMP_CWORD=3; _stickslip; echo "${COMPREPLY[@]}"
        COMP_WORDS=("$2" sweep -sweep_parameter1 model_v); COMP_CWORD=3; _stickslip; echo "${COMPREPLY[@]}"
        COMP_WORDS=("$2" run -ts_type arkimex : 4); COMP_CWORD=5; _stickslip; echo "${COMPREPLY[@]}" """, "bash",
                 os.path.join(prefix, "share", "bash-completion", "completions", "stickslip"), program).split()
    check(words == ["-model_gamma", "chain", "boundary", "model_zeta", "friction_a,friction_slip_velocity", "model_v", "4"],
          f"completion: {words}")

    book = os.path.join(prefix, "share", "doc", "stickslip")
    dead = []
    for page in [os.path.join(book, "README.md"), *glob.glob(os.path.join(book, "docs", "**", "*.md"), recursive=True)]:
        with open(page, encoding="utf-8") as file:
            targets = re.findall(r"\]\(([^)\s#]+)[^)]*\)", re.sub(r"^```.*?^```$|^    .*?$", "", file.read(), flags=re.MULTILINE | re.DOTALL))
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
    include = os.path.join(prefix, "include")
    headers = sorted(os.path.relpath(path, include)
                     for path in glob.glob(os.path.join(include, "stickslip", "**", "*.hpp"), recursive=True)
                     if "/source/" not in path)
    for name, text in (("user.cpp", USER), ("CMakeLists.txt", PROJECT.format(own=OWN)),
                       ("headers.cpp", "".join(f'#include "{header}"\n' for header in [*headers, "commands/register_law.hpp"]))):
        with open(name, "w", encoding="utf-8") as file:
            file.write(text)
    # at -O1: what is computed is the same, and compiled in half the time
    said("cmake", "-G", "Ninja", "-S", ".", "-B", "own", f"-DCMAKE_PREFIX_PATH={prefix}", "-DCMAKE_BUILD_TYPE=None",
         "-DCMAKE_CXX_FLAGS=-O1")
    check_headers(prefix)
    said("cmake", "--build", "own")
    check(said(os.path.join("own", "user")) == "2.68955\n", "a program of one's own: the train of the README")
    check_own_program(os.path.abspath(os.path.join("own", "program")))


def check_headers(prefix):
    """Those installed include each other, the standard library, MPI and PETSc, and nothing else is on the path of who
    compiles them."""
    others = set()
    for path in glob.glob(os.path.join(prefix, "include", "**", "*.hpp"), recursive=True):
        with open(path, encoding="utf-8") as file:
            others |= set(re.findall(r"#include <(.*)>", file.read()))
    foreign = sorted(name for name in others if not re.fullmatch(r"[a-z_0-9]+|petsc[a-z]+\.h|mpi\.h", name))
    check(not foreign, f"an installed header asks for {foreign}")
    check({"vector", "petscvec.h"} <= others, f"{others}")
    with open(os.path.join("own", "compile_commands.json"), encoding="utf-8") as file:
        command = next(entry["command"] for entry in json.load(file) if entry["file"].endswith("headers.cpp"))
    folders = re.findall(r"(?:-I|-isystem) ?(\".*?\"|\S+)", command.replace("\\ ", "\0"))
    known = ("moved elsewhere", "petsc", os.sep + "openmpi" + os.sep + "include", "mpich")
    strange = [folder for folder in folders if not any(word in folder.replace("\0", " ") for word in known)]
    check(len(folders) > 2 and not strange, f"folders of headers: {folders}")


def summary_of(program, words):
    return json.loads(said(program, *words.split(), "-progress", "off", "-summary", "-"))


# Scenes of the cubic law in all commands that know laws, and keys that must be the same with the one that was registered.
RING = "-grid_n 32 -grid_length 20"
BLOCK = "-model_form chain -grid_n 1 -bc_left free"
SCENES = [
    (f"run {RING} -init_type sine -ts_max_time 3", "steps psi_min psi_max eta_mean rhs_evaluations"),
    (f"run {RING} -init_type sine -ts_max_time 3 -ts_type arkimex -imex_implicit friction", "steps psi_min psi_max eta_mean"),
    (f"run {RING} -init_type sine -ts_max_time 3 -ts_type arkimex -imex_implicit both", "steps psi_min psi_max eta_mean"),
    (f"run {RING} -init_type sine -ts_max_time 3 -ts_type arkimex -imex_implicit friction", "steps psi_min psi_max eta_mean"),
    (f"run {RING} -init_type sine -ts_max_time 3 -friction_spread 0.2 -friction_spread_kind uniform", "steps psi_min psi_max"),
    (f"spectrum {RING} -model_v 0.95", "growth_rate frequency"),
    (f"boundary {RING} -boundary_parameter model_v -boundary_from 0.5 -boundary_to 1.5 -boundary_of sliding", "points"),
    (f"cycle {BLOCK} -model_v 0.3", "period psi_max psi_min multipliers"),
    ("wave -model_delta 0 -model_v 0.5 -wave_speed 2", "length psi_max")]


def close(a, b):
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(close(a[key], b[key]) for key in a)
    if isinstance(a, list):
        return len(a) == len(b) and all(close(*pair) for pair in zip(a, b))
    return a == pytest.approx(b, rel=1e-7, abs=1e-9) if isinstance(a, float) else a == b


def check_own_program(program):
    """Its law is the cubic without what that has in closed form: loops have the same bits, searches their tolerance."""
    for scene, keys in SCENES:
        built_in, own = (summary_of(program, f"{scene} -friction_law {law}") for law in ("cubic", "my-cubic"))
        for key in keys.split():
            exact = scene.startswith("run")
            check(built_in[key] == own[key] if exact else close(built_in[key], own[key]),
                  f"{scene}: {key} {built_in[key]}, of one's own {own[key]}")
    # its parameter: twice the law is friction with twice the amplitude
    twice = [summary_of(program, f"spectrum {BLOCK} -model_v 0.4 {words}")["growth_rate"]
             for words in ("-friction_law my-cubic -friction_scale 2", "-model_m 0.5 -model_f0 1 -model_k0 0.1")]
    exact = (1.68 + math.sqrt(1.68**2 - 4 * 0.2)) / 2  # of lambda^2 + 2 phi' lambda + k0 = 0
    check(twice == pytest.approx([exact, exact], rel=1e-9), f"scale: {twice}")
    laws = summary_of(program, "laws -laws_points 5")
    check(laws["my-cubic"] == pytest.approx(laws["cubic"], rel=1e-15), "laws")
    check("my-cubic: multiplies it" in said(program, "run", "-help"), "help")
    refused = subprocess.run([program, "run", "-friction_law", "cubic", "-friction_scale", "2"], capture_output=True, text=True)
    check(refused.returncode == 2 and "friction_scale" in refused.stderr, refused.stderr)
    # Heun's method is PETSc's 2a
    steps = f"run {RING} -init_type sine -ts_max_time 2 -ts_dt 0.02 -ts_adapt_type none -out_probes 3.3"
    heun, known = (summary_of(program, f"{steps} {words}") for words in ("-ts_type heun", "-ts_type rk -ts_rk_type 2a"))
    check(heun["method"] == "heun" and heun["steps"] == known["steps"] == 100, f"{heun['method']}, {heun['steps']} steps")
    check(close(heun["probes"], known["probes"]), f"{heun['probes']}, {known['probes']}")
    rows = summary_of(program, f"chart {RING} -init_type sine -ts_max_time 0.5 -chart_methods heun -chart_steps 0.02,0.01 "
                               "-chart_orders 4 -chart_grids 32 -chart_repeats 1")["rows"]
    check([row["method"] for row in rows] == ["heun", "heun"] and 3.5 < rows[0]["error"] / rows[1]["error"] < 4.5, f"{rows}")


    # Kutta's method has order 3; the largest velocity is that of the program's own series
    scene = f"run {RING} -init_type sine -ts_max_time 0.5 -out_probes 3.3 "
    exact, *found = (summary_of(program, scene + words)["probes"][0]["psi"] for words in (
        "-ts_type rk:8vr -ts_rtol 1e-12 -ts_atol 1e-13", *(f"-ts_type rk:kutta3 -ts_adapt_type none -ts_dt {dt}" for dt in (0.01, 0.005))))
    coarse, fine = (abs(psi - exact) for psi in found)
    check(6.5 < coarse / fine < 9.5, f"kutta3: errors {coarse}, {fine}")
    measured = summary_of(program, f"run {RING} -init_type sine -ts_max_time 3 -ts_type rk:kutta3 -out_file own.h5")
    with h5py.File("own.h5") as file:
        own, series = file["fastest/psi"][:], file["series"]
        both = np.maximum(np.abs(series["psi_min"][:]), np.abs(series["psi_max"][:]))
        check(len(own) == measured["steps"] + 1 and np.array_equal(own, both) and file["fastest/psi"].attrs["units"] == "length/time",
              "a series of one's own")
    check(measured["fastest"] == own.max() and measured["method"] == "rk:kutta3", f"{measured['fastest']} {own.max()}")


def test_a_petsc_that_does_not_fit():
    """One line at configuration says what it is; its settings are read, nothing is compiled."""
    for part in ("lib/pkgconfig", "include"):
        os.makedirs(part)
    with open("CMakeLists.txt", "w", encoding="utf-8") as file:
        file.write("cmake_minimum_required(VERSION 3.25)\nproject(x NONE)\n"
                   'macro(enable_language)\n  message(FATAL_ERROR "taken")\nendmacro()\n'
                   f'include("{SOURCE}/cmake/stickslipLibraries.cmake")\n')

    def refused(petsc, slepc, setting, folder="."):
        for name, version in (("PETSc", petsc), ("SLEPc", slepc)):
            with open(f"lib/pkgconfig/{name}.pc", "w", encoding="utf-8") as file:
                file.write(f"prefix={os.getcwd()}\nName: {name}\nDescription: none\nVersion: {version}\n"
                           f"Cflags: -I{os.getcwd()}/include\nLibs:\n")
        with open("include/petscconf.h", "w", encoding="utf-8") as file:
            file.write(f"#define PETSC_HAVE_X 1\n#define PETSC_{setting} 1\n")
        shutil.rmtree("built", ignore_errors=True)
        done = subprocess.run(["cmake", "-G", "Ninja", "-S", ".", "-B", "built"], capture_output=True, text=True, check=False,
                              env={**os.environ, "PETSC_DIR": os.path.abspath(folder), "PETSC_ARCH": "", "SLEPC_DIR": ""})
        check(done.returncode != 0, "refused")
        return " ".join(done.stderr.split())

    for petsc, slepc, setting, said_of_it in (
            ("3.22.5", "3.22.2", "USE_COMPLEX", "has complex scalars; one configured --with-scalar-type=real is needed"),
            ("3.25.5", "3.25.1", "USE_REAL_SINGLE", "has another precision; one configured --with-precision=double"),
            ("3.20.0", "3.20.0", "USE_REAL___FLOAT128", "has another precision"), ("3.20.0", "3.20.0", "HAVE_MPIUNI", "has no MPI"),
            ("3.23.0", "3.23.0", "HAVE_64BIT_BLAS_INDICES", "has a BLAS of 64-bit integers; one configured with one of 32 bits"),
            ("3.17.4", "3.17.2", "USE_REAL_DOUBLE", "is too old: from 3.18 on"),
            ("3.24.0", "3.23.1", "USE_REAL_DOUBLE", "there is no SLEPc of the release of PETSc 3.24.0")):
        text = refused(petsc, slepc, setting)
        check(said_of_it in text and f"PETSc {petsc} in {os.getcwd()}" in text, f"{setting}: {text}")
    text = refused("3.22.5", "3.22.2", "USE_REAL_DOUBLE", "nowhere")
    check("there is no PETSc in PETSC_DIR=" in text and "nowhere" in text, text)
    for setting in ("USE_64BIT_INDICES", "USE_REAL_DOUBLE"):
        text = refused("3.22.5", "3.22.2", setting)
        check("taken" in text and "stickslip:" not in text, f"{setting}: {text}")


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
