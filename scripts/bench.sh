#!/usr/bin/env bash
# Measures in one run the speed ratios that the project promises, side by side with their peers, and the profile of a
# window. The first run renders the images of the virtual scanner, and installs OpenCV, numpy and fringes into
# target/bench/venv; if that fails, their lines are skipped. Arguments are those of the bench: --quick, --long, names of
# lines.
set -euo pipefail
cd "$(dirname "$0")/.."

python3 -c 'import ensurepip, venv' 2>/dev/null ||
    echo "bench: python3 with venv is missing: the lines of OpenCV, numpy and fringes will be skipped" >&2

echo "== build"
# Live lines run the release build of the command.
cargo build --release --locked --package fringeflow-command
cargo bench --locked --no-run --bench ratios
echo "== measure: other work on this machine widens the ranges"
cargo bench --locked --bench ratios -- "$@"
