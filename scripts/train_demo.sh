#!/usr/bin/env bash
# Remakes the shipped bundles from nothing. Takes hours; goes on where it stopped when run again.
#   OUT=out/train scripts/train_demo.sh
# Perception learns from rooms of its own. Training rooms train both policies, validation rooms
# choose their checkpoints, test rooms are looked at once, at the end.
# The shipped bundle was made by these commands run one by one. Its perception was trained without
# bathrooms 1123 and 1124. Both policies were ended after about 700,000 of 850,000 episodes, long
# after their best checkpoints (405,064 and 310,025 episodes) had been chosen and tested.
set -euo pipefail
cd "$(dirname "$0")/.."

out=${OUT:-out/train}
seed=${SEED:-0}
perception_rooms=1000-1124
views=40
pictures=200000
training=0-15
validation=18-19
test=20-25

rooms() { # rooms FLAG RANGE: "FLAG type:RANGE" for each type
  for type in kitchen living_room bedroom bathroom; do printf '%s %s:%s ' "$1" "$type" "$2"; done
}

cfnav rooms make $(rooms --rooms $perception_rooms) --views $views --out "$out/views"
perception=$out/perception/perception.onnx
[ -f "$perception" ] || cfnav perception \
  --data "$out/views" --out "$perception" --pictures $pictures --seed "$seed"
for range in $training $validation $test; do
  cfnav rooms make $(rooms --rooms $range) --perception "$perception" --out "$out/scenes"
done

train() { # train METHOD [MORE]: a run in out/METHOD
  cfnav train --scenes "$out/scenes" $(rooms --train-rooms $training) \
    $(rooms --validation-rooms $validation) \
    --method "$1" --seed "$seed" --out "$out/$1" "${@:2}"
}
train ours
train plain --stage1 "$out/ours/stage1.safetensors"

for method in plain ours; do
  cfnav export "$out/$method/best.safetensors" --perception "$perception" \
    --name "$method" --out "$out/bundle_$method"
done
# 2,000 episodes, drawn once by cfnav data freeze
cfnav evaluate "$out/bundle_ours" --against "$out/bundle_plain" --scenes "$out/scenes" \
  --frozen docs/episodes/test_rooms_20-25.json --json "$out/metrics.json"
for method in plain ours; do
  python -m studies.live.trials episodes --episodes 60 --speed 0 --bundle "$out/bundle_$method" \
    --out "$out/live/$method.jsonl"
done
python -m studies.live.live_results "$out/live/ours.jsonl" "$out/live/plain.jsonl" \
  --json "$out/live.json"
cfnav export "$out/ours/best.safetensors" --perception "$perception" \
  --name ours --metrics "$out/metrics.json" --live "$out/live.json" \
  --commands '`scripts/train_demo.sh` (`make train-demo`)' --out "$out/bundle_ours"
