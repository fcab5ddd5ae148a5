#!/usr/bin/env bash
# Remakes the bundles from nothing: default (camera on a mast), turtlebot4 (as sold, wide), boxes and
# boxes_mast (any detector), each ours, beside plain from the same stage one. The first two take
# days, and 84 and 47 GB for perception's pictures, the others hours; goes on where it stopped when
# run again.
#   OUT=out/train BUNDLES="default turtlebot4 boxes boxes_mast" scripts/train_demo.sh
# Perception learns from 200 pictures of each of its own rooms, while they are rendered; that of any
# other camera begins with the mast's. Training rooms train both policies, validation rooms end
# stage one and choose checkpoints, test rooms are looked at once, at the end. Those shipped so far
# learnt in 192 or 256 of these rooms (docs/training.md).
set -euo pipefail
cd "$(dirname "$0")/.."

seed=${SEED:-0} root=${OUT:-out/train}
views=${VIEWS:-1000-1166}                      # seeds of each type and furniture, varied too
pictures=${PICTURES:-2000000}
training=${TRAINING:-worlds:train sweet_home.worlds:train}
validation=${VALIDATION:-worlds:validation sweet_home.worlds:validation}
tests=${TESTS:-worlds:test sweet_home.worlds:test}
stage1=${STAGE1:-250000} most=${MOST:-1000000} stage2=${STAGE2:-600000} # episodes
every=${EVERY:-15000} episodes=${EPISODES:-2000}
live=${LIVE:-} trials=${TRIALS:-60}            # rooms, the first five test rooms of each kind; drives

