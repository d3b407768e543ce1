#!/usr/bin/env bash
# Installs the Python package as `pip install ./python` does, in an environment of its own under target/, and runs its tests.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
environment=target/python
[ -x "$environment/bin/pip" ] || python3 -m venv "$environment" || {
    echo "python/test.sh: python3 cannot make an environment; on Debian and Ubuntu: apt-get install python3-venv" >&2
    exit 1
}
"$environment/bin/pip" install -q --upgrade "pip>=21.3"
"$environment/bin/pip" install -q "./python[test,sparse,mesh,plot,bar]"
cd python
# Not `python -m pytest`, which would import the package from here, where it is not compiled.
"../$environment/bin/pytest" -q "$@"
