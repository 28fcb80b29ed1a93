#!/usr/bin/env bash
# Half a minute of live scanning: a virtual scanner moves around an elephant, and every service runs as on the scanner
# PC. Then the clouds of the recording are computed again and compared byte by byte, some are exported, and all are
# fused into a model. Recording, clouds, pictures, report and table of the run are in demo-output/. Each run empties
# this folder, except for the images of the virtual scanner, which take longest to make.
set -euo pipefail
cd "$(dirname "$0")/.."

readonly out=demo-output
readonly seconds=${DEMO_SECONDS:-30}

fringeflow() {
    "${CARGO_TARGET_DIR:-target}/release/fringeflow" "$@"
}

# Exit code 3: done, but this machine was too slow for some frames; the table shows which.
fringeflow_live() {
    fringeflow "$@" || { [ $? -eq 3 ] && echo "(some frames were lost; the table shows where)"; }
}

echo "== build"
cargo build --release --locked --package fringeflow-command
mkdir -p "$out"
find "$out" -mindepth 1 -maxdepth 1 ! -name demo.images -exec rm -rf {} +

echo "== run: $seconds seconds of live scanning (the first run renders the images of the virtual scanner);"
echo "   to watch it, open the address in the line \"dashboard\" below"
fringeflow_live demo --output "$out" --seconds "$seconds" --record "$out/demo.mcap" --report "$out/report.html" | tee "$out/run.txt"
echo "== replay: every recorded cloud is computed again from its images"
fringeflow replay "$out/demo.mcap" --verify
echo "== export: some clouds, and pictures of how one of them was measured"
fringeflow export "$out/demo.mcap" -o "$out/clouds" --clouds 0..3
fringeflow reconstruct "$out/demo.mcap" -o "$out/elephant.ply" --preview "$out/pictures"
echo "== fuse: all clouds in one model, and the trajectory of the scanner"
fringeflow fuse "$out/demo.mcap" -o "$out/model.ply" --trajectory "$out/poses.csv"

cat <<END

recording     $PWD/$out/demo.mcap   (Foxglove, Lichtblick and Rerun open it)
clouds        $PWD/$out/clouds   (CloudCompare and MeshLab open them)
model         $PWD/$out/model.ply   (all clouds fused; poses.csv beside it is the trajectory of the scanner)
pictures      $PWD/$out/pictures
table above   $PWD/$out/run.txt
report        $PWD/$out/report.html   (for a browser: latencies over time and their causes, losses, quality)
END
if grep --quiet injected "$out/run.txt"; then
    cat <<END

One fault was on purpose: from second 22 to 24 the virtual cameras lost a tenth of their images (table
[virtual_scanner.faults] of demo.toml). The table above, and "Drops ... by stage and reason" on the dashboard and in the
report, count them as \`injected\`, and images without a partner as \`unpaired\`. "Rates" shows two seconds with fewer
clouds.
END
fi
