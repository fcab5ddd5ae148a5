"""What the LiDAR node says about itself: rates and times worked out by hand."""

import pytest
from cfnav_ros.lidar.diagnostics import KEPT, ScanStats
from cfnav_ros.lidar.estimate import Estimate, Verdict

SEEN = Estimate(0.25, 0.4, Verdict.GOOD, "", 0.9, 7.0)


def test_before_the_first_scan_nothing_is_made_up():
    values = ScanStats().values(SEEN, float("inf"), "")
    assert (values["scan_rate_hz"], values["processing_p99_ms"]) == ("0.00", "0.00")
    assert (values["scan_age_s"], values["mount"]) == ("inf", "none")


def test_rate_and_times_of_the_last_scans():
    stats = ScanStats()
    stats.add(0.0, 9.9)  # falls out of what is kept
    for k in range(KEPT):
        stats.add(100.0 + 0.125 * k, (k + 1) * 1e-4)
    assert stats.rate() == pytest.approx(8.0)
    # 0.1 to 10 ms in steps of 0.1: the middle and one hundredth below the top, interpolated.
    assert stats.took_ms(50) == pytest.approx(5.05)
    assert stats.took_ms(99) == pytest.approx(9.901)
    values = stats.values(SEEN, 0.05, "TF")
    assert values == {
        "probability": "0.250",
        "clearance_m": "0.400",
        "known_fraction": "0.900",
        "unknown_arc_deg": "7.0",
        "scan_rate_hz": "8.00",
        "scan_age_s": "0.05",
        "processing_p50_ms": "5.05",
        "processing_p99_ms": "9.90",
        "mount": "TF",
    }


def test_stamps_that_stand_still_give_no_rate():
    stats = ScanStats()
    stats.add(5.0, 0.001)
    stats.add(5.0, 0.001)
    assert stats.rate() == 0.0
