"""Names of the files of a training run's folder. No torch."""

CHECKPOINT, STAGE1, BEST = "checkpoint.safetensors", "stage1.safetensors", "best.safetensors"
LOG, LOCK = "log.jsonl", "run.lock"
