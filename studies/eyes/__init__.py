"""Perception networks judged on real pictures, beside COCO detectors on the same pictures.

No picture and no detector lies here: both are fetched out of packages (``studies.eyes.fetch``).

May import: cfnav_core, sim_bridge, studies.engine, torch.
"""
