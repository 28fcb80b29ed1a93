#!/usr/bin/env bash
# Unpacks `prometheus` and `promtool` from Debian's package prometheus into target/, once. Installs nothing, starts no
# service, and needs no root.
# Usage: prometheus_package.sh; prints the folder of both programs.
set -euo pipefail
cd "$(dirname "$0")/../.."

folder=$(realpath --canonicalize-missing "${CARGO_TARGET_DIR:-target}/prometheus")
readonly folder

fail() {
    echo "prometheus_package.sh: $*" >&2
    exit 1
}

download() {
    (cd "$work/package" && rm -f ./* && apt-get download -qq -o APT::Sandbox::User= prometheus) >"$work/output.txt" 2>&1
}

# Uses separate apt package lists. Those of the machine may be empty (in a fresh container) or too old, and only root
# can update them.
use_own_lists() {
    mkdir -p "$work/lists/partial"
    printf 'Dir::State::lists "%s";\nDir::Cache::pkgcache "";\nDir::Cache::srcpkgcache "";\n' "$work/lists" >"$work/apt.conf"
    export APT_CONFIG=$work/apt.conf
    # A failing source may not be needed. If it is, the download below fails.
    apt-get update -qq >"$work/output.txt" 2>&1 || cat "$work/output.txt" >&2
}

# Moves the programs to their final folder only when complete, so an interrupted run leaves nothing that looks finished.
unpack() {
    mkdir "$work/root"
    dpkg-deb --fsys-tarfile "$work"/package/prometheus_*.deb |
        tar --extract --directory "$work/root" ./usr/bin/prometheus ./usr/bin/promtool
    "$work/root/usr/bin/promtool" --version >"$work/output.txt" 2>&1 ||
        { cat "$work/output.txt" >&2; fail "promtool does not run here"; }
    mv --no-target-directory "$work/root/usr/bin" "$folder/bin"
}

mkdir -p "$folder"
# Several tests may run this at once: the first one unpacks, the others wait.
exec 9>"$folder/lock"
flock 9
if [ ! -d "$folder/bin" ]; then
    command -v apt-get >/dev/null || fail "this needs the Debian package prometheus: run the test on Debian 12 or later"
    work=$(mktemp --directory "$folder/.work.XXXXXX")
    trap 'rm -rf "$work"' EXIT
    mkdir "$work/package"
    if ! download; then
        use_own_lists
        download || { cat "$work/output.txt" >&2; fail "cannot download the package prometheus; is there a network?"; }
    fi
    unpack
fi
echo "$folder/bin"
