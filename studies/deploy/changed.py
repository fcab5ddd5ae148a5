"""What was changed in ``expectations`` after measurements had begun."""

from __future__ import annotations

from sim_bridge.faults.faults import FAULTS

CHANGED = {
    "scan_burst_loss": "2e4a58a: the motion under way is bounded, nothing was; aa95d81: later "
    "gaps, some of two scans, may be ridden through",
    "scan_late_0.2": "2e4a58a: was degrade; a scan's age counts from the end of its turn (a2c1a9d)",
    "scan_speckle": "6e16636: was degrade; a lone near return is a ghost by the reference; "
    "9770342: degrade again or ride through, as two in a row at one place end a MoveAhead",
    "scan_mirrored": "6e16636: was ride through; front and rear swap, so that the posts tell",
    "scan_standard": "f68006b: added with the fault",
    "odom_slip": "3607c94: was stop, but at rest nothing is wrong; 2e4a58a: the motion under "
    "way is bounded, nothing was",
    "base_pushed": "2e4a58a: the motion under way is bounded, nothing was",
    "hazards_silent": "2e9cc6e: added with the fault",
    "wheels_silent": "2e9cc6e: added with the fault",
    "dock_silent": "2e9cc6e: added with the fault",
    **dict.fromkeys(
        (
            "estimate_rival",
            "image_rival",
            "odom_rival",
            "hazards_rival",
            "scan_ranges_269_inf",
            "image_slow_1",
            "image_burst_loss",
            "image_stamp_back",
            "image_stamp_jumps",
            "odom_slow_8",
            "odom_slow_3",
            "odom_stamp_back",
            "cmd_cut_1",
        ),
        "f68006b: added with the fault",
    ),
    **dict.fromkeys(
        [name for name in FAULTS if name.startswith("depth_")], "38efbc4: added with the fault"
    ),
    "hazards_lost_once": "f68006b: added with the fault; 2b83308: was ride through, as nothing was "
    "bumped while the bumper was silent; now the only word of a bump comes late",
    **dict.fromkeys(("camera_start_hangs", "camera_start_fails"), "4d12398: added with the fault"),
    **dict.fromkeys(
        [name for name in FAULTS if name.startswith("detections_")], "d849cf7: added with the fault"
    ),
    "relay_hangs": "f68006b: added with the fault; f68006b: limit was that of odometry, but the "
    "commands pass through the relay too",
    **dict.fromkeys(
        ("base_action", "base_frees_itself", "base_slowed"), "f68006b: added with the fault"
    ),
    **dict.fromkeys(
        ("odom_drift_ahead", "odom_drift_back"),
        "f68006b: added with the fault; f68006b: drifts twice as fast, bounded from the next "
        "odometry on",
    ),
    **dict.fromkeys(
        ("cmd_late_0.5", "cmd_late_1", "cmd_late_2"),
        "f68006b: added with the fault; 7714b2f: was degrade without a bound and with any sentence",
    ),
    "cmd_late_0.35": "7714b2f: added with the fault",
    "cmd_late_10": "f68006b: added with the fault; f68006b: was degrade, but nothing is done in "
    "time; 7714b2f: bounded until what is queued has been done, with a sentence that names it",
}
"""Faults whose expectation was changed after measurements had begun: commit and reason."""
