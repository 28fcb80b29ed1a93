#!/usr/bin/env bash
# Runs every check that a change must pass, the fastest first. Stops at the first failure.
set -euo pipefail
cd "$(dirname "$0")/.."

step() {
    echo "== $*"
    "$@"
}

step cargo fmt --all --check
step cargo clippy --workspace --all-targets --locked -- -D warnings
# Unit, integration and documentation tests. tests/licences.rs checks the dependencies against deny.toml.
step cargo test --workspace --locked
# Checks that the benches run, on small images and without their peers.
step cargo test --locked --bench kernels --bench ratios
RUSTDOCFLAGS="-D warnings" step cargo doc --workspace --no-deps --locked
# cargo-deny and shellcheck take long to install, so they run only if present.
if command -v cargo-deny >/dev/null; then
    step cargo deny --locked check bans licenses sources
fi
if command -v shellcheck >/dev/null; then
    step shellcheck scripts/*.sh tests/v4l2/*.sh tests/monitoring/*.sh .ci/run
fi
echo "== all checks passed"
