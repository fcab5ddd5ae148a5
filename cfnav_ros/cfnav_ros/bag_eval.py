"""Judge every drive of a recorded bag: ``python -m cfnav_ros.bag_eval BAG``. Needs no ROS."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import tyro

from cfnav_ros.bags.evaluation import Options
from cfnav_ros.bags.evaluation import evaluate as evaluate_bag
from cfnav_ros.bags.reading import BagError, find_bags
from cfnav_ros.bags.results import METRICS, result_files
from cfnav_ros.bags.summary import summarise


def evaluate(bag: Annotated[Path, tyro.conf.Positional]) -> None:
    """Judge every drive of a recorded bag.

    Args:
        bag: folder of the bag, or its .mcap file.
    """
    evaluations = [evaluate_bag(found, Options()) for found in find_bags([bag])]
    print(result_files(evaluations, summarise(evaluations), {})[METRICS])


def main() -> None:
    """Run the command line; a bag that cannot be judged ends it with one sentence and code 2."""
    try:
        tyro.cli(evaluate, prog="bag_eval")
    except BagError as error:
        print(f"bag_eval: {error}", file=sys.stderr)
        sys.exit(2)


if __name__ == "__main__":
    main()
