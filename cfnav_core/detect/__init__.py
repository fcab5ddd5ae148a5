"""Object detectors of others, in ONNX files, and what their classes are called here.

May import: cfnav_core.files, cfnav_core.perception, cfnav_core.task.
"""