made=$(python -c 'from sim_bridge.room.room import room_source as of
print(of("kitchen"), of("sweet_home.kitchen"), of("varied.kitchen"), sep=", ")')

each() { for word in "${@:2}"; do printf '%s %s ' "$1" "$word"; done; } # each FLAG WORD...
settings() { # what the results depend on, versions of the rooms included
  echo "seed $seed, views $views, pictures $pictures, training $training, validation $validation," \
    "tests $tests, stage one $stage1 to $most, stage two $stage2, every $every," \
    "episodes $episodes, live $live, trials $trials, $made"
}
once() { # once NAME COMMAND...: not again when it is done, and never with other settings or words
  local now words=${*:2}
  now="$(settings), by ${words//"$out"/OUT}"
  if [ -e "$out/done/$1" ]; then
    [ "$(cat "$out/done/$1")" != "$now" ] || return 0
    echo "train_demo.sh: found $out/done/$1 made with $(cat "$out/done/$1"); expected $now. Name" \
      "another OUT, or delete $out." >&2
    exit 2
  fi
  "${@:2}"
  mkdir -p "$out/done" && echo "$now" > "$out/done/$1"
}
every_kind() { # every_kind FIRST-LAST [MORE]: rooms of each type and furniture, seed by seed
  for number in $(seq "${1%-*}" "${1#*-}"); do
    for type in kitchen living_room bedroom bathroom; do
      for furniture in "" sweet_home. "${@:2}"; do echo "$furniture$type:$number"; done
    done
  done
}

mast() { # mast ACROSS DOWN WIDTH HEIGHT: the file of a camera on the mast, degrees and pixels
  local file=$root/mast_${1%.*}.json
  mkdir -p "$root"
  echo "{\"x\": 0.0, \"z\": 1.3, \"fov_deg\": [$1, $2], \"size\": [$3, $4]," \
    "\"horizons_deg\": [0.0, -30.0]}" > "$file"
  echo "$file"
}
see() { # the pictures, and beside them the network that learns from those that are there
  local by=$camera # a network looks at half as many pixels either way; of the mast's 300 it has 224
  [ "$camera" != mast ] || by=$(mast 90.0 90.0 448 448)
  cfnav rooms make $(each --rooms $(every_kind "$views" varied.)) --views 200 --camera "$by" \
    --out "$out/views" &
  cfnav perception --data "$out/views" --out "$perception" --pictures "$pictures" --seed "$seed" \
    --wait-for "${WAIT_FOR:-160}" ${begin:+--begin "$begin"}
  wait $!
}
render() { # render ROOMS...
  cfnav rooms make $(each --rooms "$@") --camera "$camera" --perception "$perception" \
    --out "$out/scenes"
}
share() { # share K N ROOMS...: every N-th of them by its seed
  python -c 'import sys
from cfnav_core.task.rooms import parse_rooms
k, n = map(int, sys.argv[1:3])
print(*(f"{kind}:{seed}" for kind, seed in parse_rooms(sys.argv[3:]) if seed % n == k))' "$@"
}
detect() { # detect FOLDER DISTANCE ROOMS...: what a detector says in these rooms, by several views
  local k rooms
  for k in "${!cameras[@]}"; do
    rooms=$(share "$k" "${#cameras[@]}" "${@:3}")
    [ -z "$rooms" ] || cfnav rooms boxes --camera "${cameras[k]}" --out "$1" --distance "$2" \
      $(each --rooms $rooms)
  done
}
listen() { # listen FOLDER ROOMS...: the LiDAR's p_hat
  cfnav rooms scan "$1" $(each --rooms "${@:2}") && cfnav data lidar "$1"
}

# What a kind of bundle adds to these commands is in exported and judged, to train's in learnt.
train() { # train METHOD [MORE]
  cfnav train --scenes "$out/scenes" $(each --train-rooms $training) \
    $(each --validation-rooms $validation) --stage1-episodes "$stage1" --stage2-episodes "$stage2" \
    --validation-every "$every" --method "$1" --seed "$seed" --out "$out/$1" "${@:2}"
}
export_bundle() { # export_bundle METHOD FOLDER NAME [MORE]
  cfnav export "$out/$1/best.safetensors" --name "$3" --out "$2" \
    --commands '`scripts/train_demo.sh` (`make train-demo`)' "${exported[@]}" "${@:4}"
}
evaluate() { # evaluate FILE ROOMS...
  cfnav evaluate "$out/bundle_ours" --against "$out/bundle_plain" "${judged[@]}" \
    $(each --rooms "${@:2}") --episodes "$episodes" --seed "$seed" --json "$out/$1.json"
}
drive() { # drive METHOD
  local rooms
  rooms=$(echo ${live:-$(every_kind 300-304)})
  python -m studies.live.trials episodes --room "${rooms// /,}" --episodes "$trials" --speed 0 \
    --camera "$camera" --bundle "$out/bundle_$1" --out "$out/live/$1.jsonl"
}
policies() { # policies NAME [MORE]: ours and plain, judged without ROS and on the live graph
  once ours train ours "${learnt[@]}" --stage1-most "$most"
  once plain train plain "${learnt[@]}" --stage1 "$out/ours/stage1.safetensors"
  for method in plain ours; do once "$method.bundle" export_bundle $method "$out/bundle_$method" $method; done
  for rooms in $tests; do once "$rooms" evaluate "metrics_${rooms%%:*}" "$rooms"; done
  once metrics evaluate metrics $tests
  for method in plain ours; do once "$method.live" drive $method; done
  once live python -m studies.live.live_results "$out/live/ours.jsonl" "$out/live/plain.jsonl" \
    --json "$out/live.json"
  once bundle export_bundle ours "$out/$1" "$1" --metrics "$out/metrics.json" --live "$out/live.json" \
    "${@:2}"
}

perceive() { # perceive NAME CAMERA: the network of a camera; others begin with the mast's
  [ "$2" = mast ] || perceive default mast
  camera=$2 out=$root/$1
  [ "$2" = mast ] && begin="" || begin=$root/default/perception/perception.onnx
  perception=$out/perception/perception.onnx
  once perception see
}
remake() { # remake NAME CAMERA [MORE]: perception, the rooms as it sees them, and the policies
  perceive "$1" "$2"
  once rooms render $training $validation
  once tests render $tests
  learnt=("${@:3}") exported=(--perception "$perception") judged=(--scenes "$out/scenes")
  policies "$1"
}
remake_boxes() { # remake_boxes NAME CAMERA..., without pictures: a detector's boxes, and the LiDAR
  camera=$2 cameras=("${@:2}") out=$root/$1
  once rooms detect "$out/scenes" mixed $training $validation
  once tests detect "$out/sealed" lidar $tests
  once scans listen "$out/sealed" $tests
  once knowledge cfnav data knowledge "$out/scenes" $(each --rooms $training) \
    --out "$out/knowledge.safetensors"
  learnt=(--model tdanet --knowledge "$out/knowledge.safetensors")
  exported=() judged=(--scenes "$out/sealed" --p-hat lidar)
  policies "$1" --also coco
}

trap 'kill $(jobs -p) 2> /dev/null || true' EXIT # the pictures end with what they are for
for bundle in ${BUNDLES:-default turtlebot4 boxes boxes_mast}; do
  case $bundle in
    default) remake default mast ;;
    turtlebot4) remake turtlebot4 stock_wide --dropout 0.1 ;;
    boxes) remake_boxes boxes stock_wide ;;
    boxes_mast)
      remake_boxes boxes_mast mast "$(mast 66.0 40.1 448 252)" "$(mast 78.0 56.0 448 294)"
      ;;
    *) remake "$bundle" "$bundle" ;; # for another camera, named as that is
  esac
done
