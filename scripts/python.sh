#!/usr/bin/env bash
# Prints the path of a Python with the packages of tests/python/requirements.txt. Creates this environment in target/ if
# it is missing or out of date.
set -euo pipefail
cd "$(dirname "$0")/.."

readonly requirements=tests/python/requirements.txt
readonly environment=${CARGO_TARGET_DIR:-target}/python

# Several tests may run this at once: the first one creates the environment, the others wait.
mkdir -p "$environment"
exec 9>"$environment/.lock"
flock 9
if ! cmp --silent "$requirements" "$environment/installed.txt"; then
    python3 -m venv "$environment" >&2
    "$environment/bin/pip" install --quiet --disable-pip-version-check --requirement "$requirements" >&2
    cp "$requirements" "$environment/installed.txt"
fi
realpath --no-symlinks "$environment/bin/python"
