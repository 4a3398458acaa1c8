#!/usr/bin/env bash
# Makes bare Debian systems, runs ./demo and ./check in each as typed, and prints the table of docs/install.md, a row for each.
# usage: scripts/systems.sh SUITE ...     bookworm, trixie, sid, ... from the Debian source of this machine; as root
#   SYSTEMS [results/systems]   the folder of the systems and of what they said (SUITE.log); one that is there is gone on with
#   CCACHE   a folder: what each suite's compiler made is kept there by ccache, and taken from there
# What is checked is the revision that is committed. Needs debootstrap, 3 GB and half an hour of two idle processors a system.
set -eu
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
(($#)) || { sed -n 's/^# //; 2,6p' "$0" >&2; exit 2; }
(($(id -u) == 0)) || { echo "error: a system is made by root alone" >&2; exit 2; }
command -v debootstrap >/dev/null || { echo "error: debootstrap is needed (a package of that name)" >&2; exit 2; }
folder=${SYSTEMS:-$root/results/systems}
mkdir -p "$folder"
folder=$(cd "$folder" && pwd)
source=$(sed -n 's/^URIs: *//p; s/^deb \(\[[^]]*\] \)\?\([^ ]*\) .*/\2/p' /etc/apt/sources.list.d/debian.sources /etc/apt/sources.list \
         2>/dev/null | head -n 1)
source=${source:-http://deb.debian.org/debian}

mounted=() through=()
leave() {  # what was mounted goes, whatever ends this
  local one
  for ((one = ${#mounted[@]} - 1; one >= 0; --one)); do umount "${mounted[one]}" || true; done
  mounted=()
}
trap leave EXIT
trap 'exit 130' INT TERM

# Makes the system of the suite $1 where it is not there yet, as this machine reaches its Debian source. Its status is
# asked for, so that errors do not end it by themselves.
make_system() {
  local system=$folder/$1
  if ! [ -e "$system/made" ]; then
    debootstrap --variant=minbase "$1" "$system" "$source" || return 1
    cp /etc/apt/apt.conf.d/*proxy* "$system/etc/apt/apt.conf.d/" 2>/dev/null
    echo 'Acquire::Check-Valid-Until "false";' > "$system/etc/apt/apt.conf.d/99copy"  # of a copy that is not of today
    touch "$system/made"
  fi
  cp /etc/resolv.conf /etc/hosts "$system/etc/"
  mkdir -p "$system/dev/shm"
  put proc -t proc && put sys -t sysfs && put dev/pts -t devpts && put dev/shm -t tmpfs || return 1
  if [ -n "${CCACHE-}" ]; then
    inside "$system" bash -c "command -v ccache || { apt-get -q update && apt-get -q -y install --no-install-recommends ccache; }" ||
      return 1
    mkdir -p "$CCACHE/$1" "$system/ccache"
    put ccache --bind "$CCACHE/$1" || return 1
    through=(CMAKE_CXX_COMPILER_LAUNCHER=ccache CCACHE_DIR=/ccache
             CCACHE_SLOPPINESS=pch_defines,time_macros,include_file_mtime,include_file_ctime)
  fi
  rm -rf "$system/root/stickslip"
  git clone -q "$root" "$system/root/stickslip"
}

# Mounts at $1 of `system`; Open MPI speaks on stderr where there is no /sys.
put() {
  local at=$system/$1
  shift
  [ "$1" = --bind ] || set -- "$@" none
  mount "$@" "$at" && mounted+=("$at")
}

inside() {
  local system=$1
  shift
  chroot "$system" env -i HOME=/root PATH=/usr/sbin:/usr/bin:/sbin:/bin http_proxy="${http_proxy-}" \
    https_proxy="${https_proxy-}" "${through[@]}" "$@" </dev/null
}

version() { inside "$1" dpkg-query -W -f '${source:Upstream-Version}' "$2" 2>/dev/null | sed 's/[+~].*//'; }

# The row of the suite $1.
row() {
  local system=$folder/$1 log=$folder/$1.log start=$SECONDS demo check built
  inside "$system" bash -c "cd /root/stickslip && ./demo" >"$log" 2>&1 && demo=works || demo="exit code $?"
  built=$(((SECONDS - start + 30) / 60))
  inside "$system" bash -c "cd /root/stickslip && ./check" >>"$log" 2>&1 || true
  check=$(tail -n 1 "$log")
  [[ $check == *passed* ]] || check="no count (see the log)"
  echo "| $1 | GCC $(inside "$system" g++ -dumpfullversion), CMake $(version "$system" cmake), PETSc $(version "$system" libpetsc-real-dev)," \
    "SLEPc $(version "$system" libslepc-real-dev), Open MPI $(version "$system" libopenmpi-dev), HDF5" \
    "$(version "$system" libhdf5-openmpi-dev), Eigen $(version "$system" libeigen3-dev), Catch2 $(version "$system" catch2)," \
    "numpy $(version "$system" python3-numpy), matplotlib $(version "$system" python3-matplotlib)" \
    "| $demo, $built min | $check, $(((SECONDS - start + 30) / 60 - built)) min |"
}

for suite in "$@"; do
  make_system "$suite" >"$folder/$suite-made.log" 2>&1 || { cat "$folder/$suite-made.log" >&2; exit 1; }
done
echo "| system | GCC, CMake, libraries | \`./demo\` | \`./check\` |"
echo "|---|---|---|---|"
for suite in "$@"; do row "$suite"; done
