#!/usr/bin/env bash
# Every check a change must pass, the fastest first; stops at the first that fails.
set -euo pipefail
cd "$(dirname "$0")/.."

step() {
    echo "== $*"
    "$@"
}

step cargo fmt --all --check
step cargo clippy --workspace --all-targets --locked -- -D warnings
# Unit, integration and documentation tests; tests/licences.rs holds the dependencies to deny.toml.
step cargo test --workspace --locked
# That the benches run, on small images and without their peers.
step cargo test --locked --bench kernels --bench ratios
RUSTDOCFLAGS="-D warnings" step cargo doc --workspace --no-deps --locked
# cargo-deny and shellcheck take long to get on a bare machine; where they are, they check more.
if command -v cargo-deny >/dev/null; then
    step cargo deny --locked check bans licenses sources
fi
if command -v shellcheck >/dev/null; then
    step shellcheck scripts/*.sh tests/v4l2/*.sh tests/monitoring/*.sh .ci/run
fi
echo "== all checks passed"
