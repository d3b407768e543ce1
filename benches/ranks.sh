#!/usr/bin/env bash
# Measures how work scales over ranks, by the CPU time of each: on fewer cores than ranks, wall time says nothing.
# Usage: benches/ranks.sh SCENE.obj [FLAGS of form-factors and solve], after `cargo build --release --features mpi`.
# With WEAK=N in the environment the pairs of patches grow with K: `--subdivide` N times its fourth root is added.
# Prints for K = 1, 2, 4, 8 the most and the sum of the ranks' CPU times in s, and what rank 0 sent.
set -euo pipefail
program=$(realpath "$(dirname "${BASH_SOURCE[0]}")/../target/release/radiosity")
directory=$(mktemp -d)
trap 'rm -rf "$directory"' EXIT

for command in form-factors solve; do
  for k in 1 2 4 8; do
    export directory program
    cut=()
    if [ -n "${WEAK:-}" ]; then
      cut=(--subdivide "$(awk -v n="$WEAK" -v k="$k" 'BEGIN { printf "%.0f", n * sqrt(sqrt(k)) }')")
    fi
    # shellcheck disable=SC2016
    mpirun -n "$k" bash -c 'TIMEFORMAT="%U %S"; { time "$program" "$@" 2>/dev/null; } 2>"$directory/time.$PMI_RANK"' bash \
      "$command" "$@" "${cut[@]}" --threads 1 --explain >"$directory/out"
    cat "$directory"/time.* | awk -v k="$k" -v command="$command" \
      '{ t = $1 + $2; sum += t; if (t > most) most = t } END { printf "%s K=%d most=%.2f sum=%.2f\n", command, k, most, sum }'
    grep -E "^(rank 0 sent|[0-9.]+ s:)" "$directory/out" || true
    rm "$directory"/time.*
  done
done
