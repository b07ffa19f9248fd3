#!/bin/sh
# Stock LeRobot with this plug-in: record, export, open, train ACT for a moment, evaluate; then its rate of success in frozen
# episodes beside ours. Needs Python 3.12, LeRobot with its extras dataset, training and evaluation, this package and the
# plug-in, all in the environment of BIN.
# Usage: conformance.sh BIN OUT [EPISODES] [OBJECT...]
set -eu
bin=$1 out=$2 episodes=${3:-50}
shift; shift; [ $# -eq 0 ] || shift
task=single_object/target_pose
objects=${*:-mug_000 chips_can_000 box_000}
export HF_HUB_OFFLINE=1 WANDB_MODE=disabled
"$bin/manipose" demos record $task --episodes "$episodes" --out "$out/demos" --resume --objects $objects
rm -rf "$out/set" "$out/act" "$out/eval"
"$bin/manipose" demos export "$out/demos" --out "$out/set" --hz 10 --repo-id manipose/demos
"$bin/python" -c "
from lerobot.datasets.lerobot_dataset import LeRobotDataset
d = LeRobotDataset('manipose/demos', root='$out/set')
print('data set:', d.num_episodes, 'episodes,', len(d), 'frames at', d.fps, 'Hz')"
"$bin/lerobot-train" --dataset.repo_id=manipose/demos --dataset.root="$out/set" --policy.type=act --policy.push_to_hub=false \
    --policy.device=cpu --policy.dim_model=128 --policy.dim_feedforward=256 --policy.chunk_size=20 --policy.n_action_steps=20 \
    --steps=100 --batch_size=4 --num_workers=0 --env_eval_freq=0 --save_freq=100 --log_freq=50 \
    --output_dir="$out/act"
"$bin/lerobot-eval" --policy.path="$out/act/checkpoints/last/pretrained_model" --policy.device=cpu --env.type=manipose \
    --env.task=$task --env.protocol=v1 --eval.n_episodes=10 --eval.batch_size=2 --output_dir="$out/eval"
rm -rf "$out/parity"
"$bin/python" "$(dirname "$0")/rollout_parity.py" --out "$out/parity"
