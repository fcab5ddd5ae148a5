"""Commands of the set-up: in an environment of their own, with a log, ended with this program."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from ast import literal_eval
from collections.abc import Mapping, Sequence
from pathlib import Path

from steps import SetupError

ROOT = Path(__file__).resolve().parent.parent
VENV = ROOT / ".venv"
PYTHON = str(VENV / "bin/python")
LOG = VENV / "cfnav/set_up.log"

# Variables of another environment, or of scripts/env.sh, that would lead uv or colcon astray.
_FOREIGN = (
    "PYTHONPATH", "PYTHONHOME", "VIRTUAL_ENV", "LD_LIBRARY_PATH",
    "AMENT_PREFIX_PATH", "CMAKE_PREFIX_PATH", "COLCON_PREFIX_PATH",
)  # fmt: skip

# uv reads no file or variable of pip's; these are its own for the same settings. User names and
# passwords may stand in them: in a command line they would be seen in the log.
_OF_UV = {
    "index-url": "UV_DEFAULT_INDEX",
    "extra-index-url": "UV_INDEX",
    "find-links": "UV_FIND_LINKS",
    "constraint": "UV_CONSTRAINT",
    "trusted-host": "UV_INSECURE_HOST",
    "cert": "SSL_CERT_FILE",
    "proxy": "ALL_PROXY",
}


def variables() -> dict[str, str]:
    """The caller's environment variables without those of other environments."""
    kept = {name: value for name, value in os.environ.items() if name not in _FOREIGN}
    kept["PATH"] = f"{VENV / 'bin'}{os.pathsep}{kept.get('PATH', os.defpath)}"
    return kept


def run(
    command: Sequence[str], failure: str, cwd: Path = ROOT, more: Mapping[str, str] | None = None
) -> None:
    """Runs a command with its output in the log.

    Args:
        command: Program and arguments.
        failure: What it means for the user when the command fails, without a full stop.
        cwd: Where to run it.
        more: Environment variables besides the caller's.

    Raises:
        SetupError: It failed; its last lines have been shown.
    """
    LOG.parent.mkdir(parents=True, exist_ok=True)
    with LOG.open("ab+") as log:
        log.write(f"\n$ {' '.join(command)}\n".encode())
        log.flush()
        start = log.tell()
        process = subprocess.Popen(
            command, cwd=cwd, env={**(more or {}), **variables()}, stdin=subprocess.DEVNULL,
            stdout=log, stderr=log, process_group=0,
        )  # fmt: skip
        try:
            code = process.wait()
        except BaseException:
            # Interrupted: the whole group is ended, so that nothing goes on alone.
            os.killpg(process.pid, signal.SIGTERM)
            process.wait()
            raise
        if code == 0:
            return
        log.seek(start)
        lines = log.read().decode(errors="replace").strip().splitlines()
    print("\n".join(lines[-20:]), file=sys.stderr)
    raise SetupError(f"{failure} (all of its output: {LOG.relative_to(ROOT)}).")


def install(*arguments: str) -> None:
    """Installs packages into `.venv` with uv, from wherever pip is configured to look.

    Args:
        arguments: Requirements and options.

    Raises:
        SetupError: They could not be installed.
    """
    listing = subprocess.run(
        [PYTHON, "-m", "pip", "config", "list"], env=variables(), capture_output=True, text=True
    )
    settings = pip_settings(listing.stdout)
    command = ["uv", "pip", "install", "--python", PYTHON, "--compile-bytecode"]
    if settings.get("no-index", "") in ("1", "true", "yes", "on"):
        command.append("--no-index")
    run([*command, *arguments], "uv could not install the packages", more=as_uv(settings))


def pip_settings(configuration: str) -> dict[str, str]:
    """What pip's configuration says about installing.

    Args:
        configuration: Output of `pip config list`.
    """
    settings: dict[str, str] = {}
    for section in ("global.", "install.", ":env:."):  # as pip ranks them: the last one counts
        for line in configuration.splitlines():
            if line.startswith(section):
                name, _, value = line.removeprefix(section).partition("=")
                settings[name] = literal_eval(value)
    return settings


def as_uv(settings: Mapping[str, str]) -> dict[str, str]:
    """The environment variables that tell uv what these settings tell pip."""
    # pip takes the best version of all indexes; uv without being told so that of the first.
    told = {"UV_INDEX_STRATEGY": "unsafe-best-match"}
    for name, value in settings.items():
        if name in _OF_UV:
            told[_OF_UV[name]] = ("," if name == "find-links" else " ").join(value.split())
    return told
