# Sourced by ./demo and ./check: installs what is missing and sets the environment. `root` is the source tree.
# What the packages hold is explained in docs/install.md; keep both lists alike.
packages=(g++ cmake ninja-build pkg-config git
          libslepc-real-dev libpetsc-real-dev libopenmpi-dev openmpi-bin libhdf5-openmpi-dev libyaml-dev nlohmann-json3-dev
          libfmt-dev libeigen3-dev libboost-dev
          python3-h5py python3-matplotlib python3-xarray python3-h5netcdf)
test_packages=(catch2 python3-pytest python3-pytest-xdist python3-scipy python3-markdown)

say() { printf '\n== %s\n' "$*"; }
die() { printf 'error: %s\n' "$*" >&2; exit 1; }

# Of `packages` and of those named.
install_missing() {
  local packages=("${packages[@]}" "$@")
  command -v dpkg-query >/dev/null || {
    say "this is no Debian system; the equivalents of these packages are needed: ${packages[*]}"
    return 0
  }
  local missing=() package
  for package in "${packages[@]}"; do
    case " $(dpkg-query -W -f '${db:Status-Status} ' "$package" 2>/dev/null)" in
      *\ installed\ *) ;;  # of some architecture; `not-installed` is said of what was asked for once
      *) missing+=("$package") ;;
    esac
  done
  ((${#missing[@]})) || return 0

  local as_root=()
  if (($(id -u) != 0)); then
    command -v sudo >/dev/null || die "neither root nor sudo at hand; as root: apt-get install ${missing[*]}"
    as_root=(sudo)
    [ -t 0 ] || sudo -n true 2>/dev/null ||
      die "sudo wants a password and there is no terminal to ask for it; as root: apt-get install ${missing[*]}"
  fi
  say "installing ${missing[*]}"
  "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -q update ||
    echo "apt-get update failed; trying with the package lists as they are" >&2
  "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -q -y install --no-install-recommends "${missing[@]}" ||
    die "apt-get could not install ${missing[*]}"
}

cores=$(env -u OMP_NUM_THREADS nproc)  # nproc obeys that variable

# Open MPI: allow root and more ranks than cores, start a single process without a daemon. tests/CMakeLists.txt asks here.
export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1 OMPI_MCA_rmaps_base_oversubscribe=1
export OMPI_MCA_mpi_yield_when_idle=1 OMPI_MCA_hwloc_base_binding_policy=none OMPI_MCA_pml=ob1
export OMPI_MCA_btl_tcp_if_include=lo  # release 5 complains where there is no other network
export OMPI_MCA_ess_singleton_isolated=1 OMPI_MCA_btl_vader_single_copy_mechanism=none OMP_NUM_THREADS=1
case $(mpirun --version 2>/dev/null) in  # the names of later releases
  *"Open MPI) 5."*) export PRTE_MCA_rmaps_default_mapping_policy=:oversubscribe PRTE_MCA_hwloc_default_binding_policy=none ;;
  *"Open MPI) "[6-9].*) export PRTE_MCA_mapby=:oversubscribe PRTE_MCA_bindto=none ;;
esac
export HWLOC_HIDE_ERRORS=2  # it complains on stderr where /sys is not mounted
export LC_ALL=C.UTF-8 MPLBACKEND=Agg
[ -n "${HOME-}" ] || export HOME=${TMPDIR:-/tmp}  # matplotlib wants one, for its cache

# Configures and builds the preset $1: the program alone, or with what tests it (`tests` as $2).
build() {
  say "building (preset $1)"
  local tests=OFF targets=(--target stickslip)
  [ "${2-}" = tests ] && tests=ON targets=()
  cmake --preset "$1" -DSTICKSLIP_TESTS="$tests" && cmake --build --preset "$1" "${targets[@]}" || die "the build failed"
}
