#!/usr/bin/env bash
# The paper's Tables I to IV from nothing; goes on where it stopped when run again.
#   OUT=out/paper RESULTS=docs/results SEEDS=5 scripts/reproduce.sh
# Rooms, scans and knowledge are made first, then the grid trains, and test rooms are looked at
# when every run of it is done. The last tables are driven on the live graph.
set -euo pipefail
cd "$(dirname "$0")/.."

out=${OUT:-out/paper}
results=${RESULTS:-$out/results}
seeds=${SEEDS:-5}
preset=${PRESET:-small}
perception=cfnav_core/bundles/shared/perception-2832f1d31056fdb8.onnx

cfnav rooms make --perception "$perception" --out "$out/rooms"
cfnav rooms scan "$out/rooms" --rooms data2:test --rooms data2:validation
cfnav data lidar "$out/rooms"
benchmark() {
  cfnav benchmark "$@" --scenes "$out/rooms" --out "$out/grid" --preset "$preset" \
    --results "$results"
}
benchmark I II III own --seeds "$seeds"
benchmark tenfold --model tdanet --seeds "$seeds"
benchmark tenfold --model lstde --seeds 1
python -m studies.paper.p_hat_study --scenes "$out/rooms" --grid "$out/grid" \
  --preset "$preset" --results "$results" --seeds "$seeds"

looks=()
for shift in 0.5 1.0; do
  shifted=$out/rooms_shifted_$shift
  cfnav rooms make --rooms data2:test --visual-shift "$shift" \
    --perception "$perception" --out "$shifted"
  cfnav rooms scan "$shifted" --rooms data2:test
  cfnav data lidar "$shifted"
  looks+=(--shifted "$shifted")
done
python -m studies.paper.shift_study --scenes "$out/rooms" "${looks[@]}" \
  --grid "$out/grid" --preset "$preset" --results "$results" --seeds "$seeds"

bundle() { # METHOD, or METHOD_tenfold; SEED
  local folder weights
  folder=$(awk -F, -v run="data2_tdanet_$1_seed$2_" -v preset="$preset" \
    'index($1, run) == 1 && $2 == preset {print $1}' "$results/runs.csv")
  weights=$out/grid/runs/$folder/best.safetensors
  # absent where results were unpacked: their trials are in them
  if [ -f "$weights" ]; then
    cfnav export "$weights" --perception "$perception" \
      --name "tdanet_$1_seed$2" --out "$out/bundles/$1_seed$2"
  fi
}
table_iv() {
  python -m studies.live.trials table-iv --bundles "$out/bundles" --out "$out/trials" \
    --results "$results" "$@"
}
for method in plain reward_only stage_only ours truth; do
  bundle "$method" 0
  for ((seed = 0; seed < seeds; seed++)); do
    bundle "${method}_tenfold" "$seed"
  done
done
table_iv --rows paper
table_iv --rows all --trials 20
if [ "$preset" != full ]; then # which is trained long already
  table_iv --rows paper --schedule tenfold
  table_iv --rows main --trials $((20 * seeds)) --seeds "$seeds" --schedule tenfold
  table_iv --rows all --trials 20 --schedule tenfold
fi

# Every test episode, learning curve and live trial: all that the tables need, without the weights.
for ((seed = 0; seed < seeds; seed++)); do
  (
    cd "$out"
    shopt -s nullglob # tables that were not asked for have no files
    find grid/{rooms,tests,looks}.json grid/runs/*_seed"${seed}"_* grid/random_"${seed}"_* \
      grid/p_hat/tests/*_seed"${seed}"_* trials/maps trials/*_seed"${seed}"_*.jsonl -type f \
      ! -name '*.safetensors' ! -name '*.steps.npz' ! -name '*.task.json' ! -name '*.lock' \
      ! -name '*.log' ! -name 'events.out.*' -print | sort
  ) | tar -C "$out" --files-from=- --mtime=@0 --owner=0 --group=0 --numeric-owner -c \
    | gzip -n > "$results/seed$seed.tar.gz.partial"
  mv "$results/seed$seed.tar.gz.partial" "$results/seed$seed.tar.gz"
done
