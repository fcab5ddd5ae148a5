"""Pictures through other lenses: what is shown stays where its labels say."""

import torch

from cfnav_core.perception import augment as aug
from cfnav_core.perception.augment import Labelled, augment
from cfnav_core.perception.sight import FROM_MAST


def batch(count=64):
    """Dark pictures, each with a bright block of 3x3 cells somewhere, which the maps show."""
    (height, width), (rows, columns) = FROM_MAST.picture, FROM_MAST.heat
    pictures, heat = (
        torch.full((count, 3, height, width), 0.2),
        torch.zeros(count, 2, rows, columns),
    )
    for k in range(count):
        row, column = 3 + (5 * k) % (rows - 8), 3 + (7 * k) % (columns - 8)
        pictures[k, :, 8 * row - 1 : 8 * row + 23, 8 * column - 1 : 8 * column + 23] = 0.9
        heat[k, k % 2, row : row + 3, column : column + 3] = 200.0
    maps = torch.full((count, *FROM_MAST.coarse), 1.5)
    return Labelled(pictures, heat, heat.clone(), maps, maps / 3)


def drawn(seed=0):
    return torch.Generator().manual_seed(seed)


def middle(weight):
    """Row and column of a map's centre of weight, cells."""
    down, across = (torch.arange(cells).float() for cells in weight.shape)
    return torch.stack([weight.sum(1) @ down, weight.sum(0) @ across]) / weight.sum()


def test_the_same_draws_give_the_same_pictures_and_others_do_not():
    before = batch()
    first, again, other = (augment(before, drawn(seed)) for seed in (1, 1, 2))
    assert torch.equal(first.pictures, again.pictures)
    assert not torch.equal(first.pictures, other.pictures)
    assert torch.equal(before.pictures, batch().pictures)


def test_pictures_stay_pictures_and_labels_keep_their_meaning():
    after = augment(batch(), drawn())
    assert 0 <= after.pictures.min() < after.pictures.max() <= 1
    assert torch.allclose(after.depth, torch.tensor(1.5))
    assert torch.equal(after.visible.sum(1), torch.ones(64))
    assert torch.equal(after.heat, after.near)


def test_a_moved_picture_has_its_maps_moved_alike():
    before = batch()
    after = aug._mirrored(aug._moved(before, drawn()), drawn())
    assert not torch.equal(after.heat, before.heat)
    rows, columns = FROM_MAST.heat
    bright = torch.nn.functional.adaptive_avg_pool2d(after.pictures.mean(1), (rows, columns))
    for picture, heat in zip(bright, after.heat.sum(1), strict=True):
        middles = [middle((picture - 0.25).clamp(min=0)), middle(heat)]
        assert (middles[0] - middles[1]).abs().max() < 0.5


def test_every_change_changes_something_and_is_drawn_anew():
    pictures = batch().pictures
    for change in (aug._blurred, aug._lit, aug._vignetted, aug._covered, aug._noisy, aug._packed):
        changed = [change(pictures.clone(), drawn(seed)) for seed in range(4)]
        differs = [(c - pictures).abs().amax((1, 2, 3)) > 0.004 for c in changed]
        assert torch.cat(differs).any(), change.__name__
        assert not torch.equal(changed[0], changed[1]), change.__name__
