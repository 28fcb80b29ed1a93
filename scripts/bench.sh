#!/usr/bin/env bash
# Every ratio that is promised of the speed, measured in one run beside its peers, and the profile of a window. The images of the
# virtual scanner are rendered first, once; OpenCV, numpy and fringes are installed into target/bench/venv, once, and their lines
# are skipped where that cannot be done. Arguments are those of the bench: --quick, --long, names of lines.
set -euo pipefail
cd "$(dirname "$0")/.."

python3 -c 'import ensurepip, venv' 2>/dev/null ||
    echo "bench: there is no python3 with venv: the lines of OpenCV, numpy and fringes will be skipped" >&2

echo "== build"
# The lines that are live start the released command.
cargo build --release --locked --package fringeflow-command
cargo bench --locked --no-run --bench ratios
echo "== measure: other work on this machine shows in the ranges"
cargo bench --locked --bench ratios -- "$@"
