"""Definitions of messages as recorders write them, and what is read where one makes no sense."""

from __future__ import annotations

import sqlite3
import time

import pytest
from cfnav_ros.bags.files.message_types import WITHOUT_DEFINITION, MessageTypes
from cfnav_ros.bags.files.storage import BagTopic, Notes
from rosbags.interfaces import Nodetype

from studies.bags.bag_files import SQLITE, STORE, drive, write
from studies.bags.fuzz import read

DRIVE = drive()
ODOM, TRUTH = "nav_msgs/msg/Odometry", "cfnav_interfaces/msg/GroundTruth"
BASE = {
    "float32": "float", "float64": "double", "bool": "boolean", "byte": "octet", "int16": "short",
    "uint16": "unsigned short", "int64": "long long", "uint64": "unsigned long long",
}  # fmt: skip
"""Types of IDL that are called otherwise."""


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    return write(tmp_path_factory.mktemp("whole") / "bag", DRIVE, SQLITE)


@pytest.fixture(scope="module")
def expected(whole):
    events, notes = read(whole)
    assert notes == []
    return events


def defined(bag, path, language, define, *types):
    """The bag with other definitions of types, of all when none is named."""
    made = path / "bag.db3"
    made.write_bytes((bag / "bag.db3").read_bytes())
    base = sqlite3.connect(made)
    table = base.execute("SELECT topic_type FROM message_definitions").fetchall()
    for (kind,) in table:
        if not types or kind in types:
            base.execute(
                "UPDATE message_definitions SET encoded_message_definition = ?, encoding = ? "
                "WHERE topic_type = ?",
                (define(kind), language, kind),
            )
    base.commit()
    base.close()
    return made


def needed(kind):
    """A type and those in it, itself first."""
    found = [kind]
    for other in found:
        for _, declared in STORE.fielddefs[other][1]:
            of = declared if declared[0] is Nodetype.NAME else declared[1][0]
            if of[0] is Nodetype.NAME and of[1] not in found:
                found.append(of[1])
    return found


def field(name, declared, scoped):
    """A field in IDL."""
    node, what = declared
    if node is Nodetype.NAME:
        return f"{scoped(what)} {name};"
    if node is Nodetype.BASE:
        kind, _ = what
        return f"{BASE.get(kind, kind)} {name};"
    of = field("", what[0], scoped).strip(" ;")
    bound = f", {what[1]}" * bool(what[1])
    return (
        f"{of} {name}[{what[1]}];" if node is Nodetype.ARRAY else f"sequence<{of}{bound}> {name};"
    )


def scoped(kind):
    return kind.replace("/", "::")


def scoped_by_dds(kind):
    package, _, name = kind.split("/")
    return f"{package}::msg::dds_::{name}_"


def structure(kind, scoped=scoped):
    """The modules of IDL around a type."""
    *modules, name = scoped(kind).split("::")
    fields = "\n".join(
        f'@verbatim (language="comment", text=\n  "Of {n}." "\\n" "# {n}; {{}}")\n'
        f"{field(n, declared, scoped)}"
        for n, declared in STORE.fielddefs[kind][1]
    )
    head = " ".join(f"module {module} {{" for module in modules)
    return f"{head}\nstruct {name} {{\n{fields}\n}};\n{'};' * len(modules)}\n"


def as_rosbag2_writes(kind):
    """Every file behind a line of its own, as local_message_definition_source.cpp has it."""
    parts = [
        f"{'=' * 80}\nIDL: {each}\n// generated from rosidl_adapter/resource/msg.idl.em\n\n"
        + "".join(f'#include "{other}.idl"\n' for other in needed(each)[1:])
        + f"\n{structure(each)}\n"
        for each in needed(kind)
    ]
    return "".join(parts)


IDL = {
    "rosbag2": ("ros2idl", as_rosbag2_writes),
    "the first file bare": ("ros2idl", lambda kind: as_rosbag2_writes(kind).split("\n", 2)[2]),
    "one text": (
        "omgidl",
        lambda kind: "#pragma once\n/* all */\n" + "".join(map(structure, needed(kind)[::-1])),
    ),
    "names of DDS": (
        "omgidl",
        lambda kind: "".join(structure(each, scoped_by_dds) for each in needed(kind)),
    ),
}


@pytest.mark.parametrize("how", IDL)
def test_definitions_in_idl_read_the_same(tmp_path, whole, expected, how):
    assert read(defined(whole, tmp_path, *IDL[how])) == (expected, [])


SENSELESS = [
    ("float64", ""),
    ("nav_msgs/Odometry loop", ""),
    ("std_msgs/Header[1000000000] many", "1000000000 elements"),
    ("unknown_msgs/Thing thing", ""),
    ("float64 x\n" * 30_000, "has 300000 characters"),
]


@pytest.mark.parametrize("language", ["ros2msg", "ros2idl", "omgidl", "no language"])
@pytest.mark.parametrize(("definition", "said"), SENSELESS)
def test_a_known_type_is_read_though_its_definition_makes_no_sense(
    tmp_path, whole, expected, language, definition, said
):
    began = time.process_time()
    events, notes = read(defined(whole, tmp_path, language, lambda _: definition, ODOM))
    assert events == expected
    (note,) = notes
    assert note.startswith(
        f"The definition of {ODOM} for /odom makes no sense, so its messages are read as ROS 2 "
        "Jazzy has them: "
    )
    assert said in note or "idl" in language
    assert "\n" not in note
    assert time.process_time() - began < 20


@pytest.mark.parametrize(("definition", "said"), SENSELESS)
def test_a_type_that_only_a_damaged_definition_tells_costs_its_topic_only(
    tmp_path, whole, expected, definition, said
):
    events, notes = read(defined(whole, tmp_path, "ros2msg", lambda _: definition, TRUTH))
    assert events == [event for event in expected if event[0] != "Truth"]
    (note,) = notes
    assert note.startswith("/ground_truth/state is left out, its type")
    assert said in note


def test_messages_that_do_not_fit_the_known_type_are_not_made_up(tmp_path):
    said = [m._replace(type="geometry_msgs/msg/PoseStamped") for m in DRIVE if m.topic == "/odom"]
    odd = [m._replace(message=m.message.pose.pose, type="geometry_msgs/msg/Pose") for m in said]
    bag = write(tmp_path / "bag", odd, SQLITE)
    base = sqlite3.connect(bag / "bag.db3")
    base.execute("UPDATE topics SET type = ?", (ODOM,))
    base.execute(
        "UPDATE message_definitions SET topic_type = ?, encoded_message_definition = '?'", (ODOM,)
    )
    base.commit()
    base.close()
    (bag / "metadata.yaml").unlink()
    events, notes = read(bag / "bag.db3")
    assert {event[0] for event in events} == {"Unreadable"}
    assert any("20 messages of /odom make no sense" in note for note in notes)


@pytest.mark.parametrize("kind", sorted(WITHOUT_DEFINITION))
def test_types_of_bags_without_definitions_are_those_of_the_robot(kind):
    """ROS 2 tells types by a hash over all their fields."""
    notes = Notes()
    found = MessageTypes(notes).hash(BagTopic("/topic", kind, 1))
    assert (found, list(notes)) == (STORE.hash_rihs01(kind), [])
