#!/usr/bin/env bash
# Simulates a scan of a nose, measures it without Gray code and compares the cloud with the exact truth.
# Leaves the dataset, the cloud and pictures in demo-output/, which each run starts afresh.
set -euo pipefail
cd "$(dirname "$0")/.."

readonly out=demo-output

fringeflow() {
    cargo run --quiet --release --locked --package fringeflow-command -- "$@"
}

echo "== build"
cargo build --release --locked --package fringeflow-command
rm -rf "$out"
mkdir "$out"

echo "== simulate: images of a virtual scanner, with their truth"
fringeflow simulate --object nose --steps 4 --seed 1 -o "$out/nose"
echo "== reconstruct: from the images to the point cloud"
fringeflow reconstruct "$out/nose" -o "$out/nose.ply" --preview "$out/pictures"
echo "== evaluate: against the truth"
fringeflow evaluate "$out/nose" --against truth

cat <<END

point cloud   $PWD/$out/nose.ply   (CloudCompare and MeshLab open it)
pictures      $PWD/$out/pictures
dataset       $PWD/$out/nose
END
