#!/usr/bin/env bash
# Makes the shipped bundle of each published model, after scripts/reproduce.sh.
#   OUT=out/paper RESULTS=docs/results scripts/ship_bundles.sh
# Of ours of each model the seed that was best in validation rooms is shipped. Its figures are those
# of the frozen test episodes, beside plain of the same seed.
set -euo pipefail
cd "$(dirname "$0")/.."

out=${OUT:-out/paper}
results=${RESULTS:-$out/results}
perception=cfnav_core/bundles/default/perception.onnx

# runs METHOD: model, split, seed, folder and validation CF-SR of its runs with ordinary lengths
runs() {
  python - "$results/runs.csv" "$1" <<'EOF'
import csv, sys
for row in csv.DictReader(open(sys.argv[1])):
    if row["method"] == sys.argv[2] and "_longer_" not in row["run"]:
        print(row["model"], row["split"], row["seed"], row["run"], row["validation_cf_sr"])
EOF
}

best=$(runs ours | sort -k1,1 -k5,5gr -k3,3n | sort -u -s -k1,1)
while read -r model split seed run _; do
  plain=$(runs plain | awk -v m="$model" -v s="$seed" '$1 == m && $3 == s {print $4}')
  metrics=$out/metrics_$model.json
  cfnav evaluate "$out/grid/runs/$run/best.safetensors" \
    --against "$out/grid/runs/$plain/best.safetensors" --scenes "$out/rooms" \
    --frozen "docs/episodes/${split}_test.json" --json "$metrics"
  cfnav export "$out/grid/runs/$run/best.safetensors" --perception "$perception" --name "$model" \
    --metrics "$metrics" --out "cfnav_core/bundles/$model" \
    --commands '`scripts/reproduce.sh` (`make reproduce`) and `scripts/ship_bundles.sh`'
done <<<"$best"
