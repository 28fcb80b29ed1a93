#!/usr/bin/env bash
# Downloads the JavaScript libraries of the monitor's page, pinned by version and checksum, and puts the needed files
# into services/monitor/page/vendor. They are committed, so building and running need no network. The result is the
# same, byte by byte, every time. Needs npm, only to download from its registry. Exit codes: 0 done, 1 a download or a
# checksum failed.
set -euo pipefail
cd "$(dirname "$0")/.."

readonly vendor=services/monitor/page/vendor

# From 0.186 on, the package three has no minified files.
readonly uplot=1.6.32 three=0.185.1
readonly checksums="\
2883159c6ebccefbb95d751b0b82d010f9e1c0ec41b8bc96d401eda66e882935c89a46cb824332fa369b8cb8122cc6ac36e186cd09bf7a9ded3a4c93c6989023  uplot-$uplot.tgz
e5aa231425cac278c1459bd49eddd615f11cbd426090de4b9628d114df7984ccbc595906e08d1035c244f8eb96bee2746ce752b6b6df5e7d2991debf43288096  three-$three.tgz"

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

download() {
    (cd "$work" && npm pack --silent "uplot@$uplot" "three@$three" >/dev/null)
    (cd "$work" && sha512sum --check --quiet <<<"$checksums")
}

# Writes one file of a package to standard output.
unpack() {
    tar --extract --gzip --to-stdout --file "$work/$1.tgz" "package/$2"
}

collect_uplot() {
    mkdir -p "$vendor/uplot"
    unpack "uplot-$uplot" LICENSE >"$vendor/uplot/LICENSE"
    unpack "uplot-$uplot" dist/uPlot.min.css >"$vendor/uplot/uPlot.min.css"
    # Only the build for script tags is minified. The added export makes it a module.
    { unpack "uplot-$uplot" dist/uPlot.iife.min.js && echo 'export default uPlot;'; } >"$vendor/uplot/uPlot.min.js"
}

collect_three() {
    mkdir -p "$vendor/three"
    unpack "three-$three" LICENSE >"$vendor/three/LICENSE"
    unpack "three-$three" build/three.core.min.js >"$vendor/three/three.core.min.js"
    unpack "three-$three" build/three.module.min.js >"$vendor/three/three.module.min.js"
    # A bare module name would need an import map, which the page's Content-Security-Policy forbids.
    unpack "three-$three" examples/jsm/controls/OrbitControls.js |
        sed "s|^} from 'three';\$|} from './three.module.min.js';|" >"$vendor/three/OrbitControls.js"
    grep --quiet "from './three.module.min.js'" "$vendor/three/OrbitControls.js"
}

download
rm -rf "$vendor"
collect_uplot
collect_three
(cd "$vendor" && find . -type f ! -name SHA256SUMS -printf '%P\n' | LC_ALL=C sort | xargs sha256sum >"$work/SHA256SUMS")
mv "$work/SHA256SUMS" "$vendor/SHA256SUMS"
