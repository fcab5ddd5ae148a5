#!/usr/bin/env bash
# Writes the lock files in requirements/ from the bounds in pyproject.toml.
set -euo pipefail
cd "$(dirname "$0")/.."
compile=(.venv/bin/uv pip compile --config-file requirements/uv.toml --quiet --universal
  --python-version 3.11 --upgrade --custom-compile-command scripts/lock.sh)
"${compile[@]}" pyproject.toml --group build --output-file requirements/demo.txt
"${compile[@]}" pyproject.toml --group build --group test --extra train --extra cluster --no-emit-package torch \
  --constraint requirements/demo.txt --output-file requirements/test.txt
