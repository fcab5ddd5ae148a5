"""ROC, precision and recall, worked out by hand; the other measures: tests/ros/test_calibration."""

import numpy as np
import pytest

from cfnav_core.task import calibration as cal

#               0.9: came true; 0.7 twice: one of each; 0.4: not; 0.2: came true
P = np.array([0.2, 0.7, 0.9, 0.4, 0.7])
Y = np.array([1, 0, 1, 0, 1], bool)


def test_the_roc_curve_by_hand():
    thirds = 1 / 3
    np.testing.assert_allclose(
        cal.roc_curve(P, Y),
        [
            (np.inf, 0, 0),
            (0.9, 0, thirds),
            (0.7, 0.5, 2 * thirds),
            (0.4, 1, 2 * thirds),
            (0.2, 1, 1),
        ],
    )
    # Of 6 pairs: 0.9 beats both, 0.7 ties one and beats one, 0.2 beats none.
    assert cal.auc(P, Y, np.ones(5)) == pytest.approx((2 + 1.5) / 6)


def test_the_area_under_the_curve_is_the_auc():
    rng = np.random.default_rng(0)
    p = rng.integers(0, 20, 500) / 20
    y = rng.random(500) < p
    curve = cal.roc_curve(p, y)
    area = np.trapezoid(curve[:, 2], curve[:, 1])
    assert cal.auc(p, y, np.ones(500)) == pytest.approx(area)


def test_precision_and_recall_by_hand():
    np.testing.assert_allclose(
        cal.precision_recall_curve(P, Y),
        [(0.9, 1, 1 / 3), (0.7, 2 / 3, 2 / 3), (0.4, 2 / 4, 2 / 3), (0.2, 3 / 5, 1)],
    )
    assert cal.average_precision(P, Y) == pytest.approx(1 / 3 + 2 / 3 / 3 + 3 / 5 / 3)


def test_a_right_order_scores_one_and_a_constant_the_base_rate():
    y = np.array([0, 0, 0, 1], bool)
    assert cal.average_precision(np.array([0.1, 0.2, 0.3, 0.4]), y) == 1.0
    assert cal.average_precision(np.full(4, 0.3), y) == 0.25
    assert cal.auc(np.full(4, 0.3), y, np.ones(4)) == 0.5


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("came_true", [True, False])
def test_one_class_only_cannot_be_told(came_true):
    y = np.full(5, came_true)
    assert np.isnan(cal.auc(P, y, np.ones(5)))
    assert np.isnan(cal.average_precision(P, y))
    assert cal.roc_curve(P, y).shape == (0, 3)


@pytest.mark.filterwarnings("error")
def test_no_predictions_cannot_be_told():
    none, nothing = np.empty(0), np.empty(0, bool)
    assert np.isnan(cal.auc(none, nothing, none))
    assert np.isnan(cal.average_precision(none, nothing))
    assert np.isnan(cal.calibration_error(none, nothing))
    assert np.isnan(cal.error_interval(none, nothing)).all()
    assert cal.precision_recall_curve(none, nothing).shape == (0, 3)
    assert cal.bins(none, nothing) == []


def test_every_prediction_is_put_into_bins_when_asked():
    p, y = np.array([0.0, 0.02, 0.98, 1.0]), np.array([0, 0, 1, 1], bool)
    assert cal.bins(p, y) == []
    found = cal.bins(p, y, within=cal.EVERY)
    assert [(b.predicted, b.observed, b.count) for b in found] == [
        (pytest.approx(0.01), 0.0, 2),
        (pytest.approx(0.99), 1.0, 2),
    ]
    assert cal.calibration_error(p, y, within=cal.EVERY) == pytest.approx(0.01)
