"""What ``metadata.yaml`` says of a bag; it is written last, so a bag may be whole without it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path, PurePath

from ruamel.yaml import YAML

from cfnav_ros.bags.files.storage import BagTopic, Notes, ros_type

METADATA = "metadata.yaml"

MAX_METADATA = 16 * 2**20
"""Bytes; recorders write a few thousand."""


@dataclass(frozen=True)
class Metadata:
    """Names of the files in the order of recording, the topics, and what the recorder added.

    All may be empty.
    """

    files: tuple[str, ...] = ()
    topics: tuple[BagTopic, ...] = ()
    custom: Mapping[str, str] = field(default_factory=dict)

    @property
    def counted(self) -> bool:
        """Whether messages were counted; recorders that fail to list 0 of each topic."""
        return any(topic.count for topic in self.topics)


def read_metadata(folder: Path, notes: Notes) -> Metadata:
    """Read the metadata of a bag.

    Args:
        folder: of the bag.
        notes: take a sentence when it is missing or damaged.

    Returns:
        What it says, nothing when it is missing or damaged.
    """
    path = folder / METADATA
    if not path.exists():
        notes.add(f"{folder} has no {METADATA}: the recording broke off or was copied in part.")
        return Metadata()
    try:
        if path.stat().st_size > MAX_METADATA:
            raise ValueError(f"it is larger than {MAX_METADATA} bytes")
        said = YAML(typ="safe").load(path.read_text())["rosbag2_bagfile_information"]
        topics = []
        for entry in said["topics_with_message_count"]:
            about = entry["topic_metadata"]
            count = int(entry["message_count"])
            qos = about.get("offered_qos_profiles", "")
            topics.append(
                BagTopic(str(about["name"]), ros_type(str(about["type"])), count, qos=qos)
            )
        files = [PurePath(str(name)).name for name in said["relative_file_paths"]]
        custom = {str(key): str(value) for key, value in (said.get("custom_data") or {}).items()}
    except Exception as error:  # YAML of any shape fails in any way
        notes.add(f"{path} cannot be read: {' '.join(str(error).split())}.")
        return Metadata()
    return Metadata(tuple(files), tuple(topics), custom)
