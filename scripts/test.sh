#!/usr/bin/env bash
# Runs the tests, or those in the given paths: first those without a ROS graph, on all cores, then
# those with one, three at a time: they run in real time, and wait more than they compute. A file's
# tests stay in one process, as they share what its fixtures made.
set -uo pipefail
export CFNAV_REQUIRE_ROS=1

none=5 # what pytest says when it found no test
python -m pytest --numprocesses auto --maxprocesses 8 --dist loadfile -m "not long and not ros" "$@"
first=$?
[ "$first" -ne 2 ] || exit 2 # interrupted
python -m pytest --numprocesses 3 --dist loadfile -m "not long and ros" "$@"
second=$?
[ "$first" -ne "$none" ] || first=$second
[ "$second" -ne "$none" ] || second=$first
[ "$first" -eq 0 ] || exit "$first"
exit "$second"
