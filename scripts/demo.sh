#!/usr/bin/env bash
# Half a minute of live scanning: a virtual scanner is led around an elephant, and every service runs as on the scanner PC. Then the
# recording is checked, its clouds are made again and compared byte by byte, some are exported, and all are fused into a model.
# Leaves recording, clouds, pictures, report and table of the run in demo-output/, which each run starts afresh but for the
# images of the virtual scanner, which take longest.
set -euo pipefail
cd "$(dirname "$0")/.."

readonly out=demo-output
readonly seconds=${DEMO_SECONDS:-30}

fringeflow() {
    "${CARGO_TARGET_DIR:-target}/release/fringeflow" "$@"
}

# Exit code 3: done, but this machine was too slow for some frames; the table says for which.
fringeflow_live() {
    fringeflow "$@" || { [ $? -eq 3 ] && echo "(some frames were lost; the table says where)"; }
}

echo "== build"
cargo build --release --locked --package fringeflow-command
mkdir -p "$out"
find "$out" -mindepth 1 -maxdepth 1 ! -name demo.images -exec rm -rf {} +

echo "== run: $seconds seconds of live scanning (the images of the virtual scanner are rendered first, once);"
echo "   the line \"dashboard\" below says where to watch it"
fringeflow_live demo --output "$out" --seconds "$seconds" --record "$out/demo.mcap" --report "$out/report.html" | tee "$out/run.txt"
echo "== replay: every recorded cloud is made again of its images"
fringeflow replay "$out/demo.mcap" --verify
echo "== export: clouds, and pictures of how one of them was measured"
fringeflow export "$out/demo.mcap" -o "$out/clouds" --clouds 0..3
fringeflow reconstruct "$out/demo.mcap" -o "$out/elephant.ply" --preview "$out/pictures"
echo "== fuse: all clouds in one model, and the way of the scanner"
fringeflow fuse "$out/demo.mcap" -o "$out/model.ply" --trajectory "$out/poses.csv"

cat <<END

recording     $PWD/$out/demo.mcap   (Foxglove, Lichtblick and Rerun open it)
clouds        $PWD/$out/clouds   (CloudCompare and MeshLab open them)
model         $PWD/$out/model.ply   (of all clouds; the way of the scanner is poses.csv beside it)
pictures      $PWD/$out/pictures
table above   $PWD/$out/run.txt
report        $PWD/$out/report.html   (any browser opens it: latencies over time, where they come from, losses, quality)
END
