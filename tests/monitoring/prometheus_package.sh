#!/usr/bin/env bash
# Unpacks `prometheus` and `promtool` of Debian's package prometheus below target/, once. Nothing is installed, no service is
# started, and no root is needed.
# Usage: prometheus_package.sh; prints the folder that holds both.
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

# Lists of our own: the machine's are empty in a fresh container, or too old to download by, and only root may renew them.
use_own_lists() {
    mkdir -p "$work/lists/partial"
    printf 'Dir::State::lists "%s";\nDir::Cache::pkgcache "";\nDir::Cache::srcpkgcache "";\n' "$work/lists" >"$work/apt.conf"
    export APT_CONFIG=$work/apt.conf
    # One of several sources may fail and not be needed; what is missing shows below.
    apt-get update -qq >"$work/output.txt" 2>&1 || cat "$work/output.txt" >&2
}

# Appears under its name when it is whole: what is killed leaves nothing that looks finished.
unpack() {
    mkdir "$work/root"
    dpkg-deb --fsys-tarfile "$work"/package/prometheus_*.deb |
        tar --extract --directory "$work/root" ./usr/bin/prometheus ./usr/bin/promtool
    "$work/root/usr/bin/promtool" --version >"$work/output.txt" 2>&1 ||
        { cat "$work/output.txt" >&2; fail "promtool does not run here"; }
    mv --no-target-directory "$work/root/usr/bin" "$folder/bin"
}

mkdir -p "$folder"
# Tests may ask for it side by side; the first unpacks it, the others wait.
exec 9>"$folder/lock"
flock 9
if [ ! -d "$folder/bin" ]; then
    command -v apt-get >/dev/null || fail "Prometheus comes as a package of Debian: run this test on Debian 12 or later"
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
