"""``cfnav perceive``: what a perception finds in pictures, by name and with boxes."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import tyro

from cfnav_core.files.json_file import write_json
from cfnav_core.perception.boxes import LEAST, Detection
from cfnav_core.perception.perception import NETWORKS, OnnxPerception, PerceptionError
from cfnav_core.perception.pictures import draw_detections, read_rgb, window, write_png
from cfnav_core.policy.bundle import PERCEPTION, BundleHead, find_bundle


@dataclass(frozen=True)
class Perceive:
    """Name what pictures show, with a box around each thing.

    A picture of another shape than the camera's is cut to the largest part of it around the middle
    that has that shape. Boxes are left, top, right and bottom in pixels of the whole picture.
    """

    pictures: Annotated[tuple[Path, ...], tyro.conf.Positional]
    """Picture files; any camera's, but only pictures like those that it learnt from are judged
    well."""
    bundle: Path | None = None
    """Bundle whose perception looks, a folder or the name of a shipped one."""
    perception: Path | None = None
    """A perception.onnx instead."""
    camera: Literal["mast", "stock_wide"] = "mast"
    """Without either, which network of those that come with cfnav: for pictures from a mast, or
    from a TurtleBot 4 as sold."""
    least: float = LEAST
    """Score, 0 to 1, from which a thing is named."""
    out: Path | None = None
    """Also write the pictures with the boxes in them into this folder, as PNG."""
    json: Path | None = None
    """Also write the detections here."""

    def run_command(self) -> None:
        """Print a line for each thing.

        Raises:
            ValueError: there are no pictures, one does not fit, or the perception gives no boxes.
            OSError: a file cannot be read or written.
        """
        names = [path.stem for path in self.pictures]
        if not names or (self.out and len({*names}) < len(names)):
            raise ValueError(
                f"found pictures named {', '.join(names) or 'none'}, expected at least one, and "
                "with --out each of another name"
            )
        if not 0 < self.least <= 1:
            raise ValueError(f"found --least {self.least}, expected over 0 and at most 1")
        perception = self._network()
        width = max(map(len, names))
        told = {}
        for path in self.pictures:
            rgb = read_rgb(path)
            found = boxes_in(rgb, perception, self.least)
            told[str(path)] = [asdict(one) for one in found]
            for one in found:
                ends = " ".join(f"{end:7.1f}" for end in one.box)
                print(f"{path.stem:<{width}}  {one.name:<14} {one.score:.2f}  {ends}")
            if not found:
                print(f"{path.stem:<{width}}  nothing")
            if self.out:
                write_png(self.out / f"{path.stem}.png", draw_detections(rgb, found))
        if self.json:
            write_json(self.json, {"perception": perception.identity, "pictures": told})

    def _network(self) -> OnnxPerception:
        """The perception, which gives boxes."""
        path = self.perception or NETWORKS[self.camera]
        if self.bundle and not self.perception:
            folder = find_bundle(self.bundle)
            head = BundleHead.load(folder)
            if head.reads_sightings:
                raise PerceptionError(
                    f"found no perception in {folder}: this bundle reads what a detector says"
                )
            path = head.file(folder, PERCEPTION)
        perception = OnnxPerception(path)
        if perception.no_boxes:
            raise PerceptionError(perception.no_boxes)
        return perception


def boxes_in(rgb: np.ndarray, perception: OnnxPerception, least: float) -> list[Detection]:
    """Detections in a picture of any shape, best first, with boxes in its pixels.

    Args:
        rgb: uint8 [H, W, 3].
        perception: that gives boxes.
        least: score.
    """
    height, width = perception.gives.size
    left, top, right, bottom = window(rgb.shape[1], rgb.shape[0], width / height)
    return [
        replace(one, box=(one.box[0] + left, one.box[1] + top, one.box[2] + left, one.box[3] + top))
        for one in perception.boxes(rgb[top:bottom, left:right], least)
    ]
