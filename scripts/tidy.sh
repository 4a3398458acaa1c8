#!/usr/bin/env bash
# clang-tidy over src, include and tests, or over the files named: `./check tidy`. The list of checks, with what is left
# out and why, is .clang-tidy. Needs a configured build folder (BUILD, default build) and clang-tidy.
set -u
cd "$(dirname "${BASH_SOURCE[0]}")/.."
command -v clang-tidy >/dev/null || { echo "clang-tidy is not installed (apt-get install clang-tidy)" >&2; exit 2; }
(($#)) || set -- $(git ls-files "src/*.cpp" "tests/*.cpp")
# The precompiled headers are the compiler's and no use to clang: the commands without them.
commands=$(mktemp -d)
trap 'rm -rf "$commands"' EXIT
sed -E 's/ -Winvalid-pch -include [^ ]+//' "${BUILD:-build}/compile_commands.json" > "$commands/compile_commands.json"
findings=$(printf '%s\n' "$@" | xargs -P "${JOBS:-$(nproc)}" -n 1 clang-tidy -p "$commands" --quiet 2>/dev/null)
[ -z "$findings" ] || printf '%s\n' "$findings"
count=$(printf '%s' "$findings" | grep -cE '(^/.*: (warning|error): |^error: )' || true)
echo "clang-tidy: $# files, $count findings"
[ "$count" = 0 ]
