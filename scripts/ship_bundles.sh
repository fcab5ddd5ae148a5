#!/usr/bin/env bash
# Makes the shipped bundle of each published model, after scripts/reproduce.sh.
#   OUT=out/paper RESULTS=docs/results scripts/ship_bundles.sh
# Shipped is the configuration of ours of each model, its variants too, that was best in validation
# rooms, its seeds averaged; of its runs the best one whose weights are here. Its figures are those of
# the frozen test episodes, beside plain of the same seed and schedule.
set -euo pipefail
cd "$(dirname "$0")/.."

out=${OUT:-out/paper}
results=${RESULTS:-$out/results}
perception=cfnav_core/bundles/shared/perception-2832f1d31056fdb8.onnx

best=$(python -m studies.paper.best --results "$results" --grid "$out/grid")
while read -r model split run plain; do
  [ -n "$model" ] || continue # none is at hand
  metrics=$out/metrics_$model.json
  cfnav evaluate "$out/grid/runs/$run/best.safetensors" \
    --against "$out/grid/runs/$plain/best.safetensors" --scenes "$out/rooms" \
    --frozen "docs/episodes/${split}_test.json" --json "$metrics"
  cfnav export "$out/grid/runs/$run/best.safetensors" --perception "$perception" --name "$model" \
    --metrics "$metrics" --out "cfnav_core/bundles/$model" \
    --commands '`scripts/reproduce.sh` (`make reproduce`) and `scripts/ship_bundles.sh`'
done <<< "$best"
