"""Picture features of scenes that have pictures, by an encoder that the user brings as ONNX file.

The file of features, and how a picture is prepared for the encoder, follow from the channels of
its map: those of ResNet18 on ImageNet or those of CLIP's RN50.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import tyro
from PIL import Image
from tqdm import tqdm

from cfnav_core.files.whole import whole
from cfnav_core.perception.onnx_session import open_session
from cfnav_core.published.arrays import MAP_CHANNELS, MAP_SIDE
from cfnav_core.published.state_file import StateFile, StateWriter
from cfnav_core.scenes.layouts import scenes_root
from cfnav_core.scenes.scene import SceneError

IMAGES = "images.hdf5"
"""Pictures of all states, uint8 [300, 300, 3] each."""


@dataclass(frozen=True)
class Preparation:
    """How pictures go in, and where features go: scaled to 0..1, less mean, by deviation."""

    file: str
    mean: tuple[float, float, float]
    deviation: tuple[float, float, float]
    filter: Image.Resampling


PREPARATIONS = {
    512: Preparation(
        "resnet18_featuremap.hdf5", (0.485, 0.456, 0.406), (0.229, 0.224, 0.225),
        Image.Resampling.BILINEAR,
    ),
    2048: Preparation(
        "clip_featuremap.hdf5", (0.48145466, 0.4578275, 0.40821073),
        (0.26862954, 0.26130258, 0.27577711), Image.Resampling.BICUBIC,
    ),
}  # fmt: skip
"""Channels of the map to its kind: torchvision's ResNet18 and OpenAI's CLIP."""


class Encoder:
    """A picture encoder: one input float32 [N, 3, S, S], first output [N, 512 or 2048, 7, 7].

    Args:
        path: ONNX file.

    Raises:
        SceneError: it is missing, no ONNX network, or of other shapes.
    """

    def __init__(self, path: Path) -> None:
        try:
            self._session = open_session(path.read_bytes())
        except (OSError, ValueError) as error:
            raise SceneError(f"found no usable encoder at {path} ({error}); export it to ONNX "
                             "again") from error  # fmt: skip
        inputs = [(i.type, *i.shape) for i in self._session.get_inputs()]
        kind, _, *colours_and_sides = inputs[0]
        self.side = colours_and_sides[-1]
        fits = len(inputs) == 1 and kind == "tensor(float)" and isinstance(self.side, int)
        fits = fits and colours_and_sides == [3, self.side, self.side]
        output = self._session.get_outputs()[0].shape
        if not fits or output[1:] not in [[c, MAP_SIDE, MAP_SIDE] for c in MAP_CHANNELS]:
            raise SceneError(
                f"found inputs {inputs} and output {output} in {path}, expected one float32 input "
                "[N, 3, S, S] with a fixed S and an output [N, 512 or 2048, 7, 7]; export the "
                "encoder without its last pooling"
            )
        self.kind = PREPARATIONS[output[1]]

    def __call__(self, rgb: np.ndarray) -> np.ndarray:
        """Features float32 [512 or 2048, 7, 7] of a picture uint8 [H, W, 3].

        Raises:
            SceneError: it is no such picture.
        """
        if rgb.dtype != np.uint8 or rgb.ndim != 3 or rgb.shape[2] != 3:
            raise SceneError(f"found a picture {rgb.dtype} {rgb.shape}, expected uint8 [H, W, 3]")
        # Pillow: the encoders learnt from filters that widen as pictures shrink; OpenCV's do not.
        resized = Image.fromarray(rgb).resize((self.side, self.side), self.kind.filter)
        x = (np.asarray(resized, np.float32) / 255 - self.kind.mean) / self.kind.deviation
        (name,) = (i.name for i in self._session.get_inputs())
        batch = {name: x.transpose(2, 0, 1)[None].astype(np.float32)}
        features: np.ndarray = self._session.run(None, batch)[0][0]
        return features


def add_features(folder: Path, encoder: Encoder) -> int:
    """Encode the pictures of a scene; the file of features appears only when complete.

    Returns:
        The number of states.

    Raises:
        SceneError: there are no pictures, or one cannot be read.
        WriteError: the disk is full or refuses.
    """
    pictures = StateFile(folder / IMAGES)
    try:
        with whole(folder / encoder.kind.file) as path, StateWriter(path) as features:
            for key in pictures.names:
                try:
                    features.add(key, encoder(pictures.read(key)))
                except SceneError as error:
                    raise SceneError(f"{error} (state {key} of {pictures.path})") from error
    finally:
        pictures.close()
    return len(pictures.names)


@dataclass(frozen=True)
class FeaturesData:
    """Make the picture features of scenes that have images.hdf5, with an encoder of your own.

    AI2-THOR exports have pictures and no features; the published picture archives work too. Run it
    again to go on; scenes that have the file are kept.
    """

    folder: Annotated[Path, tyro.conf.Positional]
    """Folder of the scenes."""
    model: Path
    """ONNX file of ResNet18 (ImageNet) or CLIP's RN50 up to the 7x7 map; none is shipped."""

    def run_command(self) -> None:
        """Encode."""
        encoder = Encoder(self.model)
        found = scenes_root(self.folder).glob("FloorPlan*")
        folders = sorted(p for p in found if p.is_dir() and p.suffix != ".partial")
        todo = [f for f in folders if not (f / encoder.kind.file).exists()]
        for folder in tqdm(todo, unit="scene"):
            tqdm.write(f"{folder.name}: {add_features(folder, encoder)} states")
        print(f"{encoder.kind.file} in {len(folders)} scenes of {self.folder}")
