#!/usr/bin/env bash
# Installs the Python package as `pip install ./python` does, in an environment of its own under target/, and runs its tests.
# With `--environment` it installs the packages that the tests need, and no more.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
environment=target/python
# Debian has the module in a package of its own.
with_venv() {
    local as_root=()
    [ "$(id -u)" -eq 0 ] || as_root=(sudo)
    command -v apt-get >/dev/null && "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -q install -y python3-venv
}
if ! [ -x "$environment/bin/pip" ]; then
    python3 -m venv "$environment" || { rm -rf "$environment"; with_venv && python3 -m venv "$environment"; } || {
        echo "python/test.sh: python3 cannot make an environment; install its module venv, and run this again" >&2
        exit 1
    }
fi
"$environment/bin/pip" install -q --upgrade "pip>=21.3"
if [ "${1-}" = --environment ]; then
    grep -E '^(dependencies|sparse|mesh|plot|bar|test) = ' python/pyproject.toml | grep -oE '"[^"]+"' | tr -d '"' >"$environment/needs.txt"
    exec "$environment/bin/pip" install -q -r "$environment/needs.txt"
fi
# With the features of the program, so that the library is not built a second time; FEATURES names others.
MATURIN_PEP517_ARGS="--features ${FEATURES:-radiosity/default}" "$environment/bin/pip" install -q "./python[test,sparse,mesh,plot,bar]"
cd python
# Not `python -m pytest`, which would import the package from here, where it is not compiled.
"../$environment/bin/pytest" -q "$@"
