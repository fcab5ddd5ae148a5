"""The task itself.

Actions, object and room names, what is visible, SR, SPL, CF-SR and CF-SPL, calibration.

May import: cfnav_core.files.
"""
