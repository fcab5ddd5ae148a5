#!/usr/bin/env bash
# Remakes the shipped bundle from nothing. Takes hours; goes on where it stopped when run again.
#   OUT=out/train scripts/train_demo.sh      then compare $OUT/bundle with cfnav_core/bundles
# Rooms 0-17 train the policy, 18-19 choose the checkpoint, 20-29 test it; perception learns from 1000 up.
set -euo pipefail
cd "$(dirname "$0")/.."

out=${OUT:-out/train}
seed=${SEED:-0}
types=(kitchen living_room bedroom bathroom)

rooms() { # rooms FLAG RANGE: "FLAG type:RANGE" for each type
  for type in "${types[@]}"; do printf '%s %s:%s ' "$1" "$type" "$2"; done
}
ranges() { # ranges RANGE: "type:RANGE" for each type
  for type in "${types[@]}"; do printf '%s:%s ' "$type" "$1"; done
}

python -m sim_bridge.dataset $(rooms --rooms 1000-1249) --views 40 --out "$out/views"
python -m cfnav_core.train_perception --data "$out/views" --out "$out/perception/perception.onnx" --seed "$seed"
python -m sim_bridge.dataset $(rooms --rooms 0-29) --perception "$out/perception/perception.onnx" --out "$out/scenes"
cfnav train --scenes "$out/scenes" --train-rooms $(ranges 0-17) --validation-rooms $(ranges 18-19) \
  --run.method ours --run.seed "$seed" --out "$out/ours"
cfnav export "$out/ours/best.safetensors" --perception "$out/perception/perception.onnx" --out "$out/bundle"
cfnav evaluate "$out/bundle" --scenes "$out/scenes" $(rooms --rooms 20-29) --episodes 1000 --json "$out/metrics.json"
cfnav export "$out/ours/best.safetensors" --perception "$out/perception/perception.onnx" \
  --metrics "$out/metrics.json" --out "$out/bundle"
